"""`kmpc check` says what is missing, and moves nothing."""

import json

from courses import PATIENT
from emulated_robots import ROBOTS, emulated

from kmpc_lite.cli.main import main


def test_check_says_what_is_missing_and_moves_nothing(desk, capsys):
    with emulated("rover", arm_after=0.0) as rover:  # it may be asked at once
        assert (
            main([*f"check {ROBOTS}/rover.toml --link pty:link --seconds 0.5".split(), *PATIENT])
            == 0
        )
        out = capsys.readouterr().out
        assert "pose: x " in out and "MISSING" not in out
        assert "ok       not given to us yet: MANUAL, not armed; run --arm takes it" in out
        assert rover.pose == (0.0, 0.0, 0.0) and rover.mode == "MANUAL"
    with emulated("roboclaw"):
        assert (
            main(
                [
                    *f"check {ROBOTS}/roboclaw.toml --link pty:link --seconds 0.5".split(),
                    *PATIENT,
                    "--json",
                ]
            )
            == 0
        )
        report = json.loads(capsys.readouterr().out)
        assert (
            report["ok"]
            and "the safety gate would let it drive now" in report["findings"][-1]["text"]
        )
