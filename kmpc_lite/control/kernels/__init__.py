"""The numeric functions of a step: C-contiguous float64 arrays in, arrays out, NumPy only.

The same functions are written in C (`c/`), which `pip install` builds if there is a compiler.
`choose_kernels` gives either; both make the same decisions.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any

from kmpc_lite.control.kernels import (
    boxes,
    clearance,
    clusters,
    fill,
    following,
    safe_motion,
    scan_beams,
    scan_map,
    stop_errors,
    tracks,
)
from kmpc_lite.errors import ProblemError
from kmpc_lite.types import Array


@dataclass(frozen=True, eq=False, slots=True)
class Kernels:
    """Functions of a step that exist in both languages; the modules of NumPy describe them."""

    compiled: bool
    """Whether they run in C."""
    distances_of_motions: Callable[[Array, Array, Array], Array]
    box_distances: Callable[[Array, Array, Array], Array]
    nearest_boxes: Callable[[Array, Array, Array, float, int], tuple[Array, Array, Array]]
    fill: Callable[..., None]
    stop_errors: Callable[..., Array]
    samples: Callable[[Array, int], Array]
    between_samples: Callable[..., Array]
    surely_clear: Callable[..., Array]
    admissible: Callable[..., Array]
    locate: Callable[..., tuple[float, float]]
    along_path: Callable[..., Array]
    clusters: Callable[..., Array]
    follow: Callable[..., tuple[Array, Array]]
    told_beams: Callable[..., tuple[Array, Array, Array, Array]]
    averaged_ranges: Callable[..., tuple[Array, Array]]
    pass_rays: Callable[..., None]
    mark: Callable[..., None]
    hit_boxes: Callable[..., tuple[Array, Array]]
    rectangles: Callable[[Array], Array]
    closed_form: Callable[[Any], Any]
    """Makes of a model's symmetric form (`kmpc_lite.model.symmetric`) one of these kernels."""

    def __reduce__(self) -> tuple[Any, ...]:
        # a copy on another machine takes what is built there
        return choose_kernels, (None if self.compiled else False,)


NUMPY = Kernels(
    compiled=False,
    distances_of_motions=clearance.distances_of_motions,
    box_distances=boxes.box_distances,
    nearest_boxes=boxes.nearest_boxes,
    fill=fill.fill,
    stop_errors=stop_errors.stop_errors,
    samples=safe_motion.samples,
    between_samples=safe_motion.between_samples,
    surely_clear=safe_motion.surely_clear,
    admissible=safe_motion.admissible,
    locate=following.locate,
    along_path=following.along_path,
    clusters=clusters.clusters,
    follow=tracks.follow,
    told_beams=scan_beams.told_beams,
    averaged_ranges=scan_beams.averaged_ranges,
    pass_rays=scan_map.pass_rays,
    mark=scan_map.mark,
    hit_boxes=scan_map.hit_boxes,
    rectangles=scan_map.rectangles,
    closed_form=lambda form: form,
)


def compiled_kernels() -> Kernels | None:
    """The kernels in C; None if no compiler has built them."""
    try:
        from kmpc_lite.control.kernels import compiled, compiled_scan
    except ImportError:
        return None
    names = [field.name for field in fields(Kernels) if field.name != "compiled"]
    found = vars(compiled_scan) | vars(compiled)
    return Kernels(True, **{name: found[name] for name in names})


def choose_kernels(compiled: bool | None) -> Kernels:
    """Choose the kernels that a controller runs.

    Parameters
    ----------
    compiled : bool, optional
        True for C, False for NumPy; None for C where it was built.

    Raises
    ------
    ProblemError
        If C is asked for and was not built.
    """
    found = None if compiled is False else compiled_kernels()
    if found is not None:
        return found
    if compiled:
        raise ProblemError(
            "compiled=True: the kernels in C were not built; install a C compiler (gcc) and "
            "kmpc-lite again, or let compiled=None take NumPy"
        )
    return NUMPY
