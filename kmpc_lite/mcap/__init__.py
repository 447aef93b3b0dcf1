"""MCAP, the container of Foxglove and ROS 2, with the standard library alone (https://mcap.dev)."""
