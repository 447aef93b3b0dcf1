"""What the options of adaptation mean for the paper's robot, on both sides of each number."""

from __future__ import annotations

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lite.adaptation import online
from kmpc_lite.adaptation.adapted_model import Refusal, refuse
from kmpc_lite.adaptation.gains import Estimate, Gains
from kmpc_lite.adaptation.online import OnlineAdaptation
from kmpc_lite.adaptation.options import AdaptationOptions

DT = 0.1
OPTIONS = AdaptationOptions()


def new(dt: float = DT) -> OnlineAdaptation:
    return OnlineAdaptation(kl.nominal_unicycle(dt))


def seen(v: float, omega: float, moved: float, turned: float = 0.0) -> str:
    """What becomes of a period in which a robot at the origin came so far ahead and turned."""
    adaptation = new()
    adaptation.update(np.zeros(3), np.array([v, omega]), np.array([moved, 0.0, turned]))
    counts = adaptation.counts
    return "used" if counts.used else "rejected" if counts.rejected else "still"


def test_the_window_has_two_seconds_and_eight_steps_and_the_memory_thirty_seconds() -> None:
    quick, slow = new(), new(1.0)
    assert len(quick.state.recent) == 20 and len(quick.state.raw) == 300
    assert len(slow.state.recent) == 8


def test_a_model_is_given_from_eight_steps_since_a_change_on(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for steps, gives in ((7, False), (8, True)):
        adaptation, given = new(), []

        def likeliest(sums: np.ndarray, scaled: bool = True, best: int = steps) -> Estimate:
            return Estimate(Gains(), float(sums[0] == best))

        adaptation.state.recent[:, 0] = 1.0
        adaptation.state.count = 20
        monkeypatch.setattr(adaptation, "_estimate", likeliest)
        monkeypatch.setattr(adaptation, "_give", given.append)
        adaptation._change()
        assert bool(given) is gives


@pytest.mark.parametrize(("distance", "alarm"), [(39.9, False), (40.1, True)])
def test_the_window_raises_an_alarm_at_forty(
    distance: float, alarm: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    adaptation, changes = new(), []
    adaptation.state.since = adaptation.state.count = 20
    estimate = Estimate(Gains(), distance)
    monkeypatch.setattr(adaptation, "_estimate", lambda sums: estimate)
    monkeypatch.setattr(adaptation, "_confirmed", lambda *rest: True)
    monkeypatch.setattr(adaptation, "_change", lambda: changes.append(1))
    adaptation._look_for_change()
    assert bool(changes) is alarm


@pytest.mark.parametrize(("distance", "alarm"), [(29.9, False), (30.1, True)])
def test_the_memory_raises_an_alarm_at_thirty(
    distance: float, alarm: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    adaptation, given = new(), []
    adaptation.state.since = adaptation.state.count = 48
    adaptation.state.next_model = 0
    estimate = Estimate(Gains(), distance)
    monkeypatch.setattr(adaptation, "_estimate", lambda sums: estimate)
    monkeypatch.setattr(adaptation, "_confirmed", lambda *rest: True)
    monkeypatch.setattr(adaptation, "_give", given.append)
    adaptation._look_for_change()
    assert bool(given) is alarm


@pytest.mark.parametrize(("distance", "confirmed"), [(19.9, False), (20.1, True)])
def test_an_alarm_is_confirmed_by_the_scatter_of_the_steps_themselves(
    distance: float, confirmed: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(online, "contradiction", lambda *rest: distance)
    assert new()._confirmed(Gains(), 5) is confirmed


def test_a_step_weighs_by_half_a_millimetre_and_three_tenths_of_the_usual() -> None:
    adaptation = new()
    a, b = adaptation._regressor._weigh(adaptation.state, 0.0, 0.0)
    # half a millimetre of position, half a milliradian of heading
    assert a == pytest.approx(1.0 / (1.3 * 0.0005**2))
    assert b == pytest.approx(1.0 / (1.3 * 0.0005**2))


def test_a_step_of_two_millimetres_or_milliradians_tells_of_the_floor() -> None:
    assert seen(0.0199, 0.0, 0.00199) == "still" and seen(0.0201, 0.0, 0.00201) == "used"
    assert seen(0.0, 0.0199, 0.0, 0.00199) == "still"
    assert seen(0.0, 0.0201, 0.0, 0.00201) == "used"


def test_three_times_what_was_commanded_and_five_centimetres_more_is_a_jump() -> None:
    assert seen(0.5, 0.0, 0.199) == "used" and seen(0.5, 0.0, 0.201) == "rejected"
    assert seen(0.5, 0.5, 0.05, 0.299) == "used" and seen(0.5, 0.5, 0.05, 0.301) == "rejected"


def test_who_does_less_than_a_tenth_is_held() -> None:
    # two centimetres, or 0.03 rad, should have been driven
    assert seen(0.199, 0.0, 0.0) == "used" and seen(0.201, 0.0, 0.0) == "rejected"
    assert seen(0.0, 0.299, 0.0) == "used" and seen(0.0, 0.301, 0.0) == "rejected"
    # a tenth of the five centimetres that should have been driven, and of the two above
    assert seen(0.5, 0.0, 0.0071) == "used" and seen(0.5, 0.0, 0.0069) == "rejected"


@pytest.mark.parametrize(
    ("floor", "robot"),
    [
        (Gains(ahead=0.201), Gains(ahead=0.199)),
        (Gains(ahead=2.49), Gains(ahead=2.51)),
        (Gains(turn=0.201), Gains(turn=0.199)),
        (Gains(turn=2.49), Gains(turn=2.51)),
        # of a speed of one
        (Gains(ahead=0.8029, left=0.596), Gains(ahead=0.7975, left=0.604)),
        (Gains(pull=1.99), Gains(pull=2.01)),
    ],
)
def test_gains_of_a_floor_and_those_of_another_robot(floor: Gains, robot: Gains) -> None:
    assert refuse(floor, OPTIONS, 1.0) is None
    assert refuse(robot, OPTIONS, 1.0) is not None


def refused(adaptation: OnlineAdaptation, back: int = 0) -> None:
    """Refuse gains that explain forty steps, of which so many led back."""
    steps = np.zeros((40, 20))
    steps[:, 0] = steps[:, 13] = np.where(np.arange(40) < back, -0.05, 0.05)
    # the robot has come four times as far as the model says
    steps[:, 2], steps[:, 7], steps[:, 9] = 4.0 * steps[:, 0], 1.0, 1.0
    state = adaptation.state
    state.raw[:40], state.count, state.since = steps, 40, 40
    adaptation._refuse(Gains(ahead=4.0), Refusal("it comes too far"))


def test_gains_found_twice_are_those_of_another_robot() -> None:
    adaptation = new()
    refused(adaptation)
    assert not adaptation.wrong_model
    refused(adaptation)
    assert adaptation.wrong_model


@pytest.mark.parametrize(("back", "counts"), [(9, True), (11, False)])
def test_a_drive_that_takes_half_of_itself_back_tells_nothing(back: int, counts: bool) -> None:
    adaptation = new()
    # 22 of 40 are left, or 18 of 40
    refused(adaptation, back)
    assert bool(adaptation.state.refusals) is counts


@pytest.mark.parametrize(("ratio", "worse"), [(1.095, False), (1.105, True)])
def test_an_adapted_model_may_be_worse_by_a_tenth(ratio: float, worse: bool) -> None:
    adaptation = new()
    adaptation.state.gains, adaptation.state.judged = Gains(turn=0.9), 100
    adaptation.state.errors = (10.0, 10.0 * ratio)
    assert adaptation._is_worse(np.zeros(20)) is worse
