"""Floods against a running bridge, and what they cost: gate, standstill, emergency stop."""
