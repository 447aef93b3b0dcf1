"""The other end of the line: counts what it is told to drive, until its watchdog stops it."""

import time

from firmware_bridge.link.server import serve

speeds, counts, rest = [0, 0], [0.0, 0.0], b""
watchdog, heard, last = 0.3, time.monotonic(), time.monotonic()


def take(data, stamp):
    global watchdog, heard, rest
    advance()
    *lines, rest = (rest + data).split(b"\n")
    for kind, *words in (line.decode().split() for line in lines):
        if kind == "W":
            watchdog = int(words[0]) / 1000
        elif kind == "M":
            speeds[:], heard = map(int, words), time.monotonic()
        elif kind == "Q":
            words = [round(number) for number in (*counts, *speeds)]
        link.write(f"{kind} {' '.join(map(str, words))}\n".encode())


def advance():
    global last
    now = time.monotonic()
    if now - heard > watchdog:
        speeds[:] = 0, 0
    counts[:] = (c + s * (now - last) for c, s in zip(counts, speeds, strict=True))
    last = now


link = serve("pty:wheelie")
link.start(take)
try:
    while True:
        time.sleep(0.01)
        advance()
finally:
    link.close()
