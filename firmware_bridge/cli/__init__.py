"""The commands of the bridge: they become commands of `kmpc` through entry points."""
