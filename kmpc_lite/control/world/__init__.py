"""What must not be touched: shapes, maps, distances, half-planes.

A polygon goes from `shapes` through `solids` (distances) and `half_planes` (one row of the QP for
each stage) to `nmpc.fill_qp`, which adds the margins.
"""
