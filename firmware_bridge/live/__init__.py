"""What can be watched while the robot drives."""
