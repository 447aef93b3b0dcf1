"""The numeric functions of a step: C-contiguous float64 arrays in, arrays out, NumPy only."""
