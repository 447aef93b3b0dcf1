"""The verified way to a standstill."""
