"""Questions and answers: a reply that comes late is our own, many that come unasked are not."""

import pytest

from firmware_bridge.drivers.polled.exchange import STRANGERS, Exchange, NoReply


class Silent:
    """A link that takes everything and gives nothing."""

    def write(self, data: bytes) -> bool:
        return True


@pytest.fixture
def exchange() -> Exchange:
    return Exchange(Silent(), 0.0, lambda key: None)  # type: ignore[arg-type]


def give_up(exchange: Exchange) -> None:
    with pytest.raises(NoReply):
        exchange.ask(b"?", "counters")


def test_replies_that_come_late_are_our_own(
    exchange: Exchange, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On a busy machine every reply may be late: no other program talks to the board."""
    monkeypatch.setattr("time.monotonic", lambda: 5.0)
    for _ in range(3 * STRANGERS):
        give_up(exchange)
        exchange.deliver("counters", b"late", 5.1)
    assert exchange.counters["unexpected_replies"] == 3 * STRANGERS
    assert not exchange.strangers(5.1)


def test_replies_without_a_question_belong_to_another_program(
    exchange: Exchange, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("time.monotonic", lambda: 5.0)
    give_up(exchange)
    for k in range(STRANGERS):
        assert not exchange.strangers(5.1)
        exchange.deliver("counters", b"?", 5.1 + 0.01 * k)
    assert not exchange.strangers(5.2), "one of them may be ours"
    exchange.deliver("counters", b"?", 5.2)
    assert exchange.strangers(5.2) and not exchange.strangers(6.2)
