"""The command ``kmpc``."""
