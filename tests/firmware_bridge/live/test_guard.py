"""Requests of strangers, of other sites' pages, and of our own."""

import pytest

from firmware_bridge.live.guard import Guard, Refused, TwoActions

TOKEN = "abcdefghjkmn"


def enter(guard: Guard, method: str = "GET", **headers: str):
    names = {name: name.replace("_", "-").title() for name in headers}
    return guard.enter(method, {names[name]: value for name, value in headers.items()})


def refused(guard: Guard, *what: str, **headers: str) -> bool:
    try:
        enter(guard, *what, **headers)
    except Refused as error:
        return error.status == 403
    return False


def test_on_this_computer_one_may_watch_without_the_token_and_elsewhere_not():
    ours, far = Guard(TOKEN, True, ["localhost"]), Guard(TOKEN, False, ["localhost", "pi.local"])
    assert enter(ours, host="127.0.0.1:8764") is False
    assert enter(ours, host="localhost:8764", x_kmpc=TOKEN) is True
    assert enter(far, host="192.168.1.5:8764", x_kmpc=TOKEN) is True
    assert enter(far, host="pi.local:8764", x_kmpc=TOKEN) is True
    assert refused(far, host="192.168.1.5:8764")
    for shown in ("", "1", TOKEN[:-1], f"{TOKEN}x", "é"):
        assert refused(far, host="192.168.1.5:8764", x_kmpc=shown), shown


@pytest.mark.parametrize(
    "host", ["evil.example", "evil.example:8764", "", "127.0.0.1.evil.example"]
)
def test_a_name_of_a_stranger_that_leads_here_is_refused(host):
    """DNS rebinding: the page of evil.example suddenly speaks to this computer."""
    assert refused(Guard(TOKEN, True, ["localhost"]), host=host)
    assert refused(Guard(TOKEN, True, ["localhost"]), host=host, x_kmpc=TOKEN)


def test_what_the_page_of_another_site_sends_is_refused():
    guard, host = Guard(TOKEN, True, ["localhost"]), "localhost:8764"
    for origin in (
        "http://evil.example",
        "null",
        "http://localhost:9999",
        "https://localhost:8764",
    ):
        assert refused(guard, "POST", host=host, origin=origin), origin
        assert refused(guard, "GET", host=host, origin=origin), origin
    assert refused(guard, "POST", host=host, sec_fetch_site="cross-site")
    assert not enter(guard, "POST", host=host, origin=f"http://{host}")
    assert not enter(guard, "POST", host=host)  # curl


def test_the_second_action_counts_once_and_within_five_seconds_of_the_first():
    now = [100.0]
    two = TwoActions(lambda: now[0])
    assert not two.second("") and not two.second(None)
    for wait, counts in ((0.1, False), (0.3, True), (4.9, True), (5.1, False)):
        code = two.first()
        now[0] += wait
        assert two.second(code) is counts, wait
        assert not two.second(code)
    code = two.first()
    now[0] += 1.0
    assert not two.second("é" * 16) and not two.second(code)  # a wrong one uses it up
