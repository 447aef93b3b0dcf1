"""The bilinear Koopman model: its dictionary, its noise, its file."""
