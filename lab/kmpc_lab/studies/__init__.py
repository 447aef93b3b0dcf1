"""Studies: who drives what, under which conditions, how often."""
