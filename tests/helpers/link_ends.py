"""Both ends of a link, and what each has received."""

import socket
import threading
import time


def free_port(kind=socket.SOCK_STREAM):
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class End:
    """A transport and all that it has received."""

    def __init__(self, transport, reply=None):
        self.transport, self.data = transport, bytearray()
        self.reply = reply

    def start(self):
        self.transport.start(self._receive)
        return self

    def _receive(self, data, stamp):
        assert threading.current_thread() is not threading.main_thread()
        assert abs(time.monotonic() - stamp) < 5.0
        self.data += data
        if self.reply:
            self.transport.write(self.reply + data)
