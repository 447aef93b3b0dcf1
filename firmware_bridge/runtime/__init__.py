"""The loop on the robot, the controller in its thread, one drive from connect to end."""
