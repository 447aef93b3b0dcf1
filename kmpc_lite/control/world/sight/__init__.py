"""What scans have shown: a map of cells around the robot, and what a step needs of it."""
