"""Learning while driving: a model that follows a floor which changes."""
