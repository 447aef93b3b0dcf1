"""ROS messages that command cars."""

from __future__ import annotations

ACKERMANN = "ackermann_msgs/msg/AckermannDrive"
ACKERMANN_STAMPED = "ackermann_msgs/msg/AckermannDriveStamped"
STEERED = (ACKERMANN_STAMPED, ACKERMANN)
"""Commands of cars."""
FIELDS = {
    ACKERMANN: "".join(
        f"float32 {name}\n"
        for name in ("steering_angle", "steering_angle_velocity", "speed", "acceleration", "jerk")
    ),
    ACKERMANN_STAMPED: "std_msgs/Header header\nackermann_msgs/AckermannDrive drive",
}
"""Messages that no distribution has by itself."""
