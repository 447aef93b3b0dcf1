"""The planner of any wheels: a tree of poses grows from the goal until the start is reached."""
