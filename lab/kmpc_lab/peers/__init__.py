"""Controllers of others that solve the same problem through the same `step` (extra ``peers``)."""
