"""The robot and its room as MJCF, MuJoCo's model format, written from the maker's figures.

Sources, all of github.com/husarion/rosbot_ros: ``rosbot_description/urdf/rosbot/body.urdf.xacro``
(body: 1.728 kg, inertia, box 0.197 x 0.150 x 0.080 m), ``wheel.urdf.xacro`` (wheels: 0.074 kg,
inertia, 36 mm wide, 0.106 m apart lengthways and 0.192 m across, 1.5 N m, 24 rad/s),
``rosbot_macro.urdf.xacro`` (radius 0.0425 m). Camera and lidar are on the real robot and not in the
body's 1.728 kg: a box and a cylinder of the makers' data sheets (Orbbec Astra 0.30 kg, RPLIDAR A2
0.19 kg) stand for them.
"""

from __future__ import annotations

from collections.abc import Sequence

from kmpc_lite.control.world.circles import Circle

WHEEL_RADIUS = 0.0425
WHEELBASE, TRACK = 0.106, 0.192
"""Distance between the axles, and between the wheels of an axle [m]."""
TORQUE, TOP_SPEED = 1.5, 24.0
"""A motor, measured at the wheel: its torque when stalled [N m], and its speed without load
[rad/s]."""
WHEELS = ("fl", "fr", "rl", "rr")
LEFT = (True, False, True, False)
GAIN = 0.25
"""Proportional part of the motor board's speed loops [N m s/rad]."""
ROTOR = 5e-4
"""Inertia of rotor and gears at the wheel: 4e-7 kg m^2 behind a gear of 1:34 [kg m^2]."""
TIMESTEP = 0.0025
"""Time step of the physics [s]: the longest for which halving it changes where the robot comes to
by less than 1.5 % of its way."""
HEIGHT = 0.30
"""Height of the obstacles [m]."""
ROBOT_HITS, OBSTACLE = 1, 2
"""Bits of collision filtering: the robot meets obstacles; wheels meet the floor through pairs of
their own."""

_WHEEL = """
      <body name="{name}" pos="{x} {y} 0">
        <joint name="{name}" type="hinge" axis="0 1 0" damping="0.001" frictionloss="0.002"
               armature="{rotor}"/>
        <inertial pos="0 0 0" mass="0.074" diaginertia="0.000041 0.000067 0.000041"/>
        <geom name="{name}" class="wheel" type="ellipsoid" size="{r} 0.018 {r}"/>
        <geom type="cylinder" size="{hub} 0.0175" euler="90 0 0" contype="0" conaffinity="0"
              group="1" rgba="0.55 0.55 0.58 1" mass="0"/>
      </body>"""

_ROOM = """<mujoco model="rosbot2">
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
      <freejoint name="robot"/>
      <inertial pos="0 0 0.02" mass="1.728" diaginertia="0.004162 0.00651 0.008828"/>
      <geom name="body" type="box" size="0.0985 0.075 0.04" pos="0 0 0.02" contype="{robot}"
            conaffinity="{obstacle}" mass="0"
            rgba="0.12 0.12 0.13 1"/>
      <geom name="cover" class="mark" type="box" size="0.097 0.074 0.003" pos="0 0 0.062" mass="0"
            rgba="0.85 0.2 0.15 1"/>
      <body name="lidar" pos="0.02 0 0.085">
        <geom class="mark" type="cylinder" size="0.035 0.02" mass="0.19" rgba="0.05 0.05 0.05 1"/>
      </body>
      <body name="camera" pos="-0.03 0 0.18">
        <geom class="mark" type="box" size="0.02 0.08 0.02" mass="0.30" rgba="0.3 0.3 0.33 1"/>
        <geom class="mark" type="box" size="0.008 0.008 0.05" pos="-0.01 0 -0.06" mass="0"
              rgba="0.3 0.3 0.33 1"/>
      </body>{wheels}
    </body>
  </worldbody>
  <contact>{pairs}
  </contact>
  <actuator>{motors}
  </actuator>
</mujoco>
"""


def write_mjcf(
    circles: Sequence[Circle],
    bounds: tuple[float, float, float, float],
    goal: tuple[float, float] | None = None,
    patches: Sequence[tuple[float, float, float]] = (),
) -> str:
    """Give the model of a robot in a room.

    Parameters
    ----------
    circles : sequence of Circle
        Obstacles, as cylinders; they stand still.
    bounds : tuple
        xmin, ymin, xmax, ymax of what the cameras see [m].
    goal : tuple, optional
        Where to draw a disk [m].
    patches : sequence of tuple
        x, y, radius of pieces of another floor, to be drawn [m].
    """
    x_min, y_min, x_max, y_max = bounds
    size = max(x_max - x_min, y_max - y_min) + 0.6
    cx, cy = (x_min + x_max) / 2.0, (y_min + y_max) / 2.0
    places = [
        (name, (1 - 2 * (i >= 2)) * WHEELBASE / 2, (1 if LEFT[i] else -1) * TRACK / 2)
        for i, name in enumerate(WHEELS)
    ]
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
        timestep=TIMESTEP,
        robot=ROBOT_HITS,
        obstacle=OBSTACLE,
        r=WHEEL_RADIUS,
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
        wheels="".join(
            _WHEEL.format(name=name, x=x, y=y, r=WHEEL_RADIUS, hub=0.7 * WHEEL_RADIUS, rotor=ROTOR)
            for name, x, y in places
        ),
        pairs="".join(
            f'\n    <pair name="{name}" geom1="{name}" geom2="floor" condim="4" '
            'friction="0.7 0.7 0.007 0 0"/>'
            for name in WHEELS
        ),
        motors="".join(
            f'\n    <velocity name="{name}" joint="{name}" kv="{GAIN}" '
            f'forcerange="-{TORQUE} {TORQUE}"/>'
            for name in WHEELS
        ),
    )
