"""The present pose: commands sent before, what an old pose leads to, and the innovation."""
