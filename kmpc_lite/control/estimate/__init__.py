"""The present pose: commands sent before, what an old pose leads to, and the innovation.

How old a pose may be: `history.OLDEST_POSE` for the controller, `GateSettings.pose_age` in
`firmware_bridge` for the robot.
"""
