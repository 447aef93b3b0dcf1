"""kmpc bench: every contender steps from the same states, in turns, as a robot's caches find it."""
