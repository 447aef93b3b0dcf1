"""The safety gate, its limits, and the latched emergency stop."""
