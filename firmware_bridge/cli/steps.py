"""What a controller saw and planned on a real link, made a run that a report can show."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from firmware_bridge.messages import BridgeError

if TYPE_CHECKING:
    from kmpc_lite.sim import Run, Scenario


class Steps:
    """What the controller saw and planned, step by step, while commands passed.

    Parameters
    ----------
    period : float
        Of the controller [s].
    """

    def __init__(self, period: float) -> None:
        self.period = period
        self.rows: list[tuple[tuple[float, float, float], Any]] = []
        self.is_driving: Callable[[], bool] = lambda: False
        """Whether commands pass."""

    def __call__(self, pose: tuple[float, float, float], plan: Any) -> None:
        """Keep one step."""
        if self.is_driving():
            self.rows.append((pose, plan))

    def as_run(self, scenario: Scenario, report: dict[str, Any], info: dict[str, Any]) -> Run:
        """Make a run of the steps until the goal was reached, or of all.

        Poses are those that came through the link.

        Parameters
        ----------
        scenario : Scenario
            What was driven.
        report : dict
            Of `firmware_bridge.runtime.drive.run`.
        info : dict
            What to keep with the run.

        Raises
        ------
        BridgeError
            Where the robot never drove.
        """
        import numpy as np

        from kmpc_lite.sim import Outcome, Run

        if len(self.rows) < 2:
            raise BridgeError("the rover did not drive: no command passed the gate")
        arrived = report["arrived_after_s"]
        count = len(self.rows) - 1
        if arrived is not None:
            count = max(1, min(count, round(arrived / self.period)))
        states, plans = (
            np.array([pose for pose, _ in self.rows[: count + 1]]),
            [plan for _, plan in self.rows[:count]],
        )
        clearance = np.inf if report["clearance_m"] is None else report["clearance_m"]
        outcome = (
            Outcome.COLLISION
            if clearance < 0.0
            else Outcome.TIMEOUT
            if arrived is None
            else Outcome.REACHED
        )
        return Run(
            scenario=scenario,
            dt=self.period,
            outcome=outcome,
            duration=count * self.period if arrived is None else arrived,
            states=states,
            path=states,
            inputs=np.array([plan.command for plan in plans]),
            plans=np.array([plan.states for plan in plans]),
            statuses=tuple(plan.status.name for plan in plans),
            step_times=np.array([plan.timing["total"] for plan in plans]),
            clearance=clearance,
            info=info,
        )
