"""A robot with a host: messages and their twin in Python, how long they hold, what breaks them."""

import ctypes
import shutil
import subprocess

import numpy as np
import pytest

import kmpc_lite as kl
from firmware_bridge.drivers import onboard as say
from firmware_bridge.drivers.onboard import About, Kind, Telemetry

pytestmark = pytest.mark.skipif(
    shutil.which("cc") is None or shutil.which("make") is None, reason="no C compiler, or no make"
)
FRAME, STRUCT = 1036, 1 << 20
MODEL, PROBLEM = kl.nominal_unicycle(0.1), kl.NavigationProblem(horizon=8)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = kl.export(MODEL, PROBLEM, tmp_path_factory.mktemp("host") / "robot")
    subprocess.run(["make", "-s", "-C", made, "libkmpc.so"], check=True)
    return made


class Board:
    """host.c on this machine, its clock in our hands [ms]."""

    def __init__(self, folder, now=0):
        self._c = ctypes.CDLL(str(folder / "libkmpc.so"))
        self._host = ctypes.create_string_buffer(STRUCT)
        self.now = now
        self._c.kmpc_host_reset(self._host)

    def take(self, data):
        for byte in data:
            self._c.kmpc_host_take(self._host, ctypes.c_uint32(self.now), ctypes.c_ubyte(byte))

    def tick(self):
        command = (ctypes.c_double * 2)()
        self._c.kmpc_host_tick(self._host, ctypes.c_uint32(self.now), command)
        return tuple(command)

    def report(self):
        frame = ctypes.create_string_buffer(FRAME)
        size = self._c.kmpc_host_report(self._host, ctypes.c_uint32(self.now), frame)
        (body,) = say.decoder().feed(frame.raw[:size])
        return say.parse(body, 0.0)


@pytest.fixture
def board(folder):
    return Board(folder)


def everything(now, goal=(2.0, 0.0, 0.0)):
    """What has a robot drive at a time of its clock [ms]."""
    return {
        "heartbeat": say.heartbeat(7),
        "pose": say.numbers(Kind.POSE, (0.0, 0.0, 0.0), (now - 10) / 1e3),
        "obstacles": say.rows(Kind.OBSTACLES, []),
        "path": say.rows(Kind.PATH, []),
        "goal": say.numbers(Kind.GOAL, goal),
    }


def test_both_languages_build_and_read_the_same_frames(folder):
    """Of all lengths, with zeros at every place, and without any."""
    c = ctypes.CDLL(str(folder / "libkmpc.so"))
    random = np.random.default_rng(3)
    frames = say.decoder()
    for size in [*range(0, 20), *range(245, 262), 500, 507, 508, 509, 762, 1023, 1024]:
        for values in (256, 2, 1):
            payload = random.integers(0, values, size, dtype=np.uint8).tobytes()
            payload = payload if values > 1 else b"\x55" * size
            theirs = ctypes.create_string_buffer(FRAME)
            length = c.kmpc_encode(int(Kind.PATH), payload, size, theirs)
            ours = say.message(Kind.PATH, payload)
            assert theirs.raw[:length] == ours and length <= FRAME
            assert frames.feed(ours) == [bytes((1, Kind.PATH)) + payload]
    assert frames.bad == 0
    with pytest.raises(ValueError, match="payload: expected at most 1024 bytes, got 1025"):
        say.message(Kind.PATH, bytes(1025))


def test_it_drives_once_all_has_been_said_and_stops_when_any_is_old(folder):
    path = {"path": say.rows(Kind.PATH, [(0.0, 0.0, 0.0), (2.0, 0.0, 0.0)])}
    whys = {
        "heartbeat": (500, "host silent"),
        "pose": (190, "pose too old"),  # 10 ms old when it was sent
        "obstacles": (1000, "obstacles too old"),
        "path": (2000, "path too old"),
    }
    for missing, (lasts, why) in whys.items():
        board = Board(folder, now=2**32 - 300)  # its clock wraps meanwhile
        board.take(b"".join((everything(board.now) | path).values()))
        speeds = []
        for _ in range(150):
            speeds.append(board.tick()[0])
            told = board.report()
            elapsed = 20 * len(speeds) - 20
            assert told.standing == ("" if elapsed <= lasts else why)
            board.now = (board.now + 20) % 2**32
            said = everything(board.now) | path
            board.take(b"".join(frame for name, frame in said.items() if name != missing))
        assert max(speeds) > 0.2 and speeds[-1] == 0.0
        board.now = (board.now + 100) % 2**32
        board.take(b"".join((everything(board.now) | path).values()))
        assert board.tick()[0] > 0.0, "what is said again is believed again"


def test_what_was_never_said_is_missed(board):
    for name in ("goal", "heartbeat", "pose", "obstacles"):
        assert board.report().standing != ""
        board.take(everything(board.now)[name])
        board.tick()
        board.now += 50
    assert board.tick()[0] > 0.0 and board.report().standing == ""
    board.take(say.message(Kind.GOAL))
    board.tick()
    assert board.report().standing == "no goal"


def test_an_emergency_stop_is_at_once_and_lasts(board):
    board.take(b"".join(everything(board.now).values()))
    assert board.tick()[0] > 0.0
    board.take(say.message(Kind.ESTOP))
    assert board.tick() == (0.0, 0.0)
    for _ in range(20):
        board.now += 20
        board.take(b"".join(everything(board.now).values()))
        board.take(say.numbers(Kind.VELOCITY, (0.3, 0.0), board.now / 1e3))
        assert board.tick() == (0.0, 0.0) and board.report().standing == "emergency stop"
    board.take(say.message(Kind.RELEASE))
    assert board.tick() == (0.0, 0.0) and board.report().standing == "no goal"


def test_speeds_of_the_host_are_bounded_and_do_not_last(board):
    board.take(say.numbers(Kind.VELOCITY, (9.0, -0.2), 0.0))
    assert board.tick() == pytest.approx((0.6, -0.2))
    board.now += 251
    assert board.tick() == (0.0, 0.0)
    for wrong in ((np.nan, 0.0), (0.0, np.inf)):
        board.take(say.numbers(Kind.VELOCITY, wrong, board.now / 1e3))
        assert board.tick() == (0.0, 0.0)


def test_what_waited_on_the_line_is_old_when_it_comes(board):
    """And what is said to be of a later time is not believed."""
    for waited, moves in ((0, True), (240, False), (-40, True), (-300, False)):
        board.now += 10_000
        then = (board.now - waited) / 1e3
        board.take(say.message(Kind.RELEASE) + b"".join(everything(board.now).values()))
        board.take(say.numbers(Kind.POSE, (0.0, 0.0, 0.0), then))
        assert (board.tick()[0] > 0.0) == moves
        board.take(say.numbers(Kind.VELOCITY, (0.3, 0.0), (board.now - 1.1 * waited) / 1e3))
        assert (board.tick()[0] > 0.0) == moves


def test_it_says_what_it_is_and_how_it_is(board):
    board.take(
        say.message(Kind.ASK) + say.heartbeat(41) + say.numbers(Kind.POSE, (1.0, 2.0, 0.5), -0.03)
    )
    about = board.report()
    assert isinstance(about, About)
    assert (about.horizon, about.history, about.circles, about.poses) == (8, 0, 24, 64)
    assert about.dt == pytest.approx(0.1) and about.u_max == pytest.approx((0.6, np.pi / 4))
    board.now = 70
    told = board.report()
    assert isinstance(told, Telemetry)
    assert (told.uptime, told.heartbeat, told.good, told.bad) == (0.07, 41, 3, 0)
    assert told.pose == (1.0, 2.0, 0.5) and told.pose_age == pytest.approx(0.1)


FUZZ = """
#include <stdio.h>
#include <stdlib.h>
#include "host.h"
int main(void)
{
    static struct kmpc_host host;
    static unsigned char frame[KMPC_FRAME], payload[KMPC_PAYLOAD];
    real command[2];
    srand(4);
    kmpc_host_reset(&host);
    for (uint32_t now = 0; now < 4000; now += 5) {
        for (int i = 0; i < 4; i++) {
            int size = rand() % (i ? 70 : KMPC_PAYLOAD);
            for (int j = 0; j < size; j++)
                payload[j] = (unsigned char)(rand() % 5 ? rand() : 0);
            int length = kmpc_encode(1 + rand() % 11, payload, size, frame);
            if (rand() % 2)
                frame[rand() % length] ^= (unsigned char)(1 << rand() % 8);
            if (rand() % 4 == 0)
                length = rand() % length;
            for (int j = 0; j < length; j++)
                kmpc_host_take(&host, now, frame[j]);
        }
        kmpc_host_tick(&host, now, command);
        if (!(command[0] >= -1 && command[0] <= 1 && command[1] >= -1 && command[1] <= 1))
            return 2;
        kmpc_host_report(&host, now, frame);
    }
    printf("%d good %d bad\\n", (int)host.decoder.good, (int)host.decoder.bad);
    return 0;
}
"""


def test_garbage_breaks_nothing(folder, tmp_path):
    """Sanitizers watch sound frames of random numbers, torn and flipped ones."""
    built = shutil.copytree(folder, tmp_path / "robot")
    (built / "example.c").write_text(FUZZ)
    flags = "CFLAGS=-O1 -g -fsanitize=address,undefined -fno-sanitize-recover=all"
    subprocess.run(["make", "-s", "-C", built, "clean"], check=True)
    subprocess.run(["make", "-s", "-j2", "-C", built, "example", flags], check=True)
    done = subprocess.run([built / "example"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    good, _, bad, _ = done.stdout.split()
    assert int(good) > 500 and int(bad) > 500


def test_noise_and_torn_frames_cost_themselves_only(board):
    random = np.random.default_rng(5)
    board.take(b"".join(everything(board.now).values()))
    assert board.tick()[0] > 0.0
    for _ in range(40):
        board.now += 20
        board.take(random.integers(0, 256, 900, dtype=np.uint8).tobytes() + b"\0")
        torn = say.message(Kind.ESTOP)
        board.take(torn[: len(torn) - 2] + b"\0" + b"".join(everything(board.now).values()))
        board.tick()
        assert board.report().standing == ""
