"""Lidars: a file for each protocol's bytes, one for its driver; each driver is a `Lidar`."""
