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

if typing.TYPE_CHECKING:
    from kmpc_lite.api import *
    from kmpc_lite.api import __all__ as __all__
    from kmpc_lite.embedded import *
    from kmpc_lite.learn import *
else:

    def __getattr__(name: str) -> typing.Any:
        """Import a public name."""
        private = name.startswith("_") and name != "__all__"
        api = None if private else importlib.import_module("kmpc_lite.api")
        if api is None or name not in ("__all__", *api.__all__):
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        value = globals()[name] = getattr(api, name)
        return value

    def __dir__() -> list[str]:
        return sorted({*globals(), *importlib.import_module("kmpc_lite.api").__all__})
