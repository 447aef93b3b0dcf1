"""Steps a controller through recorded inputs, one for each line that arrives; answers with times.

`against` runs it as a process which finds the package of another commit on its path. It uses only
public names that all versions have.
"""

import json
import sys
from time import perf_counter
from typing import Any

import numpy as np

import kmpc_lite as kl


def obstacles_of(step: dict[str, Any]) -> Any:
    """Obstacles of a recorded step."""
    if "circles" in step:
        return np.array(step["circles"], dtype=float).reshape(-1, 5)
    return [kl.LaserScan(**scan) for scan in step["scans"]]


def main() -> None:
    """Answer each line, the numbers of a drive and of its step, with the step's time [s]."""
    recorded = json.loads(sys.stdin.readline())
    problem = kl.NavigationProblem(**recorded["problem"])
    controller = kl.Controller(kl.nominal_unicycle(problem.dt), problem)
    sys.stdout.write(f"{kl.__file__}\n")
    sys.stdout.flush()
    for line in sys.stdin:
        step = json.loads(line)
        if step["first"]:
            controller.reset()
        obstacles = obstacles_of(step)
        begin = perf_counter()
        controller.step(step["pose"], step["goal"], obstacles, step["sent"])
        sys.stdout.write(f"{perf_counter() - begin}\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
