"""What must not be touched: shapes, maps, distances; `nmpc.sqp` makes half-planes of them."""
