"""`kmpc emulate` serves an emulated robot until it is ended."""

import json
import signal
from pathlib import Path

from emulated_robots import start_command
from waiting import until


def test_emulate_serves_until_it_is_ended_and_reports_where_the_robot_is(desk):
    child = start_command(
        "emulate", "mavlink", "--link", "pty:rover", "--start", "0.5", "0.25", "0.1", "--json"
    )
    assert until(lambda: Path("rover").is_symlink())
    child.send_signal(signal.SIGTERM)
    out, err = child.communicate(timeout=20.0)
    assert (child.returncode, err) == (0, "") and json.loads(out)["pose"] == [0.5, 0.25, 0.1]
    assert not Path("rover").is_symlink()
