"""Links of every kind, which are closed after a test."""

import socket

import pytest
from free_port import free_port
from link_ends import End


@pytest.fixture(params=["pty", "tcp", "udp"])
def url(request, tmp_path):
    return {
        "pty": f"pty:{tmp_path}/port",
        "tcp": f"tcp:127.0.0.1:{free_port()}",
        "udp": f"udp:127.0.0.1:{free_port(socket.SOCK_DGRAM)}",
    }[request.param]


@pytest.fixture
def opened():
    """Close whatever a test opened."""
    transports = []

    def keep(transport, reply=None):
        transports.append(transport)
        return End(transport, reply).start()

    yield keep
    for transport in transports:
        transport.close()
