"""`kmpc study clutter`: cylinders in the manner of the BARN challenge, driven by lidar alone."""
