"""The present pose, and what was sent before."""
