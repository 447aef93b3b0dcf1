"""A model of another robot is reported, and one that predicts worse than the learned gives way."""

from dataclasses import replace

from slipping_floors import go, model_of

from kmpc_lab import DifferentialDrive
from kmpc_lite.adaptation.online import Gains, OnlineAdaptation


class Mirrored(DifferentialDrive):
    """A robot that turns the other way round: the log of another robot, or a sign in its wiring."""

    def step(self, x, u, dt):
        return super().step(x, (u[0], -u[1]), dt)


def test_a_mirrored_robot_is_reported_within_seconds():
    adaptation = OnlineAdaptation(model_of(0.05))
    go(adaptation, Mirrored(0.05, seed=3), 80, 1)
    assert "turns -" in adaptation.wrong_model
    assert adaptation.model is adaptation.base
    adaptation.reset()
    assert not adaptation.wrong_model


def test_an_adapted_model_that_predicts_worse_gives_way_to_the_learned_one():
    adaptation = OnlineAdaptation(model_of(0.05))
    state = adaptation.state
    state.gains = Gains(turn=0.6)  # of a floor that is gone, and too little to raise an alarm
    adaptation.options = replace(adaptation.options, window_alarm=1e9, memory_alarm=1e9)
    go(adaptation, DifferentialDrive(0.05, seed=3), 200, 1)
    assert adaptation.gains == Gains() and adaptation.model is adaptation.base
