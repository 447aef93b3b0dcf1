"""Log formats: one reader a format."""
