"""Pictures of the twin, where a renderer exists; if none does, one clear line."""

import numpy as np
import pytest
from PIL import Image

from kmpc_lab import Outcome, Run
from kmpc_lab.sim.twin import Twin
from kmpc_lab.sim.twin.camera import Camera, NoRenderer, film, write_gif
from kmpc_lite import Circle
from kmpc_lite.scenario.files import Scenario


def test_a_camera_sees_the_robot_or_says_that_there_is_no_renderer(tmp_path):
    try:
        camera = Camera(Twin([Circle(0.8, 0.0, 0.15)]), "above", (160, 120))
    except NoRenderer as error:
        assert "MUJOCO_GL" in str(error) and "\n" not in str(error).strip()
        return
    picture = camera.frame()
    camera.close()
    assert picture.shape == (120, 160, 3) and picture.std() > 5.0
    path = np.linspace((0.0, 0.0, 0.0), (0.4, 0.0, 0.0), 9)
    scenario = Scenario("room", (-1.0, -1.0, 1.0, 1.0), (), 0.15, (0.0, 0.0, 0.0), (0.4, 0.0, 0.0))
    plans = np.zeros((2, 1, 3))
    run = Run(
        scenario,
        0.5,
        Outcome.REACHED,
        1.0,
        path[::4],
        path,
        np.zeros((2, 2)),
        plans,
        ("SOLVED",) * 2,
        np.zeros(2),
        1.0,
    )
    assert film(run, tmp_path / "run.gif", size=(80, 60)) == 9
    assert Image.open(tmp_path / "run.gif").n_frames == 9


def test_a_gif_has_its_frames_at_its_pace(tmp_path):
    frames = [np.zeros((8, 8, 3), dtype=np.uint8) for _ in range(4)]
    for k, frame in enumerate(frames):
        frame[k] = 255
    write_gif(frames, tmp_path / "a.gif", 0.1)
    picture = Image.open(tmp_path / "a.gif")
    assert picture.n_frames == 4 and picture.info["duration"] == 100


@pytest.fixture(autouse=True)
def no_warnings(recwarn):
    yield
    assert not [w for w in recwarn if issubclass(w.category, RuntimeWarning)]
