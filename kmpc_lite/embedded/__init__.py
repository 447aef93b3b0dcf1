"""The controller as C99 for one robot: sources, its numbers, and test vectors."""

from kmpc_lite.embedded.compiled_controller import CompiledController, CompiledPlan
from kmpc_lite.embedded.folder import export

__all__ = ["CompiledController", "CompiledPlan", "export"]
