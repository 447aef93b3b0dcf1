"""A robot, a model and a map become a drive: commands, the ROS 2 node and the lab start here."""
