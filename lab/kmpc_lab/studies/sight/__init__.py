"""`kmpc study sight`: rooms, mazes and forests that a robot knows by its lidar alone."""
