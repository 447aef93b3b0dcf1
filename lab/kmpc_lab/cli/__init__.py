"""The commands of the lab: they become commands of `kmpc` through entry points."""
