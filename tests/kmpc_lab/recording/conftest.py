"""A simulated drive, recorded once."""

from recorded_drives import content as content
from recorded_drives import recorded as recorded
from recorded_drives import scenario as scenario
