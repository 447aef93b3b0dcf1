"""A drive as an MCAP file: what a controller saw, planned and sent; for Foxglove, reports, fits."""
