"""What Foxglove is shown, read by a WebSocket client of another library."""

import importlib.util
import json
import socket
import struct
import time

import numpy as np
import pytest
from free_port import free_port

import kmpc_lite as kl
from firmware_bridge.live.address import LiveError
from firmware_bridge.live.moment import last_step
from firmware_bridge.live.viewer import Shown, Viewer
from firmware_bridge.recording.drive.schemas import TOPICS
from kmpc_lite.cli.extras import MissingExtra
from kmpc_lite.scenario.files import Scenario

needs_foxglove = pytest.mark.skipif(
    importlib.util.find_spec("foxglove") is None or importlib.util.find_spec("websockets") is None,
    reason="foxglove-sdk or websockets is not installed: pip install 'kmpc-lite[live,dev]'",
)
MESSAGE_DATA = 1


def drive(scenario: Scenario):
    controller = kl.Controller(kl.nominal_unicycle(0.1), scenario.problem(kl.NavigationProblem()))
    plan = controller.step(scenario.start, scenario.goal, scenario.obstacles_at(0.0))
    return controller, last_step(controller, scenario.start, plan)


def test_plans_and_changes_of_the_gate_are_shown_once_and_poses_always():
    scenario = Scenario.load("four_circles_1")
    controller, step = drive(scenario)
    shown, pose = Shown(), (0.0, 0.0, 0.0)
    kinds = [
        [type(record).__name__ for record in shown.records(now, *what, dict)]
        for now, what in (
            (1.0, (step, pose, (0.1, 0.0), ("ACTIVE", ()))),
            (1.1, (step, pose, (0.1, 0.0), ("ACTIVE", ()))),
            (1.2, (None, None, (0.1, 0.0), ("ESTOP", ("a",)))),
            (2.1, (last_step(controller, pose, step.plan), pose, (0.1, 0.0), ("ESTOP", ("a",)))),
        )
    ]
    assert kinds == [
        ["PoseSeen", "Sent", "Stepped", "Gate", "Health"],
        ["PoseSeen", "Sent"],
        ["Sent", "Gate"],
        ["PoseSeen", "Sent", "Stepped", "Health"],
    ]


@needs_foxglove
def test_a_client_of_another_library_reads_every_kind_of_message():
    from websockets.sync.client import connect

    scenario = Scenario.load("walls_door")
    controller, step = drive(scenario)
    shown = Shown()

    def records():
        again = last_step(controller, step.pose, step.plan)
        gate = ("ACTIVE", (str(time.monotonic()),))
        return shown.records(time.monotonic(), again, (0.1, 0.2, 0.3), (0.2, 0.1), gate, dict)

    port = free_port()
    with Viewer(port) as viewer:
        viewer.start(scenario, 0.1, records)
        until = time.monotonic() + 30.0
        while True:
            try:
                client = connect(viewer.link, subprotocols=["foxglove.sdk.v1"])
                break
            except OSError:
                assert time.monotonic() < until, viewer.problem
                time.sleep(0.1)
        with client:
            channels: dict[int, dict] = {}
            seen: dict[str, dict] = {}
            wanted = {"/pose", "/tf", "/command", "/step", "/plan", "/path", "/map", "/scene"}
            wanted |= {"/gate", "/health", "/log", "/obstacles"}
            while not wanted <= seen.keys():
                assert time.monotonic() < until, wanted - seen.keys()
                told = client.recv(timeout=20)
                if isinstance(told, str):
                    event = json.loads(told)
                    if event["op"] == "advertise":
                        subscriptions = []
                        for channel in event["channels"]:
                            channels[channel["id"]] = channel
                            subscriptions.append({"id": channel["id"], "channelId": channel["id"]})
                        ask = {"op": "subscribe", "subscriptions": subscriptions}
                        client.send(json.dumps(ask))
                elif told[0] == MESSAGE_DATA:
                    number, stamp = struct.unpack_from("<IQ", told, 1)
                    topic = channels[number]["topic"]
                    seen[topic] = json.loads(told[13:])
                    assert abs(stamp / 1e9 - time.time()) < 60.0
        names = {channel["topic"]: channel["schemaName"] for channel in channels.values()}
        assert names == {topic.name: topic.schema for topic in TOPICS}
        for channel in channels.values():
            assert json.loads(channel["schema"])["type"] == "object"
        assert seen["/pose"]["pose"]["position"] == {"x": 0.1, "y": 0.2, "z": 0.0}
        assert len(seen["/plan"]["poses"]) == 21 and len(seen["/step"]["margins"]) == 20
        assert any(e["id"].startswith("obstacle") for e in seen["/map"]["entities"])
        assert np.isfinite(seen["/command"]["v"])
    assert not viewer.problem


def test_a_port_that_is_taken_and_an_extra_that_is_missing_are_reported_first(monkeypatch):
    import argparse

    from firmware_bridge.cli.live_options import add_live_options, asked_views
    from kmpc_lite.cli import extras

    with socket.create_server(("127.0.0.1", 0)) as taken:
        with pytest.raises(LiveError, match="--foxglove"):
            Viewer(taken.getsockname()[1])
    parser = argparse.ArgumentParser()
    add_live_options(parser)
    assert asked_views(parser.parse_args([])) == (None, None)
    monkeypatch.setattr(extras, "find_spec", lambda name: None)
    with pytest.raises(MissingExtra, match=r"kmpc-lite\[live\]"):
        asked_views(parser.parse_args(["--foxglove"]))
