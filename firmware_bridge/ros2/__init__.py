"""A robot behind ROS 2 topics: an rclpy node beneath the same gate, recorder and emergency stop."""
