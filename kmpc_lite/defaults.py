"""Defaults; imported before NumPy is."""

SHORTEST_PERIOD = 0.1
"""Period of models [s] if neither the user nor a slower log says otherwise: the paper's."""
