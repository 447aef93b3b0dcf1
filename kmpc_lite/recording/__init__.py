"""Drives as files: what a controller saw, planned and sent, for Foxglove, for reports and fits."""
