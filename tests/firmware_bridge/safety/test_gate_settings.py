"""Settings, geofence and limits of the gate are checked."""

import math
import re
from dataclasses import replace

import pytest
from gate_world import SETTINGS

from firmware_bridge.messages import STILL, ConfigError
from firmware_bridge.safety.gate_settings import GateSettings
from firmware_bridge.safety.limits import Limits


@pytest.mark.parametrize("name", ["watchdog", "pose_age", "heartbeat_age", "hold", "settle"])
@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf, True, "1", None])
def test_settings_are_checked(name, value):
    with pytest.raises(ConfigError, match=name):
        replace(SETTINGS, **{name: value})


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("watchdog", 61.0, "expected 0.01 to 60 s, got 61.0"),
        ("slow_from", 5.0, "expected 0 to 1 (a share), got 5.0"),
        ("resume", -1.0, "expected 0 to 60 s, got -1.0"),
        ("resume_within", "far", "expected 0 to 100 m, got 'far'"),
        ("hold", None, "expected 0.01 to 60 s, got None"),
    ],
)
def test_a_setting_is_refused_with_its_own_range_and_unit(name, value, words):
    with pytest.raises(ConfigError, match=f"^{re.escape(f'{name}: {words}')}$"):
        GateSettings(**{name: value})


def test_a_share_and_a_distance_may_be_zero():
    settings = GateSettings(slow_from=0.0, resume_within=0.0)
    assert (settings.slow_from, settings.resume_within) == (0.0, 0.0)


@pytest.mark.parametrize(
    "fence",
    [(0, 0, 0, 1), (0, 0, 1), (0, 0, 1, math.nan), (1, 0, 0, 1), (0, 0, True, 1), ("0", 0, 1, 1)],
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


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("v_max", 0.0, "expected 0.0001 to 100 m/s, got 0.0"),
        ("v_reverse", -0.1, "expected 0 to 100 m/s, got -0.1"),
        ("omega_max", 400.0, "expected 0.0001 to 100 rad/s, got 400.0"),
        ("deceleration", math.inf, "expected 0.001 to 1000 m/s^2, got inf"),
        ("angular_acceleration", True, "expected 0.001 to 10000 rad/s^2, got True"),
    ],
)
def test_a_limit_is_refused_with_its_own_range_and_unit(name, value, words):
    with pytest.raises(ConfigError, match=f"^{re.escape(f'{name}: {words}')}$"):
        Limits(**{name: value})
