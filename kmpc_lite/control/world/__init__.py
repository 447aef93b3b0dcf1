"""What must not be touched: shapes, maps, distances.

A polygon goes from `shapes` through `solids` (distances) to `nmpc.fill_qp`, which adds the margins
and makes half-planes of it, one row of the QP for each stage.
"""
