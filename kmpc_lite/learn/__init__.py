"""From logs to a model."""

from kmpc_lite.learn.calibration import with_quantiles
from kmpc_lite.learn.dataset import Dataset, Episode
from kmpc_lite.learn.evaluation import FitReport, evaluate
from kmpc_lite.learn.fitting import fit
from kmpc_lite.learn.regression import Accumulator

__all__ = ["Accumulator", "Dataset", "Episode", "FitReport", "evaluate", "fit", "with_quantiles"]
