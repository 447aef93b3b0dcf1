"""What must not change the gains: full turns of the heading, and the scale of the robot."""

from dataclasses import replace

import numpy as np
from slipping_floors import DT, U_MAX, model_of

from kmpc_lab import DifferentialDrive
from kmpc_lite import nominal_unicycle
from kmpc_lite.adaptation.online import OnlineAdaptation
from kmpc_lite.scale import Scale


def test_a_heading_that_has_turned_full_circles_is_still_the_same_heading():
    # a model fitted on noise knows a little of the heading itself: nothing true of one that was
    # never in its log
    model = model_of(0.2)
    h = model.H.copy()
    h[0, model.dictionary.size + model.dictionary.names.index("theta")] += 0.02
    adaptation, turned = (OnlineAdaptation(replace(model, H=h)) for _ in range(2))
    random, x, plant = np.random.default_rng(0), np.zeros(3), DifferentialDrive(0.2, seed=3)
    for _ in range(100):
        u = random.uniform(-1, 1, 2) * U_MAX
        after = plant.step(x, u, DT)
        adaptation.update(x, u, after)
        turned.update(x + (0, 0, 6 * np.pi), u, after + (0, 0, 6 * np.pi))
        x = after
    assert adaptation.counts == turned.counts
    kept = (a.state.steps.view(float) for a in (adaptation, turned))
    np.testing.assert_allclose(*kept, rtol=1e-6, atol=1e-9)


def test_the_same_robot_scaled_learns_the_same_gains():
    scale = Scale(4.0, 2.0)
    one = OnlineAdaptation(nominal_unicycle(DT))
    large = OnlineAdaptation(nominal_unicycle(DT * scale.time), scale=scale)
    random, x, plant = np.random.default_rng(0), np.zeros(3), DifferentialDrive(turn_gain=0.7)
    for _ in range(100):
        u = random.uniform(-1, 1, 2) * U_MAX
        after = plant.step(x, u, DT) + random.normal(size=3) * 0.002
        first = one.update(x, u, after)
        second = large.update(x * scale.state, u * scale.command, after * scale.state)
        assert (first is None) == (second is None)
        x = after
    assert one.counts == large.counts and one.counts.models > 0
    assert one.gains[:3] == large.gains[:3] and 4.0 * large.gains.pull == one.gains.pull
