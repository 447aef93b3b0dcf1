"""Logs of a link: what passed, in both directions, read back."""

import time

from loopback import LoopbackWire

from firmware_bridge.recording.link_log import Chunk, RecordedTransport, tlog
from kmpc_lite.learn.formats.ardupilot import frames


def frame(k: int) -> bytes:
    from pymavlink.dialects.v20 import ardupilotmega as dialect

    mav = dialect.MAVLink(None, srcSystem=1, srcComponent=1)
    mav.seq = k % 256
    return bytes(dialect.MAVLink_attitude_message(k, 0.0, 0.0, 0.1, 0.0, 0.0, 0.2).pack(mav))


def recorded_link(log):
    """A wire whose bridge end is recorded."""
    wire = LoopbackWire(manual=True)
    heard = []
    transport = RecordedTransport(wire.bridge, log.put)
    transport.start(lambda data, stamp: heard.append(data))
    wire.board.start(lambda data, stamp: None)
    return wire, transport, heard


def test_a_tlog_holds_both_ways_and_only_whole_frames(tmp_path):
    path = tmp_path / "a.tlog"
    log = tlog(path)
    wire, transport, heard = recorded_link(log)
    before = time.time()
    for k in range(50):
        wire.board.write(b"boot text" + frame(k)[:7])
        wire.board.write(frame(k)[7:] + b"\xfd\x03noise")
        transport.write(frame(1000 + k))
        wire.pump()
    assert (
        transport.connected
        and transport.counters["bytes_out"] == 50 * len(frame(0))
        and transport.last_error == ""
    )
    transport.close()
    log.close()
    from pymavlink import mavutil

    reader = mavutil.mavlogfile(str(path))
    messages = []
    while (message := reader.recv_match()) is not None:
        messages.append(message)
    reader.close()
    assert {m.get_type() for m in messages} == {"ATTITUDE"}
    assert sorted(m.time_boot_ms for m in messages) == [*range(50), *range(1000, 1050)]
    assert all(before - 1.0 < m._timestamp < time.time() + 1.0 for m in messages)
    assert len(list(frames(path))) == 100 and b"".join(heard).count(b"boot text") == 50


def test_what_the_link_did_not_take_is_not_in_the_log(tmp_path):
    log = tlog(tmp_path / "a.tlog")
    wire, transport, _ = recorded_link(log)
    wire.cut()
    assert not transport.write(frame(1))
    log.close()
    assert not (tmp_path / "a.tlog").read_bytes()


def test_a_log_cut_anywhere_gives_its_whole_records(tmp_path):
    path = tmp_path / "a.tlog"
    log = tlog(path)
    for k in range(5):
        log.put(Chunk(100.0 + k, True, frame(k)))
    log.close()
    whole = path.read_bytes()
    complete = [data for _, _, data in frames(path)]
    assert len(complete) == 5
    for cut in range(40, len(whole)):
        path.write_bytes(whole[:cut])
        found = [data for _, _, data in frames(path)]
        assert found == complete[: len(found)]
        assert len(found) >= cut // (len(whole) // 5 + 1)
