"""A short course for robots in real time, and a gate that a busy machine does not trip."""

COURSE = """
[map]
bounds = [-2.0, -2.0, 2.0, 2.0]
circles = [[0.4, 0.45, 0.1]]
[robot]
radius = 0.15
start = [0.0, 0.0, 0.0]
goal = [0.7, 0.15, 0.0]
[run]
margin = 0.05
"""
FAR = COURSE.replace("goal = [0.7, 0.15, 0.0]", "goal = [1.8, -0.3, 0.0]")
"""Far enough away that a drive can be disturbed on its way."""
PATIENT = [
    *("--set", "safety.watchdog=5"),
    *("--set", "safety.pose_age=5"),
    *("--set", "safety.heartbeat_age=5"),
]
"""What is late is waited for: the gate's own tests, on a clock of their own, show that it stops."""
