"""An emulated robot behind ROS 2 topics: a simulator and a localisation as Nav2 has them."""
