"""Plans of QGroundControl become goals in metres, and what is not driven is refused in a line."""

import json
import math

import numpy as np
import pytest

from kmpc_lite.errors import ScenarioError
from kmpc_lite.scenario.mission import FARTHEST, read_mission

HOME = 47.3977, 8.5456
RADIUS = 6_378_137.0
RETURN = {"type": "SimpleItem", "command": 20, "frame": 2, "params": [0] * 7}


def place(east, north, home=HOME):
    """Latitude and longitude of what lies so far from home [m]."""
    latitude = home[0] + math.degrees(north / RADIUS)
    return latitude, home[1] + math.degrees(east / RADIUS / math.cos(math.radians(home[0])))


def waypoint(east, north, yaw=None, hold=0, command=16, frame=3):
    latitude, longitude = place(east, north)
    params = [hold, 0, 0, yaw, latitude, longitude, 0]
    return {"type": "SimpleItem", "command": command, "frame": frame, "params": params}


def written(folder, items, mission=None):
    plan = {
        "fileType": "Plan",
        "geoFence": {"circles": [], "polygons": [], "version": 2},
        "groundStation": "QGroundControl",
        "mission": {"plannedHomePosition": [*HOME, 488.0], "items": items, **(mission or {})},
        "version": 1,
    }
    file = folder / "mission.plan"
    file.write_text(json.dumps(plan))
    return file


def test_waypoints_are_metres_east_and_north_of_the_planned_home(tmp_path) -> None:
    file = written(tmp_path, [waypoint(3, 4, 90), waypoint(3, -2, 180), waypoint(-1, 0, 360)])
    expected = [(3, 4, 0), (3, -2, -math.pi / 2), (-1, 0, math.pi / 2)]
    np.testing.assert_allclose(read_mission(file), expected, atol=1e-6)


@pytest.mark.parametrize("unset", [None, 0])
def test_without_headings_the_robot_arrives_as_it_comes(tmp_path, unset) -> None:
    file = written(
        tmp_path,
        [waypoint(2, 0, unset), waypoint(2, 2, unset), waypoint(2, 2, unset), RETURN],
    )
    headings = [theta for _, _, theta in read_mission(file)]
    np.testing.assert_allclose(headings, [0, math.pi / 2, math.pi / 2, -3 * math.pi / 4], atol=1e-6)


def test_a_return_leads_to_the_planned_home_wherever_the_origin_lies(tmp_path) -> None:
    file = written(tmp_path, [waypoint(2, 0), RETURN])
    origin = place(-10, 5)
    (x1, y1, _), (x2, y2, _) = read_mission(file, origin)
    np.testing.assert_allclose([x1, y1, x2, y2], [12, -5, 10, -5], atol=1e-4)


@pytest.mark.parametrize(
    ("item", "words"),
    [
        ({"type": "ComplexItem", "complexItemType": "survey"}, "item 2: .*complex item: survey"),
        (waypoint(1, 0, command=178), "item 2: command 178 is not driven"),
        (waypoint(1, 0, hold=5), "item 2: waits of 5 s are not made"),
        (waypoint(1, 0, frame=1), "item 2: frame 1 has no latitude"),
        (waypoint(1, 0, yaw="east"), "item 2: heading: expected a number, got east"),
        (waypoint(2 * FARTHEST, 0), "item 2: 10.0 km from the origin"),
        ({**waypoint(1, 0), "params": [1]}, "item 2: params: expected 7 numbers"),
    ],
)
def test_what_is_not_driven_is_refused_with_its_item(tmp_path, item, words) -> None:
    with pytest.raises(ScenarioError, match=words) as refused:
        read_mission(written(tmp_path, [waypoint(1, 1), item]))
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("mission", "words"),
    [
        ({"items": []}, "expected 1 to 1000 items"),
        ({"items": 7}, "expected 1 to 1000 items"),
        ({"plannedHomePosition": None}, "plannedHomePosition: expected latitude"),
        ({"plannedHomePosition": [0, 0, 0]}, "no place on Earth"),
        ({"plannedHomePosition": ["a", 0, 0]}, "plannedHomePosition: expected a number"),
    ],
)
def test_a_plan_without_what_it_needs_is_refused(tmp_path, mission, words) -> None:
    with pytest.raises(ScenarioError, match=words):
        read_mission(written(tmp_path, [waypoint(1, 1)], mission))


@pytest.mark.parametrize("text", ["", "{", "[]", "3", "\xff"])
def test_what_is_no_plan_is_refused(tmp_path, text) -> None:
    file = tmp_path / "mission.plan"
    file.write_bytes(text.encode("latin-1"))
    with pytest.raises(ScenarioError, match="mission.plan: (not JSON|expected a plan)"):
        read_mission(file)
