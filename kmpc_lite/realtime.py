"""Real time on a small board: making a process fit for a control loop."""

from __future__ import annotations

import gc
import os

THREAD_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")


def prepare_process(cpu: int | None = None, priority: int | None = 50) -> list[str]:
    """Make this process fit for a control loop; say what was done and what was not permitted.

    Freezes the garbage collector's view of what exists, pins to a core, asks for SCHED_FIFO. BLAS
    threads cannot be changed once NumPy is loaded: a note says if the environment had not limited
    them.

    `cpu`: core to pin to; none if not given. `priority`: of SCHED_FIFO, 1 to 99; None leaves the
    scheduler alone. Returns one line for each measure.
    """
    told = []
    gc.collect()
    gc.freeze()
    told.append("garbage collector: everything that exists is frozen")
    limited = [name for name in THREAD_VARIABLES if os.environ.get(name) == "1"]
    advice = f"not limited; set {' or '.join(THREAD_VARIABLES)} to 1 before Python starts"
    told.append(f"BLAS threads: {'1' if limited else advice}")
    if cpu is not None:
        try:
            os.sched_setaffinity(0, {cpu})
            told.append(f"pinned to core {cpu}")
        except (AttributeError, OSError) as error:
            told.append(f"not pinned to core {cpu}: {error}")
    if priority is not None:
        try:
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
            told.append(f"scheduler: SCHED_FIFO, priority {priority}")
        except (AttributeError, OSError) as error:
            told.append(f"scheduler: ordinary, SCHED_FIFO not permitted ({error})")
    return told
