"""What a model file says of its making, and what logs say of their vehicle."""

import json
from pathlib import Path

import numpy as np
import pytest

import kmpc_lab
import kmpc_lite as kl
from kmpc_lite.learn.learning import describe_making, read_vehicle
from kmpc_lite.learn.verdict import format_making

ROVER = {"name": "rover-7", "driver": "roboclaw", "track": 0.27}


def write(file: Path, first: str = "") -> Path:
    data = kmpc_lab.generate_dataset(
        kmpc_lab.DifferentialDrive(), episodes=2, steps=20, dt=0.1, seed=0
    )
    data.save(file)
    file.write_text(first + file.read_text())
    return file


def remark(**vehicle: object) -> str:
    return f"# vehicle {json.dumps(vehicle)}\n"


def test_a_log_says_whose_it_is_and_is_read_as_before(tmp_path: Path) -> None:
    plain, told = write(tmp_path / "a.csv"), write(tmp_path / "b.csv", remark(**ROVER))
    assert read_vehicle([plain]) is None and read_vehicle([told]) == ROVER
    assert read_vehicle([plain, told]) == ROVER == read_vehicle([tmp_path])
    one, other = kl.Dataset.load(plain), kl.Dataset.load(told)
    np.testing.assert_array_equal(one.episodes[0].states, other.episodes[0].states)


def test_logs_of_two_vehicles_are_refused(tmp_path: Path) -> None:
    one = write(tmp_path / "a.csv", remark(**ROVER))
    other = write(tmp_path / "b.csv", remark(**ROVER | {"track": 0.3}))
    with pytest.raises(kl.DataError, match="another vehicle than .*a.csv: track 0.27 and 0.3"):
        read_vehicle([one, other])


@pytest.mark.parametrize(
    "first",
    [
        "# vehicle {\n",
        "# vehicle [1]\n",
        '# vehicle {"a": [1]}\n',
        "# vehicle " + "[" * 4000 + "\n",
    ],
)
def test_a_remark_that_is_none_is_refused_in_one_line(tmp_path: Path, first: str) -> None:
    with pytest.raises(kl.DataError, match="a.csv: line 1: the remark") as error:
        read_vehicle([write(tmp_path / "a.csv", first)])
    assert "\n" not in str(error.value)


def test_a_model_file_keeps_it_and_a_damaged_one_is_refused(tmp_path: Path) -> None:
    from dataclasses import replace

    data = kmpc_lab.generate_dataset(
        kmpc_lab.DifferentialDrive(), episodes=4, steps=60, dt=0.1, seed=0
    )
    model = kl.fit(data)
    made = describe_making(model, [Path("a.csv")], data, vehicle=ROVER)
    replace(model, info={**model.info, **made}).save(tmp_path / "robot.npz")
    info = kl.KoopmanModel.load(tmp_path / "robot.npz").info
    assert info["vehicle"] == ROVER and info["log"] == ["a.csv"]
    assert info["driven"]["forward"] > 0.5 and info["stopping"]["delay"] == 0.0
    assert "rover-7" in format_making(info) and "no faster" in format_making(info)
    for name, value in (("vehicle", [1]), ("driven", {"forward": -1}), ("stopping", {"stops": 1})):
        replace(model, info={**model.info, name: value}).save(tmp_path / "bad.npz")
        with pytest.raises(kl.ModelError, match=f"info.{name}: expected"):
            kl.KoopmanModel.load(tmp_path / "bad.npz")
