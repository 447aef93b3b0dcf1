"""What must hold whatever happens to the gate's inputs."""

import math

from hypothesis import example, given, settings
from hypothesis import strategies as st

from firmware_bridge.messages import STILL, LinkStatus, State, VelocityCommand
from firmware_bridge.safety.gate import LONGEST_RISE, GateOutput, SafetyGate
from firmware_bridge.safety.gate_settings import GateSettings, Limits
from firmware_bridge.safety.gate_table import Action, GateState, Reason

TICK = 0.02
SLACK = 1e-9
speeds = st.floats(-3.0, 3.0)
wild = st.one_of(speeds, st.sampled_from([math.nan, math.inf, -math.inf, 1e308, -1e308, 5e-324]))
limits = st.builds(
    Limits,
    v_max=st.floats(0.05, 2.0),
    v_reverse=st.one_of(st.just(0.0), st.floats(0.05, 2.0)),
    omega_max=st.floats(0.1, 3.0),
    acceleration=st.floats(0.1, 5.0),
    deceleration=st.floats(0.1, 5.0),
    angular_acceleration=st.floats(0.1, 10.0),
    angular_deceleration=st.floats(0.1, 10.0),
)
inputs = st.fixed_dictionaries(
    {
        "dt": st.one_of(st.just(TICK), st.floats(-0.1, 2.0)),
        "command": st.one_of(st.none(), st.tuples(wild, wild)),
        "pose": st.one_of(st.none(), st.tuples(wild, wild)),
        "ages": st.tuples(
            *[st.one_of(st.just(0.0), st.floats(-1.0, 1.0), st.just(math.nan), st.just(math.inf))]
            * 4
        ),
        "scan": st.sampled_from([None, 0.0, 0.1, 0.6, -1.0, math.nan, math.inf]),
        "ready": st.booleans(),
        "pose_ok": st.booleans(),
        "connected": st.booleans(),
        "faults": st.sampled_from([(), (), ("over-temperature",)]),
        "request": st.sampled_from([None, None, None, "enable", "stop", "estop", "reset"]),
    }
)
GOOD = {
    "dt": TICK,
    "ages": (0.0,) * 4,
    "scan": None,
    "ready": True,
    "pose_ok": True,
    "connected": True,
    "faults": (),
    "request": None,
}


def step(gate: SafetyGate, now: float, given: dict) -> GateOutput:
    if given["request"]:
        getattr(gate, given["request"])()
    command_age, pose_age, source_age, heard_age = given["ages"]
    status = LinkStatus(
        given["connected"],
        now - heard_age,
        now - source_age,
        given["ready"],
        given["pose_ok"],
        faults=given["faults"],
        scan_stamp=None if given["scan"] is None else now - given["scan"],
    )
    command = (
        None if given["command"] is None else VelocityCommand(*given["command"], now - command_age)
    )
    state = None if given["pose"] is None else State(*given["pose"], 0.0, 0.0, 0.0, now - pose_age)
    return gate.step(now, command, state, status)


def shrinks(before: float, after: float) -> bool:
    return before * after >= 0.0 and abs(after) <= abs(before) + SLACK


@st.composite
def histories(draw):
    """Mostly good stretches, so that the gate really drives, between anything at all."""
    steps = []
    for _ in range(draw(st.integers(1, 6))):
        steps += draw(st.lists(inputs, max_size=4))
        command, count = draw(st.tuples(speeds, speeds)), draw(st.integers(1, 60))
        steps += [
            {
                **GOOD,
                "command": command,
                "pose": (0.0, 0.0),
                "request": "enable" if k == 0 else None,
            }
            for k in range(count)
        ]
    return steps


@settings(max_examples=150, deadline=None)
@given(limits, st.booleans(), histories())
def test_limits_hold_whatever_comes(bounds, pilot, history):
    gate, now, before = SafetyGate(GateSettings(bounds, pilot=pilot)), 10.0, (0.0, 0.0)
    latched = False
    for given_inputs in history:
        now += given_inputs["dt"]
        dt = max(given_inputs["dt"], 0.0)
        rise = min(dt, LONGEST_RISE)
        output = step(gate, now, given_inputs)
        assert math.isfinite(output.v) and math.isfinite(output.omega)
        assert (
            -bounds.v_reverse <= output.v <= bounds.v_max and abs(output.omega) <= bounds.omega_max
        )
        if output.state in (GateState.ACTIVE, GateState.STOPPING):
            for old, new, up, down in (
                (before[0], output.v, bounds.acceleration, bounds.deceleration),
                (before[1], output.omega, bounds.angular_acceleration, bounds.angular_deceleration),
            ):
                if shrinks(old, new):
                    assert abs(new - old) <= down * dt + SLACK
                elif old * new < 0.0:
                    assert abs(old) / (down * dt) + abs(new) / (up * rise) <= 1.0 + SLACK
                else:
                    assert abs(new - old) <= up * rise + SLACK
        else:
            assert (output.v, output.omega) == (0.0, 0.0)
        if output.state in (GateState.IDLE, GateState.YIELDED):
            assert output.action is Action.NOTHING
        if output.state is GateState.ACTIVE:
            assert output.reasons == ()
        if (
            pilot
            and output.action is Action.SEND
            and output.state is not GateState.ESTOP
            and Reason.NOT_READY in output.reasons
        ):
            assert {Reason.HEARTBEAT, Reason.LINK} & set(output.reasons), (
                "sent to a robot that somebody else has"
            )
        latched = given_inputs["request"] == "estop" or (
            latched and given_inputs["request"] != "reset"
        )
        assert not latched or output.state is GateState.ESTOP
        before = (output.v, output.omega)


@settings(max_examples=200, deadline=None)
@given(limits, speeds, speeds, st.sampled_from(range(4)), st.integers(30, 120))
def test_whatever_goes_stale_the_robot_is_braked_within_300_ms(bounds, v, omega, stale, ticks):
    gate, now = SafetyGate(GateSettings(bounds)), 10.0
    gate.enable()
    for _ in range(ticks):
        now += TICK
        output = step(gate, now, {**GOOD, "command": (v, omega), "pose": (0.0, 0.0)})
    assert output.state is GateState.ACTIVE
    lost = now
    while now - lost < 3.0:
        now += TICK
        ages = tuple(now - lost if k == stale else 0.0 for k in range(4))
        before, output = (
            output,
            step(gate, now, {**GOOD, "ages": ages, "command": (v, omega), "pose": (0.0, 0.0)}),
        )
        if now - lost > 0.3:
            assert output.state is not GateState.ACTIVE or now - lost < 0.4
            assert shrinks(before.v, output.v) and shrinks(before.omega, output.omega)
            assert (
                (output.v, output.omega) == (0.0, 0.0)
                or abs(output.v) < abs(before.v)
                or abs(output.omega) < abs(before.omega)
            )


@settings(max_examples=200, deadline=None)
@given(limits, speeds, speeds)
@example(Limits(1.0, 0.0, 1.0, 1.0, 1.0, 0.25, 1.0), 1.192092896e-07, 1.0)
def test_one_scale_for_both_speeds_keeps_the_curve_from_rest_and_to_rest(bounds, v, omega):
    target = bounds.clip((v, omega, 0.0))
    assert (
        v * target[1] == 0.0
        or abs(target[0] * omega - target[1] * v) <= 1e-9 * (1 + abs(v) + abs(omega))
        or bounds.v_reverse == 0.0 > v
    )
    command = STILL
    for goal in (target, STILL):
        for _ in range(100_000):
            command = bounds.slew(command, goal, TICK)
            assert abs(command[0] * target[1] - command[1] * target[0]) <= 1e-8
            if command == goal:
                break
        assert command == goal


@settings(max_examples=300, deadline=None)
@given(limits, speeds, speeds)
def test_clipping_keeps_what_is_within_bounds_and_the_signs(bounds, v, omega):
    clipped = bounds.clip((v, omega, 0.0))
    if -bounds.v_reverse <= v <= bounds.v_max and abs(omega) <= bounds.omega_max:
        assert clipped == (v, omega, 0.0)
    assert clipped[0] * v >= 0.0 and clipped[1] * omega >= 0.0
    assert bounds.clip(clipped) == clipped
