"""`Controller` drives a wheeled robot past obstacles to a pose, with a model learned from its log.

    model = kmpc_lite.nominal_unicycle(0.1)  # or fit(Dataset.load("log.csv"))
    controller = kmpc_lite.Controller(model)
    plan = controller.step(pose, goal, obstacles=[kmpc_lite.Circle(0.6, 0.6, 0.15)])
    send(plan.command)  # every 0.1 s

`help(kmpc_lite.Controller)` says the rest. The public names stand in `kmpc_lite.api`, which is
imported when the first of them is asked for: `kmpc --help` does not wait for NumPy.
"""

import importlib
import typing

__version__ = "0.3.0.dev0"
_IN_THE_LAB = {"DifferentialDrive", "generate_dataset"}
_IN_THE_LAB |= {"bench", "peers", "report", "sim", "studies"}
"""Names and packages that moved to the distribution kmpc-lab."""

if typing.TYPE_CHECKING:
    from kmpc_lite.api import *  # noqa: F403
    from kmpc_lite.api import __all__ as __all__
    from kmpc_lite.embedded import CompiledController as CompiledController
    from kmpc_lite.embedded import CompiledPlan as CompiledPlan
    from kmpc_lite.embedded import export as export
    from kmpc_lite.learn import Accumulator as Accumulator
    from kmpc_lite.learn import Dataset as Dataset
    from kmpc_lite.learn import Episode as Episode
    from kmpc_lite.learn import FitReport as FitReport
    from kmpc_lite.learn import evaluate as evaluate
    from kmpc_lite.learn import fit as fit
    from kmpc_lite.learn import with_quantiles as with_quantiles
else:

    def __getattr__(name: str) -> typing.Any:
        """Import a public name."""
        if name in _IN_THE_LAB:
            raise AttributeError(f"kmpc_lite.{name} is kmpc_lab.{name} now: pip install kmpc-lab")
        private = name.startswith("_") and name != "__all__"
        api = None if private else importlib.import_module("kmpc_lite.api")
        if api is None or name not in ("__all__", *api.__all__):
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        value = globals()[name] = getattr(api, name)
        return value

    def __dir__() -> list[str]:
        return sorted({*globals(), *importlib.import_module("kmpc_lite.api").__all__})
