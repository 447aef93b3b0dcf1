"""The twin in MJCF: a ROSbot 2 on four tyres, in a room with cylinders.

Sources: github.com/husarion/rosbot_ros, ``rosbot_description/urdf/rosbot``: ``body.urdf.xacro``
(body: 1.728 kg, inertia, box 0.197 x 0.150 x 0.080 m), ``wheel.urdf.xacro`` (masses, inertias and
places of the wheels, 1.5 N m, 24 rad/s) and ``rosbot_macro.urdf.xacro`` (radius 0.0425 m). Camera
and lidar are on the real robot and not in the body's 1.728 kg: a box and a cylinder of the makers'
data sheets (Orbbec Astra 0.30 kg, RPLIDAR A2 0.19 kg) stand for them. Rotor and gears are ours.
"""

from __future__ import annotations

from collections.abc import Sequence

from firmware_bridge.kinematics import WheelGeometry
from kmpc_lite.control.world.shapes import Circle

WHEELS = WheelGeometry(wheel_radius=0.0425, track=0.192, max_wheel_speed=100.0)
"""How its sides turn for a command; speeds are not limited here, but by the motors."""
TORQUE, TOP_SPEED = 1.5, 24.0
"""Of a motor that is stalled, at the wheel [N m]; of a wheel without load [rad/s]."""
GAIN = 0.25
"""Of each motor's velocity loop, whose proportional part is the actuator's own [N m s/rad]."""
ROTOR = 5e-4  # inertia of rotor and gears at a wheel: 4e-7 kg m^2 behind a gear of 1:34 [kg m^2]
CORNERS = (("fl", 1, 1), ("fr", 1, -1), ("rl", -1, 1), ("rr", -1, -1))
"""Names of the wheels; whether they are in front and on the left."""
_ROSBOT = """
      <inertial pos="0 0 0.02" mass="1.728" diaginertia="0.004162 0.00651 0.008828"/>
      <geom name="body" class="body" size="0.0985 0.075 0.04" pos="0 0 0.02"/>
      <body name="lidar" pos="0.02 0 0.085">
        <geom class="mark" type="cylinder" size="0.035 0.02" mass="0.19"/>
      </body>
      <body name="camera" pos="-0.03 0 0.18">
        <geom class="mark" type="box" size="0.02 0.08 0.02" mass="0.30"/>
      </body>"""
_WHEEL = f"""
      <body name="{{name}}" pos="{{x}} {{y}} 0">
        <joint name="{{name}}" type="hinge" axis="0 1 0" damping="0.001" frictionloss="0.002"
               armature="{ROTOR}"/>
        <inertial pos="0 0 0" mass="0.074" diaginertia="0.000041 0.000067 0.000041"/>
        <geom name="{{name}}" class="wheel" type="ellipsoid" size="0.0425 0.018 0.0425"/>
      </body>"""
_PAIR = """
    <pair name="{name}" geom1="{name}" geom2="floor" condim="4" friction="0.7 0.7 0.007 0 0"/>"""
_MOTOR = f"""
    <velocity name="{{name}}" joint="{{name}}" kv="{GAIN}" forcerange="-{TORQUE} {TORQUE}"/>"""
HEIGHT = 0.30  # height of the obstacles [m]
_ROOM = """<mujoco model="rosbot2">
  <compiler angle="degree" inertiafromgeom="auto"/>
  <!-- the longest step for which halving it changes where the robot comes to by less than 1.5 % -->
  <!-- implicitfast and an elliptic cone: sliding wheels neither chatter nor creep -->
  <option timestep="0.0025" integrator="implicitfast" cone="elliptic" impratio="50"
          iterations="20" tolerance="1e-8"/>
  <default>
    <!-- the robot (1) meets obstacles (2); wheels meet the floor through pairs of their own -->
    <!-- a tyre that is round across too touches in one point: one contact a wheel,
         as rubber under load carries in its middle -->
    <default class="wheel"><geom contype="1" conaffinity="2" mass="0"/></default>
    <default class="body"><geom type="box" contype="1" conaffinity="2" mass="0"/></default>
    <default class="obstacle">
      <geom type="cylinder" contype="2" conaffinity="1" friction="0.4 0.005 0.0001"/>
    </default>
    <default class="mark"><geom contype="0" conaffinity="0" group="1"/></default>
  </default>
  <worldbody>
    <geom name="floor" type="plane" size="20 20 0.1" contype="0" conaffinity="0"/>{obstacles}
    <body name="robot" pos="0 0 {r}">
      <freejoint name="robot"/>{body}
    </body>
  </worldbody>
  <contact>{pairs}
  </contact>
  <actuator>{motors}
  </actuator>
</mujoco>
"""


def write_mjcf(circles: Sequence[Circle]) -> str:
    """Give the model of the robot among obstacles, cylinders that stand still."""
    wheels = "".join(
        _WHEEL.format(name=name, x=ahead * 0.106 / 2, y=left * 0.192 / 2)
        for name, ahead, left in CORNERS
    )
    return _ROOM.format(
        r=WHEELS.wheel_radius,
        obstacles="".join(
            f'\n    <geom class="obstacle" name="obstacle{i}" pos="{c.x} {c.y} {HEIGHT / 2}" '
            f'size="{max(c.radius, 1e-3)} {HEIGHT / 2}"/>'
            for i, c in enumerate(circles)
        ),
        body=_ROSBOT + wheels,
        pairs="".join(_PAIR.format(name=name) for name, _, _ in CORNERS),
        motors="".join(_MOTOR.format(name=name) for name, _, _ in CORNERS),
    )
