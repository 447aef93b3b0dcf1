"""What a STOP on the page takes: how it is noted, and reported; the presses themselves are long."""

import io
import json
import math
from types import SimpleNamespace

import pytest

from firmware_bridge.safety.gate_table import GateState
from kmpc_lab.attacks.presses import CRUISE, REST, Press, Script, _press, summary, told
from kmpc_lab.attacks.vehicle import SPEED
from kmpc_lite.cli.main import main


def shot(now, state, v=0.0):
    return SimpleNamespace(now=now, output=SimpleNamespace(state=state, v=v, omega=0.0))


def test_stop_is_pressed_while_the_robot_drives_and_the_first_tick_that_obeys_counts():
    now, pressed = [0.0], []
    script = Script(2, lambda: pressed.append(now[0]), lambda: now[0])
    assert not script(None)
    over = False
    while not over:
        now[0] += 0.02
        since = now[0] - pressed[-1] if pressed else math.inf
        if since < 0.05 or since > 1.0 and len(pressed) < 2:
            seen = shot(now[0], GateState.ACTIVE, SPEED)
        elif since < 0.25:
            seen = shot(now[0], GateState.ESTOP, 0.1)  # it brakes
        else:
            seen = shot(now[0], GateState.ESTOP)
        over = script(seen)
    assert pressed[0] == pytest.approx(CRUISE, abs=0.05) and len(pressed) == len(script.seen) == 2
    for click, (gate, zero) in zip(pressed, script.seen, strict=True):
        assert gate - click == pytest.approx(0.06, abs=0.021)
        assert zero - click == pytest.approx(0.26, abs=0.021)
    assert now[0] - script.seen[-1][1] == pytest.approx(REST, abs=0.05)


def test_a_press_is_put_together_and_reported(tmp_path, monkeypatch, capsys):
    trace = tmp_path / "trace"
    rows = [(100.0 + 0.005 * k, min(k, 120) * 0.0015) for k in range(400)]  # stands from 100.6 s on
    trace.write_text("".join(f"{t:.4f} {x:.5f} 0\n" for t, x in rows))
    press = _press(io.StringIO("100.0 100.09\n"), trace, 100.03, 100.05)
    assert press.gate == pytest.approx(0.03) and press.zero == pytest.approx(0.05)
    assert press.stands == pytest.approx(0.6, abs=0.02)
    assert press.confirmed == pytest.approx(0.09)
    assert summary([press, Press(0.1, 0.2, 0.9, 0.3)])["gate"] == {"p50": 0.1, "max": 0.1}
    assert told([press]).count("\n") == 3
    monkeypatch.setattr("kmpc_lab.attacks.presses.run", lambda count: [press] * count)
    assert main(["latency", "--stops", "3", "--json"]) == 0
    times = json.loads(capsys.readouterr().out)
    assert len(times["presses_s"]) == 3 and times["zero"]["max"] == pytest.approx(0.05)
