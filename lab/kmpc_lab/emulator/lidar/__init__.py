"""Emulated lidars: the real bytes of what rays hit in a simulated world."""
