"""Random maps by families."""
