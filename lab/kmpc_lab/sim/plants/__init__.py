"""Plants: what the controller does not know."""
