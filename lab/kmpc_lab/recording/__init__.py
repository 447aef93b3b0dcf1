"""Recorded drives at the desk: simulated ones are recorded and watched, all are read back."""
