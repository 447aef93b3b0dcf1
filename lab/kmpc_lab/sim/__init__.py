"""Plants, maps, closed loops and the digital twin."""
