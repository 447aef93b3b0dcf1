"""Bytes <-> frames of the serial motor controllers: pure functions, and bounded decoders."""
