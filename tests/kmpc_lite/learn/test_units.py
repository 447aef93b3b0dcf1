"""Units and frames as a user names them."""

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lite.learn.logs import ReadOptions, parse_units


@pytest.mark.parametrize(
    ("column", "text", "value", "si"),
    [
        ("t", "ns", 2e9, 2.0),
        ("theta", "deg", 180.0, np.pi),
        ("theta", "rad-1.5", 2.0, 0.5),
        ("v", "-m/s", 1.0, -1.0),
        ("omega", "rpm", 60.0, 2.0 * np.pi),
        ("omega", "deg/sec", 180.0, np.pi),
        ("v", "IPS", 1.0, 0.0254),
        ("x", "Feet", 1.0, 0.3048),
        ("curvature", "1/cm", 0.01, 1.0),
    ],
)
def test_units(column: str, text: str, value: float, si: float) -> None:
    unit = parse_units({column: text})[column]
    assert unit.apply(np.array([value]))[0] == pytest.approx(si)


def test_unknown_units() -> None:
    known = {"t=nss": "did you mean 'ns'", "z=m": "expected one of t, x", "v=0": "units: v=0"}
    for text, told in known.items():
        with pytest.raises(kl.DataError, match=told):
            ReadOptions(units=dict([text.split("=")]))
