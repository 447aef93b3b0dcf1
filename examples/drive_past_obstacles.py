"""Drive a learned model past four obstacles on a floor that slips, and draw where it went.

The robot slips by 5 % on average, anew in every period; the controller knows it from a log only.
Ends in PNG pictures in the folder ``out/figures``.

    python examples/drive_past_obstacles.py
"""

from dataclasses import replace
from pathlib import Path

import kmpc_lab
import kmpc_lite as kl
from kmpc_lab import Scenario, draw_drives, drive

OUTPUT = Path("out") / "figures"


def main() -> None:
    floor = kmpc_lab.DifferentialDrive(slip=0.05, seed=1)
    model = kl.fit(kmpc_lab.generate_dataset(floor, episodes=40, steps=100, dt=0.1, seed=1))

    scenario = replace(
        Scenario.load("four_circles_1"), seed=7
    )  # another floor than the one that was learned on
    controller = kl.Controller(model, scenario.problem())
    run = drive(controller, scenario, dt=model.dt)

    print(
        f"{run.outcome.value} after {run.duration:.1f} s, {100 * run.position_error:.1f} cm from "
        "the goal"
    )
    print(f"smallest distance to an obstacle: {100 * run.clearance:.1f} cm")
    OUTPUT.mkdir(parents=True, exist_ok=True)
    draw_drives(OUTPUT / "drive.png", {"drive": run})
    print(f"wrote {OUTPUT / 'drive.png'}")


if __name__ == "__main__":
    main()
