"""`kmpc replay` serves a log, and mends one that a power cut tore."""

import json
import socket
from pathlib import Path

from emulated_robots import meanwhile
from waiting import until

from firmware_bridge.link import open_transport
from firmware_bridge.messages import LinkError
from kmpc_lite.cli.main import main


def test_replay_serves_a_log_to_any_listener(desk, capsys):
    from firmware_bridge.recording.link_log import Chunk, raw_log

    log = raw_log(Path("a.raw"))
    for k in range(20):
        log.put(Chunk(100.0 + 0.01 * k, True, b"in%02d" % k))
        log.put(Chunk(100.0 + 0.01 * k, False, b"out"))
    log.close()
    heard = bytearray()
    with socket.create_server(("127.0.0.1", 0)) as free:
        url = f"tcp:127.0.0.1:{free.getsockname()[1]}"

    def listener():
        def start():
            transport = open_transport(url)
            try:
                transport.start(lambda data, stamp: heard.extend(data))
            except LinkError:
                return False
            return True

        assert until(start) and until(lambda: len(heard) >= 80)

    with meanwhile(listener):
        assert main(["replay", "a.raw", "--link", url, "--speed", "2"]) == 0
    assert bytes(heard) == b"".join(b"in%02d" % k for k in range(20))
    assert main(["replay", "a.raw", "--csv", "x.csv"]) == 2


def test_a_csv_that_a_power_cut_tore_is_reported_and_mended(desk, capsys):
    rows = b"".join(b"%.6f,0.1,0.2,0.3,0.4,0.5\n" % (0.1 * k) for k in range(20))
    (desk / "drive.csv").write_bytes(
        b"t,x,y,theta,v,omega\n" + rows + b"2.000000,0.1,0.2,0.3,0.4,0."
    )
    assert main(["replay", "drive.csv", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {
        "log": "drive.csv",
        "rows": 20,
        "torn_bytes": 27,
        "mended": False,
    }
    assert main(["replay", "drive.csv", "--mend"]) == 0
    assert (desk / "drive.csv").read_bytes().endswith(rows)
    (desk / "other.csv").write_bytes(b"name,phone\nA,1")
    for words in (
        ["other.csv", "--mend"],
        ["drive.tlog", "--mend"],
        ["drive.csv", "--csv", "b.csv"],
    ):
        capsys.readouterr()
        assert main(["replay", *words]) == 2
        assert capsys.readouterr().err.count("\n") == 1
    assert (desk / "other.csv").read_bytes() == b"name,phone\nA,1"
