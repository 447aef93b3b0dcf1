"""Both ends of a link, and what each has received."""

import threading
import time


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
