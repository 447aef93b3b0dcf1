"""The control loop on the robot, the controller's thread, and one drive from connect to release."""
