"""The robots of the twin in MJCF: a ROSbot 2 on four tyres or on mecanum wheels, and a car.

Sources. ROSbot: github.com/husarion/rosbot_ros, ``rosbot_description/urdf/rosbot``:
``body.urdf.xacro`` (body: 1.728 kg, inertia, box 0.197 x 0.150 x 0.080 m), ``wheel.urdf.xacro``
(masses, inertias and places of both kinds of wheels, 1.5 N m, 24 rad/s) and
``rosbot_macro.urdf.xacro`` (radii 0.0425 m, and 0.047 m of mecanum wheels). Camera and lidar are on
the real robot and not in the body's 1.728 kg: a box and a cylinder of the makers' data sheets
(Orbbec Astra 0.30 kg, RPLIDAR A2 0.19 kg) stand for them. Car: the
F1TENTH car's numbers in github.com/f1tenth/f1tenth_gym (3.74 kg, 0.04712 kg m^2, axles 0.15875 and
0.17145 m from the centre of mass, which is 0.074 m high, lock 0.4189 rad, servo 3.2 rad/s, 0.58 x
0.31 m); its wheels of 0.052 m and their track of 0.25 m are those of the Traxxas car that it is
built on. Rollers and gears are ours.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from firmware_bridge.kinematics import CarGeometry, Geometry, OmniGeometry, WheelGeometry
from kmpc_lite.control.world.shapes import Circle

FREE = 100.0
"""Commands are not limited here, but by the motors [m/s]."""
ROTOR = 5e-4
"""Inertia of rotor and gears at a wheel: 4e-7 kg m^2 behind a gear of 1:34 [kg m^2]."""
CAR_TRACK, CAR_LOCK = 0.25, 0.4189
"""Distance between the wheels of a car's axle [m]; its largest steering angle [rad]."""
ROLLERS = 10
"""Of a mecanum wheel."""
ROLLER = 0.0085
"""Radius of a roller in its middle [m]."""
_ROSBOT = """
      <inertial pos="0 0 0.02" mass="1.728" diaginertia="0.004162 0.00651 0.008828"/>
      <geom name="body" class="body" size="0.0985 0.075 0.04" pos="0 0 0.02"/>
      <geom name="cover" class="mark" type="box" size="0.097 0.074 0.003" pos="0 0 0.062" mass="0"
            rgba="0.85 0.2 0.15 1"/>
      <body name="lidar" pos="0.02 0 0.085">
        <geom class="mark" type="cylinder" size="0.035 0.02" mass="0.19" rgba="0.05 0.05 0.05 1"/>
      </body>
      <body name="camera" pos="-0.03 0 0.18">
        <geom class="mark" type="box" size="0.02 0.08 0.02" mass="0.30" rgba="0.3 0.3 0.33 1"/>
        <geom class="mark" type="box" size="0.008 0.008 0.05" pos="-0.01 0 -0.06" mass="0"
              rgba="0.3 0.3 0.33 1"/>
      </body>"""
_TYRE = """
        <geom name="{name}" class="wheel" type="ellipsoid" size="{r} {width} {r}"/>
        <geom type="cylinder" size="{hub} {rim}" euler="90 0 0" contype="0" conaffinity="0"
              group="1" rgba="0.55 0.55 0.58 1" mass="0"/>"""
_JOINT = """
        <joint name="{name}" type="hinge" axis="0 1 0" damping="0.001" frictionloss="0.002"
               armature="{rotor}"/>"""
CORNERS = (("fl", 1, 1), ("fr", 1, -1), ("rl", -1, 1), ("rr", -1, -1))
"""Names of the wheels; whether they are in front and on the left."""
EACH = tuple(tuple(float(i == k) for i in range(4)) for k in range(4))
"""Each motor turns an axle."""
TIMESTEP = 0.0025
"""Time step of the physics [s]: the longest for which halving it changes where the robot comes to
by less than 1.5 % of its way."""
HEIGHT = 0.30
"""Height of the obstacles [m]."""
ROBOT_HITS, OBSTACLE = 1, 2
"""Bits of collision filtering: the robot meets obstacles; wheels meet the floor through pairs of
their own."""
_ROOM = """<mujoco model="{name}">
  <compiler angle="degree" inertiafromgeom="auto"/>
  <!-- implicitfast and an elliptic cone: sliding wheels neither chatter nor creep -->
  <option timestep="{timestep}" integrator="implicitfast" cone="elliptic" impratio="50"
          iterations="20" tolerance="1e-8"/>
  <visual>
    <global offwidth="960" offheight="720"/>
    <headlight ambient="0.35 0.35 0.35" diffuse="0.35 0.35 0.35" specular="0 0 0"/>
  </visual>
  <asset>
    <texture name="tiles" type="2d" builtin="checker" rgb1="0.80 0.80 0.78" rgb2="0.70 0.71 0.70"
             width="128" height="128"/>
    <material name="tiles" texture="tiles" texrepeat="8 8"/>
    <texture name="sky" type="skybox" builtin="gradient" rgb1="0.95 0.97 1" rgb2="0.75 0.82 0.9"
             width="64" height="64"/>
  </asset>
  <default>
    <!-- a tyre that is round across too touches in one point: one contact a wheel,
         as rubber under load carries in its middle -->
    <default class="wheel"><geom contype="{robot}" conaffinity="{obstacle}" rgba="0.1 0.1 0.1 1"
             mass="0"/></default>
    <default class="body"><geom type="box" contype="{robot}" conaffinity="{obstacle}" mass="0"
             rgba="0.12 0.12 0.13 1"/></default>
    <default class="obstacle">
      <geom type="cylinder" contype="{obstacle}" conaffinity="{robot}" rgba="0.2 0.22 0.25 1"
            friction="0.4 0.005 0.0001"/>
    </default>
    <default class="mark"><geom contype="0" conaffinity="0" group="1"/></default>
  </default>
  <worldbody>
    <light pos="0 0 5" dir="0.3 0.4 -1" directional="true" diffuse="0.3 0.3 0.3" specular="0 0 0"
           castshadow="false"/>
    <geom name="floor" type="plane" size="{half} {half} 0.1" material="tiles" contype="0"
          conaffinity="0"/>
    <camera name="above" pos="{cx} {cy} {above}" fovy="45"/>
    <camera name="aside" pos="{cx} {aside} {up}" xyaxes="1 0 0 0 0.65 0.76"
            fovy="45"/>{marks}{obstacles}
    <body name="robot" pos="0 0 {r}">
      <freejoint name="robot"/>{body}
    </body>
  </worldbody>
  <contact>{pairs}
  </contact>
{drives}
</mujoco>
"""


@dataclass(frozen=True)
class Vehicle:
    """A robot of the twin."""

    name: str
    geometry: Geometry
    """How its wheels turn for a command."""
    motors: tuple[int, ...]
    """Which wheel of the geometry each motor turns."""
    by_axles: tuple[tuple[float, ...], ...]
    """Share of each axle in the speed of each motor."""
    torque: float
    """Of a motor that is stalled, at the wheel [N m]."""
    top_speed: float
    """Of a wheel without load [rad/s]."""
    tyres: tuple[str, ...]
    """Geoms that touch the floor."""
    axles: tuple[str, ...]
    """Joints about which wheels roll: each is braked by the floor."""
    body: str
    """What is in the body of the robot, whose frame is that of its pose, at the wheels' height."""
    drives: str
    """Tendons and actuators: the motors, then the steering of the left and of the right wheel."""
    ramp: float = math.inf
    """How fast its board changes the set-point of a wheel [rad/s^2]: a narrow one would fall."""
    servo_rate: float = math.inf
    """How fast a car's servo turns its wheels [rad/s]."""

    @property
    def radius(self) -> float:
        """Of a wheel [m]."""
        return self.geometry.wheel_radius

    @property
    def car(self) -> CarGeometry | None:
        """Its geometry, if it is a car."""
        return self.geometry if isinstance(self.geometry, CarGeometry) else None


def _motors(names: tuple[str, ...], gain: float, torque: float) -> str:
    """One velocity loop a wheel; its proportional part is the actuator's own [N m s/rad]."""
    lines = "".join(
        f'\n    <velocity name="{name}" joint="{name}" kv="{gain}" '
        f'forcerange="-{torque} {torque}"/>'
        for name in names
    )
    return f"  <actuator>{lines}\n  </actuator>"


def _skid_steer() -> Vehicle:
    wheel = (
        _JOINT + '\n        <inertial pos="0 0 0" mass="0.074" diaginertia="{inertia}"/>' + _TYRE
    )
    wheels = "".join(
        f'\n      <body name="{name}" pos="{ahead * 0.106 / 2} {left * 0.192 / 2} 0">'
        + wheel.format(
            name=name,
            rotor=ROTOR,
            inertia="0.000041 0.000067 0.000041",
            r=0.0425,
            width=0.018,
            hub=0.7 * 0.0425,
            rim=0.0175,
        )
        + "\n      </body>"
        for name, ahead, left in CORNERS
    )
    names = tuple(name for name, _, _ in CORNERS)
    return Vehicle(
        "rosbot2",
        WheelGeometry(wheel_radius=0.0425, track=0.192, max_wheel_speed=FREE),
        (0, 1, 0, 1),
        EACH,
        torque=1.5,
        top_speed=24.0,
        tyres=names,
        axles=names,
        body=_ROSBOT + wheels,
        drives=_motors(names, 0.25, 1.5),
    )


def _mecanum() -> Vehicle:
    """Each wheel carries rollers that turn freely about axes at 45 degrees to its own.

    Seen from above they form an X. A barrel that touches the floor all along its way is as long as
    the root of twice its radius times the wheel's.
    """
    radius, names, tyres, wheels = 0.047, [], [], []
    barrel = math.sqrt(2.0 * ROLLER * radius)
    mass, inertia = 0.004, "4e-7 4e-7 1.5e-7"
    for name, ahead, left in CORNERS:
        names.append(name)
        rollers = []
        for k in range(ROLLERS):
            at = math.tau * k / ROLLERS
            roller = f"{name}{k}"
            tyres.append(roller)
            place = (radius - ROLLER) * math.sin(at), (radius - ROLLER) * math.cos(at)
            # the roller's axis is y, turned by 45 degrees about the spoke, which leads there
            turn = math.radians(-45.0 * ahead * left)
            spoke = math.sin(at), math.cos(at)
            half = math.sin(turn / 2.0)
            quaternion = f"{math.cos(turn / 2.0)} {half * spoke[0]} 0 {half * spoke[1]}"
            rollers.append(
                f'\n        <body name="{roller}" pos="{place[0]} 0 {place[1]}" '
                f'quat="{quaternion}">'
                f'\n          <joint name="{roller}" type="hinge" axis="0 1 0" damping="2e-5" '
                'frictionloss="2e-3" armature="2e-6"/>'
                f'\n          <inertial pos="0 0 0" mass="{mass}" diaginertia="{inertia}"/>'
                f'\n          <geom name="{roller}" class="wheel" type="ellipsoid" '
                f'size="{ROLLER} {barrel} {ROLLER}"/>'
                "\n        </body>"
            )
        joint = _JOINT.format(name=name, rotor=ROTOR)
        wheels.append(
            f'\n      <body name="{name}" pos="{ahead * 0.106 / 2} {left * 0.205 / 2} 0">{joint}'
            f'\n        <inertial pos="0 0 0" mass="{0.153 - ROLLERS * mass}" '
            'diaginertia="0.00007 0.0001 0.00007"/>'
            f'\n        <geom type="cylinder" size="{0.6 * radius} 0.0175" euler="90 0 0" '
            'contype="0" conaffinity="0" group="1" rgba="0.55 0.55 0.58 1" mass="0"/>'
            f"{''.join(rollers)}\n      </body>"
        )
    geometry = OmniGeometry(wheel_radius=radius, track=0.205, wheelbase=0.106, max_wheel_speed=FREE)
    return Vehicle(
        "rosbot2 on mecanum wheels",
        geometry,
        (0, 1, 2, 3),
        EACH,
        torque=1.5,
        top_speed=24.0,
        tyres=tuple(tyres),
        ramp=60.0,
        axles=tuple(names),
        body=_ROSBOT + "".join(wheels),
        drives=_motors(tuple(names), 0.25, 1.5),
    )


def _car() -> Vehicle:
    """One motor turns the rear wheels through a differential, a servo steers the front ones."""
    base, radius = 0.15875 + 0.17145, 0.052
    wheels = []
    for name, ahead, left in CORNERS:
        steered = (
            f'\n        <joint name="steer_{name}" type="hinge" axis="0 0 1" damping="0.05" '
            'armature="0.002"/>'
            if ahead > 0
            else ""
        )
        place = f"{base if ahead > 0 else 0} {left * CAR_TRACK / 2} 0"
        wheels.append(
            f'\n      <body name="{name}" pos="{place}">'
            + steered
            + _JOINT.format(name=name, rotor=ROTOR if ahead < 0 else 1e-5)
            + '\n        <inertial pos="0 0 0" mass="0.12" diaginertia="0.0001 0.00018 0.0001"/>'
            + _TYRE.format(name=name, r=radius, width=0.022, hub=0.6 * radius, rim=0.021)
            + "\n      </body>"
        )
    body = f"""
      <inertial pos="0.17145 0 {0.074 - radius}" mass="{3.74 - 4 * 0.12}"
                diaginertia="0.02 0.04 0.035"/>
      <geom name="body" class="body" size="0.29 0.155 0.04" pos="{base / 2} 0 0.03"/>
      <geom name="cover" class="mark" type="box" size="0.22 0.09 0.02"
            pos="{base / 2 - 0.02} 0 0.09" mass="0" rgba="0.15 0.35 0.7 1"/>"""
    steering = "".join(
        f'\n    <position name="steer_{name}" joint="steer_{name}" kp="8" kv="0.4" '
        'forcerange="-2 2"/>'
        for name in ("fl", "fr")
    )
    drives = f"""  <tendon>
    <fixed name="axle"><joint joint="rl" coef="0.5"/><joint joint="rr" coef="0.5"/></fixed>
    <!-- its oil: without springs a wheel may hang in the air, and would take all of the torque -->
    <fixed name="oil" damping="0.02">
      <joint joint="rl" coef="1"/><joint joint="rr" coef="-1"/>
    </fixed>
  </tendon>
  <actuator>
    <velocity name="axle" tendon="axle" kv="0.5" forcerange="-4 4"/>{steering}
  </actuator>"""
    geometry = CarGeometry(
        wheel_radius=radius, max_wheel_speed=FREE, wheelbase=base, steering_angle=CAR_LOCK
    )
    names = tuple(name for name, _, _ in CORNERS)
    return Vehicle(
        "car",
        geometry,
        (0,),
        ((0.0, 0.0, 0.5, 0.5),),
        torque=4.0,
        top_speed=80.0,
        tyres=names,
        axles=names,
        body=body + "".join(wheels),
        drives=drives,
        servo_rate=3.2,
    )


def front_wheels(car: CarGeometry, angle: float) -> tuple[float, float]:
    """Angles of the left and the right front wheel [rad] of a car that steers at an angle.

    Each stands across the line to the middle of its circle.
    """
    tangent, half = math.tan(angle), 0.5 * CAR_TRACK / car.wheelbase
    left, right = (math.atan(tangent / (1.0 - side * half * tangent)) for side in (1.0, -1.0))
    return left, right


VEHICLES = {"differential": _skid_steer(), "car": _car(), "omni": _mecanum()}
"""By kind of wheels."""


def write_mjcf(
    vehicle: Vehicle,
    circles: Sequence[Circle],
    bounds: tuple[float, float, float, float],
    goal: tuple[float, float] | None = None,
    patches: Sequence[tuple[float, float, float]] = (),
) -> str:
    """Give the model of a robot in a room.

    `vehicle`: the robot. `circles`: obstacles, as cylinders; they stand still. `bounds`: xmin,
    ymin, xmax, ymax of what the cameras see [m]. `goal`: where to draw a disk [m]. `patches`: x, y,
    radius of pieces of another floor, to be drawn [m].
    """
    x_min, y_min, x_max, y_max = bounds
    size = max(x_max - x_min, y_max - y_min) + 0.6
    cx, cy = (x_min + x_max) / 2.0, (y_min + y_max) / 2.0
    marks = [
        f'\n    <geom class="mark" type="cylinder" pos="{x} {y} 0.0005" size="{r} 0.0005" '
        'rgba="0.45 0.65 0.9 0.6"/>'
        for x, y, r in patches
    ]
    if goal is not None:
        marks.append(
            f'\n    <geom class="mark" type="cylinder" pos="{goal[0]} {goal[1]} 0.001" '
            'size="0.08 0.001" rgba="0.85 0.1 0.1 1"/>'
        )
    return _ROOM.format(
        name=vehicle.name,
        timestep=TIMESTEP,
        robot=ROBOT_HITS,
        obstacle=OBSTACLE,
        r=vehicle.radius,
        half=max(10.0, size),
        cx=cx,
        cy=cy,
        above=1.2 * size,
        aside=cy - 0.70 * size,
        up=0.60 * size,
        marks="".join(marks),
        obstacles="".join(
            f'\n    <geom class="obstacle" name="obstacle{i}" pos="{c.x} {c.y} {HEIGHT / 2}" '
            f'size="{max(c.radius, 1e-3)} {HEIGHT / 2}"/>'
            for i, c in enumerate(circles)
        ),
        body=vehicle.body,
        pairs="".join(
            f'\n    <pair name="{name}" geom1="{name}" geom2="floor" condim="4" '
            'friction="0.7 0.7 0.007 0 0"/>'
            for name in vehicle.tyres
        ),
        drives=vehicle.drives,
    )
