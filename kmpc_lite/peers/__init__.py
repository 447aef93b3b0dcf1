"""Controllers of others, solving the same problem through the same `step`; each needs the extra ``peers``."""
