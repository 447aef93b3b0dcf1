"""Options of adaptation, each with its unit and its reason."""

from __future__ import annotations

from dataclasses import dataclass

from kmpc_lite.errors import ProblemError
from kmpc_lite.option_fields import angle, check, count, radii, seconds, share


@dataclass(frozen=True, slots=True)
class AdaptationOptions:
    """How fast, and how far, adaptation corrects a model.

    Lengths are in robot radii, speeds in shares of the fastest, times in seconds; `noise_floor` and
    `least_turn` are what poses are measured to, in the robot's units too.
    """

    window: float = seconds(2.0, zero=False)
    """Length of the newest drive in which a change is looked for [s]: 20 steps of 0.1 s determine
    gains well enough to predict 1 s ahead."""
    memory: float = seconds(30.0, zero=False)
    """Memory of the slow estimate [s]: short enough to follow a floor that wears."""
    fewest_steps: int = count(8)
    """Least number of steps since a change from which a model is given. Steps, not seconds: how
    surely gains are known hangs on how many tell of them."""
    window_alarm: float = share(40.0, zero=False)
    """Squared distance, in standard errors over four gains, between the window's estimate and the
    gains in use that counts as a change. Chance alone gives 4, but few steps are heavy-tailed."""
    memory_alarm: float = share(30.0, zero=False)
    """The same for the slow estimate."""
    confirmation: float = share(20.0, zero=False)
    """The same, with the noise estimated from these steps alone; an alarm must exceed it too, or a
    few slow steps would count too much where poses are noisier than in the log."""
    even_noise: float = share(0.3, zero=False)
    """Share of the usual noise that is added to every step's own: without it, the few slowest steps
    would outweigh all others where poses are noisy."""
    noise_floor: float = radii(1.0 / 300.0, zero=False)
    """Smallest noise that a step has [radii], and a tenth of a turn of as much [rad]."""
    turn_noise_floor: float = angle(5e-4, zero=False)
    """Smallest noise that the turn of a step has [rad]."""
    least_step: float = radii(1.0 / 75.0, zero=False)
    """A step that should move the robot less says nothing about the floor [radii]."""
    least_turn: float = angle(2e-3, zero=False)
    """A step that should turn the robot less says nothing about turns [rad]."""
    jump_factor: float = share(3.0, zero=False)
    """A pose that moved more than this many times what was commanded, and ..."""
    jump: float = radii(1.0 / 3.0, zero=False)
    """... this much more [radii], or ..."""
    jump_turn: float = angle(0.15, zero=False)
    """... this much more [rad], is a broken measurement, not a floor."""
    held: float = radii(2.0 / 15.0, zero=False)
    """A robot that should move by more [radii] and does next to nothing is held: by brakes, a wall,
    a pilot."""
    held_turn: float = angle(0.03, zero=False)
    """The same of turns [rad]."""
    held_share: float = share(0.1, zero=False)
    """What counts as next to nothing, as a share."""
    least_gain: float = share(0.2, zero=False)
    """A floor leaves at least this share of a commanded speed or turn; mud or ice that takes more
    is no floor to drive on."""
    largest_gain: float = share(2.5, zero=False)
    """No robot drives farther than its model says by a larger factor: even a log driven at half the
    speed explains only a factor of two."""
    largest_drift: float = share(0.6, zero=False)
    """Sideways drift as a share of the speed, a crab angle of 31 degrees: a floor that slopes or
    slips more makes the robot undrivable."""
    largest_pull: float = share(0.3, zero=False)
    """Turn to one side per radius driven [rad]: a flat tyre gives a tenth."""
    refusals_for_wrong: int = count(2)
    """How many times in a row gains that no floor can cause must be found, each time from fresh
    steps, before the model counts as another robot's."""
    back_and_forth: float = share(0.5, zero=False)
    """Net distance, or net turn where turns are what is wrong, as a share of the whole, below which
    a drive does not tell whether the model is another robot's."""
    worse: float = share(1.1, zero=False)
    """The adapted model returns to the learned one where its squared errors, over the memory, are
    this many times those of the learned one."""

    def __post_init__(self) -> None:
        check(self)
        if not self.window < self.memory:
            raise ProblemError(
                f"AdaptationOptions: expected window < memory, got {self.window:g} "
                f"and {self.memory:g} s"
            )
        if not self.least_gain < 1.0 < self.largest_gain:
            raise ProblemError(
                "AdaptationOptions: expected least_gain < 1 < largest_gain, "
                f"got {self.least_gain:g} and {self.largest_gain:g}"
            )
