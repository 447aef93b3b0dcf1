"""Folders in which kmpc is run."""

from command_fixtures import blank as blank
from command_fixtures import here as here
from command_fixtures import made as made
