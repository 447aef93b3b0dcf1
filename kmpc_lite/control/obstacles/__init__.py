"""What must not be touched: shapes, maps, distances, half-planes."""
