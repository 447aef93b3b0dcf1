"""Camera frames of the twin, and a run as an animated GIF; rendering off-screen (EGL or OSMesa)."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from kmpc_lab.sim.closed_loop import Run
from kmpc_lab.sim.twin.plant import Twin, load_mujoco
from kmpc_lite.errors import KmpcError

SIZE = (480, 360)
"""Width and height of a frame [pixels]."""


class NoRenderer(KmpcError):
    """There is no off-screen renderer on this machine."""


class Camera:
    """Takes pictures of a twin.

    Parameters
    ----------
    twin : Twin
        What is looked at.
    view : {"above", "aside"}
        From where.
    size : tuple
        Width and height of a frame [pixels].

    Raises
    ------
    NoRenderer
        Says what was tried.
    """

    def __init__(self, twin: Twin, view: str = "above", size: tuple[int, int] = SIZE) -> None:
        self._twin, self._view = twin, view
        mujoco = load_mujoco()
        try:
            self._renderer: Any = mujoco.Renderer(twin.model, height=size[1], width=size[0])
        except Exception as error:  # each back end raises its own
            raise NoRenderer(
                f"no off-screen renderer with MUJOCO_GL={os.environ.get('MUJOCO_GL', '')}: {error}"
            ) from error

    def frame(self) -> np.ndarray:
        """Take a picture now, (height, width, 3) of bytes."""
        self._renderer.update_scene(self._twin.data, camera=self._view)
        pixels: np.ndarray = self._renderer.render()
        return pixels.copy()

    def close(self) -> None:
        """Let go of the renderer."""
        self._renderer.close()


def film(
    run: Run,
    file: Path,
    view: str = "aside",
    frames_per_second: float = 10.0,
    size: tuple[int, int] = SIZE,
) -> int:
    """Write a run as an animated GIF, at the pace of the drive; gives the number of frames.

    The robot is shown at the poses of the run; its wheels roll as its way says.

    Raises
    ------
    NoRenderer
        If no picture can be taken.
    """
    twin = Twin.of(run.scenario)
    camera = Camera(twin, view, size)
    every = run.dt * (len(run.states) - 1) / (len(run.path) - 1)
    stride = max(1, round(1.0 / (frames_per_second * every)))
    poses = run.path[::stride]
    frames = []
    for k, (x, y, theta) in enumerate(poses):
        step = poses[k] - poses[max(k - 1, 0)]
        rolled = float(step[0] * np.cos(theta) + step[1] * np.sin(theta)) / twin.vehicle.radius
        twin.show((float(x), float(y), float(theta)), rolled)
        frames.append(camera.frame())
    camera.close()
    write_gif(frames, file, stride * every)
    return len(frames)


def write_gif(frames: Sequence[np.ndarray], file: Path, period: float) -> None:
    """Write frames (height, width, 3) of bytes, `period` [s] apart."""
    try:
        from PIL import Image
    except ImportError as error:
        raise KmpcError(
            "GIFs need Pillow, which comes with the extra plot: pip install 'kmpc-lab[plot]'"
        ) from error
    # one palette for all: else the floor flickers from frame to frame
    palette = Image.fromarray(frames[len(frames) // 2]).quantize(128)
    pictures = [
        Image.fromarray(f).quantize(palette=palette, dither=Image.Dither.NONE) for f in frames
    ]
    pictures[0].save(
        file,
        save_all=True,
        append_images=pictures[1:],
        duration=round(1e3 * period),
        loop=0,
        optimize=True,
    )
