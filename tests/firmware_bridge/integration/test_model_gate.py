"""Before a model drives a robot: whose it is, what its log shows, and how hard the robot brakes."""

from dataclasses import replace

import pytest

import kmpc_lite as kl
from firmware_bridge.integration.model_gate import describe_model, fit_for, with_latency
from firmware_bridge.messages import ConfigError
from firmware_bridge.robot_file import load_robot
from firmware_bridge.safety.gate_settings import Limits

GEOMETRY = {"wheel_radius": 0.05, "track": 0.3}
ROVER = {"name": "rover-7", "driver": "roboclaw", "poses": "own", **GEOMETRY}
DRIVEN = {"forward": 0.3, "reverse": 0.3, "turn": 0.8}


def robot(name="rover-7", limits=None, **control):
    sections = {
        "robot": {"name": name},
        "link": {"driver": "roboclaw", "url": "pty:none"},
        "geometry": GEOMETRY,
        "limits": limits or {},
        "control": control,
    }
    return load_robot(None, sections)


def model(**info):
    made = {"vehicle": ROVER, "driven": DRIVEN, **info}
    return replace(kl.nominal_unicycle(0.1), info=made)


def stopping(deceleration, delay=0.3, stops=4):
    return {"deceleration": deceleration, "delay": delay, "stops": stops}


@pytest.mark.parametrize(
    ("given", "info", "words"),
    [
        ({"name": "rover-8"}, {}, "another vehicle .*name rover-7 and rover-8"),
        ({}, {"vehicle": ROVER | {"driver": "vesc"}}, "driver vesc and roboclaw"),
        ({}, {"vehicle": ROVER | {"track": 0.4}}, "track 0.4 and 0.3"),
        ({}, {"vehicle": ROVER | {"poses": "from outside"}}, "poses from outside and own"),
        ({"period": 0.05}, {}, "a period of 0.1 s, and control.period is 0.05 s"),
    ],
)
def test_a_model_of_another_robot_or_period_is_refused_unless_it_is_trusted(given, info, words):
    with pytest.raises(ConfigError, match=f"robot.npz: .*{words}.*--trust-model"):
        fit_for(robot(**given), model(**info), "robot.npz")
    _, notes = fit_for(robot(**given, trust_model=True), model(**info), "robot.npz")
    assert len(notes) == 1 and "used nevertheless" in notes[0]


def test_limits_beyond_what_the_log_shows_are_lowered_and_reported():
    fast = {"v_max": 0.6, "v_reverse": 0.6, "omega_max": 0.8}
    slowed, notes = fit_for(robot(limits=fast), model(), "robot.npz")
    limits = slowed.gate.limits
    assert (limits.v_max, limits.v_reverse, limits.omega_max) == (0.3, 0.3, 0.8)
    assert len(notes) == 1 and "v_max 0.3 m/s instead of 0.6" in notes[0]
    trusted, notes = fit_for(robot(limits=fast, trust_model=True), model(), "robot.npz")
    assert trusted.gate.limits.v_max == 0.6 and "does not show v_max" in notes[0]


@pytest.mark.parametrize(
    ("shown", "v_max", "taken"),
    [(0.4, 0.3, 0.4), (5.0, 0.3, 1.0), (3.0, 4.0, 3.0), (9.0, 4.0, 4.0), (0.5, 4.0, 0.5)],
)
def test_braking_follows_the_log_and_is_never_harder_than_it_shows(shown, v_max, taken):
    driven = {"forward": v_max, "reverse": v_max, "turn": 0.8}
    known = model(driven=driven, stopping=stopping(shown))
    braked, notes = fit_for(robot(limits={"v_max": v_max}), known, "robot.npz")
    assert braked.gate.limits.deceleration == taken <= shown
    assert bool(notes) == (taken != Limits().deceleration)


def test_braking_that_the_user_has_set_stays_and_is_doubted_where_the_log_shows_less():
    known = model(stopping=stopping(0.4))
    kept, notes = fit_for(robot(limits={"deceleration": 0.8}), known, "robot.npz")
    assert kept.gate.limits.deceleration == 0.8 and "slows down by 0.4" in notes[0]
    kept, notes = fit_for(robot(limits={"deceleration": 0.3}), known, "robot.npz")
    assert kept.gate.limits.deceleration == 0.3 and notes == []


@pytest.mark.parametrize(
    ("given", "delay", "taken"), [(None, 0.34, 0.34), (None, 2.0, 0.5), (0.1, 0.34, 0.1)]
)
def test_the_latency_of_a_model_without_lag_is_the_delay_of_its_log(given, delay, taken):
    known = model(stopping=stopping(1.0, delay))
    found, note = with_latency(robot(latency=given), known)
    assert found.control.latency == taken and bool(note) == (given is None)


def test_check_reports_the_model_its_limits_and_where_the_braking_comes_from(tmp_path):
    file = str(tmp_path / "robot.npz")
    ramps = {"faster": [0.4, None], "slower": [0.5, None]}
    model(stopping=stopping(0.5), log=["drive.csv"], ramps=ramps).save(file)
    text = "\n".join(text for ok, text in describe_model(robot(model=file)) if ok)
    assert "from drive.csv, period 0.1 s" in text and "0.5 m/s^2 (the model's log)" in text
    assert "0.3 s after its command" in text and "stopping distance from full speed: 0.18 m" in text
    assert "ramps: speed 0.4 m/s^2 faster, 0.5 m/s^2 slower: the controller commands no" in text
    assert "1 m/s^2 (the default)" in describe_model(robot())[0][1]
    assert "(the robot file)" in describe_model(robot(limits={"deceleration": 1.0}))[0][1]
    ok, text = describe_model(robot(name="another", model=file))[0]
    assert not ok and "another vehicle" in text
    assert not describe_model(robot(model="none.npz"))[0][0]
