"""The path around obstacles, and the reference along it."""
