"""Where tests of the bridge's commands are run."""

from bridge_desk import desk as desk
