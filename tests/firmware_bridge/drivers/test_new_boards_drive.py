"""Roboteq, Sabertooth and Arduino drive to the goal, over a pty with noise and lost answers."""

import json
import math
import random
import socket
import threading
from pathlib import Path

import pytest
from courses import COURSE, PATIENT
from free_port import free_port

from firmware_bridge.robot_file import load_robot
from kmpc_lab.emulator.build import build_emulator
from kmpc_lab.emulator.mocap import MocapSender
from kmpc_lite.cli.main import main

ROBOTS = Path(__file__).parents[3] / "docs" / "robots"


def spoil(emulator, done, draw):
    """Noise both ways and lost answers, ten times a second."""
    while not done.wait(0.1):
        what = draw.choice(("say", "lose", "hear", "none"))
        if what == "say":
            emulator.say(draw.randbytes(draw.randint(1, 30)))
        elif what == "lose":
            emulator.lose_replies = draw.randint(1, 2)
        elif what == "hear":
            emulator.handle(draw.randbytes(draw.randint(1, 8)))


@pytest.mark.parametrize(
    "name", ["sabertooth", "arduino", pytest.param("roboteq", marks=pytest.mark.long)]
)
def test_drives_past_the_obstacle_to_the_goal(name, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    monkeypatch.delenv("RUNTIME_DIRECTORY", raising=False)
    (tmp_path / "course.toml").write_text(COURSE)
    link = {"url": "pty:link"}
    camera = None
    pose = f"udp:127.0.0.1:{free_port(socket.SOCK_DGRAM)}"
    if name == "sabertooth":
        link["pose"] = pose
    robot = load_robot(ROBOTS / f"{name}.toml", {"link": link})
    emulator = build_emulator(robot, (0.0, 0.0, 0.0), 0.0, 1.0, 0, 0.1)
    emulator.start("pty:link")
    done = threading.Event()
    spoiler = threading.Thread(target=spoil, args=(emulator, done, random.Random(3)))
    options = ["--link", "pty:link", "--v-max", "0.5", "--omega-max", "1.5"]
    options += [
        "--settle",
        "0.3",
        "--seconds",
        "30",
        "--set",
        "safety.hold=0.3",
        *PATIENT,
        "--json",
    ]
    try:
        if name == "sabertooth":
            options += ["--pose", pose]
            camera = MocapSender(lambda: emulator.pose, pose, 0)
            camera.start()
        spoiler.start()
        status = main(["run", str(ROBOTS / f"{name}.toml"), *options, "--scenario", "course.toml"])
        x, y, theta = emulator.pose
    finally:
        done.set()
        spoiler.join()
        if camera is not None:
            camera.close()
        emulator.close()
    report = json.loads(capsys.readouterr().out)
    assert (status, report["outcome"]) == (0, "arrived")
    assert report["clearance_m"] > 0.0
    assert math.hypot(x - 0.7, y - 0.15) < 0.1
    assert abs(math.remainder(theta, math.tau)) < 0.3
