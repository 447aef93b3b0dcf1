"""kmpc bench: every solver on the same states, model and problem, in one run."""

from kmpc_lite.bench.contenders import Contender, contenders, full, full_contenders, plain
from kmpc_lite.bench.measure import Measurement, format_measurements, measure

__all__ = [
    "Contender",
    "Measurement",
    "contenders",
    "full",
    "full_contenders",
    "format_measurements",
    "measure",
    "plain",
]
