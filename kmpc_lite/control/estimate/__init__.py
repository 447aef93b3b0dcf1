"""The present pose, and the commands sent before.

How old a pose may be: `StepOptions.oldest_pose` for the controller, `GateSettings.pose_age` in
`firmware_bridge` for the robot.
"""
