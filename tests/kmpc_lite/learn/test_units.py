"""Units and frames as a user names them."""

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lite.learn.logs import Log, ReadOptions, Series, correct, parse_units


@pytest.mark.parametrize(
    ("column", "text", "value", "si"),
    [
        ("t", "ns", 2e9, 2.0),
        ("theta", "deg", 180.0, np.pi),
        ("theta", "rad-1.5", 2.0, 0.5),
        ("v", "-m/s", 1.0, -1.0),
        ("omega", "rpm", 60.0, 2.0 * np.pi),
    ],
)
def test_units(column: str, text: str, value: float, si: float) -> None:
    unit = parse_units({column: text})[column]
    assert unit.apply(np.array([value]))[0] == pytest.approx(si)


@pytest.mark.parametrize(
    ("units", "told"),
    [
        ({"t": "nss"}, "did you mean 'ns'"),
        ({"z": "m"}, "expected one of t, x"),
        ({"v": "0"}, "units: v=0"),
    ],
)
def test_unknown_units(units: dict[str, str], told: str) -> None:
    with pytest.raises(kl.DataError, match=told):
        ReadOptions(units=units)


def test_frames() -> None:
    time = np.arange(3.0)
    north_east = np.array([[1.0, 2.0, 0.0], [1.0, 3.0, 0.5 * np.pi], [0.0, 0.0, 0.1]])
    log = Log("x", Series(time, north_east, ""), Series(time, np.ones((3, 2)), ""), together=True)
    enu = correct(log, ReadOptions(frame="ned"))
    np.testing.assert_allclose(enu.poses.values[0], [2.0, 1.0, 0.5 * np.pi])
    np.testing.assert_allclose(enu.poses.values[1], [3.0, 1.0, 0.0], atol=1e-12)
    swapped = correct(log, ReadOptions(frame="swapped"))
    np.testing.assert_allclose(swapped.poses.values[0], [2.0, 1.0, 0.0])
    assert not correct(log, ReadOptions(shift=0.5)).together
    with pytest.raises(kl.DataError, match="frame: expected enu, ned, swapped"):
        ReadOptions(frame="NWU")
