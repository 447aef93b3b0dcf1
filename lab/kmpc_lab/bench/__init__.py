"""kmpc bench: every solver on the same states, model and problem, in one run."""

from kmpc_lab.bench.measure import Measurement, format_measurements, measure

__all__ = ["Measurement", "format_measurements", "measure"]
