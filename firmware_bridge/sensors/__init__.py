"""Poses and what else is measured outside the board."""
