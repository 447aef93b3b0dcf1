"""The safety gate, its limits, and the latched emergency stop.

`gate_settings` says how late a pose or a command may be, `gate_inputs` judges them, `gate_table`
says what follows. `estop` latches an emergency stop; `latch` keeps it on disk.
"""
