"""Settings, geofence and limits of the gate are checked."""

import math
import re
from dataclasses import replace

import pytest
from gate_world import SETTINGS

from firmware_bridge.messages import STILL, ConfigError
from firmware_bridge.safety.gate_settings import GateSettings, Limits


@pytest.mark.parametrize("name", ["watchdog", "pose_age", "heartbeat_age", "hold", "settle"])
@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf, True, "1", None])
def test_settings_are_checked(name, value):
    with pytest.raises(ConfigError, match=name):
        replace(SETTINGS, **{name: value})


@pytest.mark.parametrize(
    "fence",
    [(0, 0, 0, 1), (0, 0, 1), (0, 0, 1, math.nan), (0, 1, 1, 0), (0, 0, True, 1), ("0", 0, 1, 1)],
)
def test_a_geofence_is_checked(fence):
    with pytest.raises(ConfigError, match="geofence"):
        GateSettings(geofence=fence)


@pytest.mark.parametrize("name", [f for f in Limits.__dataclass_fields__ if f != "v_reverse"])
@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf, True, "1"])
def test_limits_are_checked(name, value):
    with pytest.raises(ConfigError, match=name):
        Limits(**{name: value})
    assert Limits(v_reverse=0.0).clip((-1.0, 0.5, 0.1)) == STILL
    # what rounding leaves of a standstill does not keep a forward-only robot from turning
    assert Limits(v_reverse=0.0).clip((-1e-9, 0.5, 0.0)) == (0.0, 0.5, 0.0)


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("v_max", 0.0, "expected 0.0001 to 100 m/s, got 0.0"),
        ("omega_max", 400.0, "expected 0.0001 to 100 rad/s, got 400.0"),
        ("angular_acceleration", True, "expected 0.001 to 10000 rad/s^2, got True"),
    ],
)
def test_a_limit_is_refused_with_its_own_range_and_unit(name, value, words):
    with pytest.raises(ConfigError, match=f"^{re.escape(f'{name}: {words}')}$"):
        Limits(**{name: value})
