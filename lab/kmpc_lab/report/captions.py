"""What the captions of the pictures say."""

CAPTIONS = {
    "map": (
        "Map of the drive: obstacles, the robot's path and plans, start and goal",
        "To scale. Circles are the robot at the times beside them, "
        "the line in each points forward. Dashed lines are what the controller "
        "planned at some of those times, each up to its dot.",
    ),
    "commands": (
        "Commanded forward speed and turn rate over time",
        "What was sent to the motors, one step per period. Shaded: "
        "steps whose plan was not simply solved.",
    ),
    "errors": (
        "Distance to the goal, heading error and clearance over time",
        "Both errors must be within the dashed lines for the robot to have arrived. "
        "Clearance is from edge to edge.",
    ),
    "timing": (
        "Time of each control step and its distribution, against the period",
        "Time from pose to command. The first step starts without an earlier plan.",
    ),
    "fit": (
        "Held-out prediction errors of the model and of the nominal unicycle",
        "Smaller is better. The nominal unicycle is the robot that obeys its commands exactly.",
    ),
}
"""Alternative text and caption of each picture."""

MOVING_CAPTION = (
    " Moving obstacles are filled where they start and dotted where they are at the times in them."
)
