"""The same problem, scaled, gives the same drive: to the last bit for powers of two."""

from dataclasses import replace

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lite.scale import Scale
from kmpc_lite.types import Array

GOAL = (1.5, 1.5, 0.5)
CIRCLES = [(0.6, 0.6, 0.15, 0.0, 0.0), (1.3, 0.4, 0.1, -0.1, 0.05), (0.2, 1.2, 0.2, 0.0, 0.0)]
WALL, POLYGON = (-0.5, -1.0, 1.0, -0.8), [(-0.6, 0.8), (-0.2, 0.8), (-0.4, 1.2)]


def scaled_model(model: kl.KoopmanModel, scale: Scale) -> kl.KoopmanModel:
    """The model of the same robot, larger and faster: [1, x, y, theta, cos, sin] by hand."""
    length, speed = scale.length, scale.speed
    lifted = np.array(
        [1.0 if n in ("1", "theta", "cos", "sin") else length for n in model.dictionary.names]
    )
    rows, inputs = scale.state / scale.time, scale.command
    nz = model.dictionary.size
    h = model.H.reshape(3, 2, nz) * rows[:, None, None] / inputs[None, :, None] / lifted
    noise = model.noise_model
    if noise is not None:
        between = scale.state * scale.state[:, None]
        powers = np.array((1.0, *(inputs**2)))
        noise = replace(noise, coefficients=noise.coefficients * between / powers[:, None, None])
    assert speed > 0.0
    return replace(
        model,
        dt=model.dt * scale.time,
        A=model.A * rows[:, None] / lifted,
        B=model.B * rows[:, None] / inputs,
        H=h.reshape(3, -1),
        noise_model=noise,
    )


def scaled_problem(scale: Scale, **given: object) -> kl.NavigationProblem:
    problem = kl.NavigationProblem(**given)  # type: ignore[arg-type]
    return kl.NavigationProblem(
        dt=problem.dt * scale.time,
        u_min=problem.u_min * scale.command,
        u_max=problem.u_max * scale.command,
        x_min=problem.x_min * scale.state,
        x_max=problem.x_max * scale.state,
        robot_radius=problem.robot_radius * scale.length,
        margin=problem.margin * scale.length,
        deceleration=problem.deceleration * scale.acceleration,
        du_max=problem.du_max * scale.acceleration,
        sensor_range=problem.sensor_range and problem.sensor_range * scale.length,
    )


def obstacles(scale: Scale, k: int, dt: float) -> list[object]:
    length = scale.length
    x1, y1, x2, y2 = np.array(WALL) * length
    moved = [(x + vx * k * dt, y + vy * k * dt, r, vx, vy) for x, y, r, vx, vy in CIRCLES]
    return [
        *(kl.Circle(*(np.array(c) * scale.circle)) for c in moved),
        kl.Wall(x1, y1, x2, y2, 0.1 * length),
        kl.Polygon(np.array(POLYGON) * length),
    ]


def drive(model: kl.KoopmanModel, scale: Scale, solids: bool, **given: object) -> Array:
    """Poses and commands of a drive, in the units of the robot that is its own unit."""
    controller = kl.Controller(scaled_model(model, scale), scaled_problem(scale, **given))
    x, rows = np.array((0.05, -0.1, 0.3)), []
    random = np.random.default_rng(3)
    for k in range(70):
        seen = x + random.normal(size=3) * (0.004, 0.004, 0.01)
        things = obstacles(scale, k, 0.1)[: None if solids else 3]
        plan = controller.step(seen * scale.state, GOAL * scale.state, things)  # type: ignore[arg-type]
        command = plan.command / scale.command
        rows.append([*x, *command])
        x = model.predict(x, command * (1.1, 0.8))
    return np.array(rows)


@pytest.mark.parametrize("length, speed", [(4.0, 2.0), (0.25, 0.5), (16.0, 16.0)])
@pytest.mark.parametrize("solids", [False, True])
def test_powers_of_two_give_the_same_drive_to_the_last_bit(
    learned: kl.KoopmanModel, length: float, speed: float, solids: bool
) -> None:
    unit = drive(learned, Scale(), solids)
    np.testing.assert_array_equal(drive(learned, Scale(length, speed), solids), unit)
    assert np.hypot(*(unit[-1, :2] - GOAL[:2])) < 1.6  # it drives


@pytest.mark.parametrize("length, speed", [(0.1, 0.1), (30.0, 10.0), (1 / 0.3, 1 / 0.6)])
def test_other_scales_give_the_same_drive(learned: kl.KoopmanModel, length: float, speed: float):
    unit = drive(learned, Scale(), True)
    np.testing.assert_allclose(drive(learned, Scale(length, speed), True), unit, atol=1e-6)


def test_limits_scale_too(learned: kl.KoopmanModel) -> None:
    limits = {"du_max": (1.0, 4.0), "deceleration": (0.7, 3.0), "sensor_range": 0.9}
    unit = drive(learned, Scale(), False, **limits)
    np.testing.assert_array_equal(drive(learned, Scale(4.0, 1.0), False, **limits), unit)


FAR = 8e3  # within what is believed of a pose [m], but 24,000 units of a robot of 0.05 m


def small_robot() -> kl.Controller:
    problem = kl.NavigationProblem(
        robot_radius=0.05,
        u_min=(-0.2, -0.78),
        u_max=(0.2, 0.78),
        x_min=(-1e4, -1e4, -np.inf),
        x_max=(1e4, 1e4, np.inf),
    )
    return kl.Controller(kl.nominal_unicycle(0.1), problem)


def test_a_small_robot_far_from_the_origin_notices_that_its_pose_jumps() -> None:
    controller, goal = small_robot(), (FAR + 3.0, 0.0, 0.0)
    controller.step((FAR, 0.0, 0.0), goal)
    plan = controller.step((FAR, 5.0, 0.0), goal)
    assert plan.reason.startswith("the pose jumped by 5.0")


def test_the_last_plan_of_a_small_robot_far_from_the_origin_starts_the_next() -> None:
    controller = small_robot()
    pose, passes = np.array([FAR, 0.0, 0.0]), []
    for _ in range(5):
        plan = controller.step(pose, (FAR + 3.0, 0.0, 0.0), [kl.Circle(FAR + 1.0, 0.02, 0.1)])
        pose = plan.states[1]
        passes.append(plan.iterations)
    assert passes[1:] == [1, 1, 1, 1]
