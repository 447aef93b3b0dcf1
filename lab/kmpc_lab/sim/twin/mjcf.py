"""A robot of the twin and its room as MJCF, MuJoCo's model format."""

from __future__ import annotations

from collections.abc import Sequence

from kmpc_lab.sim.twin.vehicles import Vehicle
from kmpc_lite.control.world.circles import Circle

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
