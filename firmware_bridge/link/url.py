"""Link URLs: ``kind:target?option=value``, the same everywhere."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from urllib.parse import parse_qsl

from firmware_bridge.messages import ConfigError

KINDS = ("serial", "pty", "tcp", "udp")


@dataclass(frozen=True)
class LinkUrl:
    """A link URL taken apart.

    Examples
    --------
    >>> LinkUrl.parse("serial:/dev/ttyACM0?baud=115200").target
    '/dev/ttyACM0'
    >>> LinkUrl.parse("tcp:127.0.0.1:5760").address()
    ('127.0.0.1', 5760)
    """

    text: str
    kind: str
    target: str
    options: Mapping[str, str]

    @classmethod
    def parse(cls, text: str) -> LinkUrl:
        """Take a URL apart; ConfigError says what is wrong with it.

        A bare path is a serial port.

        >>> LinkUrl.parse("/dev/ttyACM0").text
        'serial:/dev/ttyACM0'
        """
        if text.startswith("/"):
            text = f"serial:{text}"
        kind, colon, rest = text.partition(":")
        if not colon or kind not in KINDS:
            raise ConfigError(f"link: expected {', '.join(k + ':' for k in KINDS)}, got {text!r}")
        target, _, query = rest.partition("?")
        try:
            options = dict(parse_qsl(query, keep_blank_values=True, strict_parsing=bool(query)))
        except ValueError:
            raise ConfigError(
                f"link: expected options as name=value&name=value after '?', got {text!r}"
            ) from None
        return cls(text, kind, target, options)

    def allow(self, *names: str) -> None:
        """Refuse options that this kind of link does not have."""
        for name in self.options:
            if name not in names:
                raise ConfigError(
                    f"link {self.text!r}: unknown option {name!r}; {self.kind}: "
                    f"takes {', '.join(names) or 'none'}"
                )

    def number(self, name: str, default: float, low: float, high: float) -> float:
        """Take one option as a number within [low, high]."""
        text = self.options.get(name)
        if text is None:
            return default
        try:
            value = float(text)
        except ValueError:
            value = float("nan")
        if not low <= value <= high:
            raise ConfigError(
                f"link {self.text!r}: {name}: expected a number from {low:g} to {high:g}, "
                f"got {text!r}"
            )
        return value

    def address(self) -> tuple[str, int]:
        """Host and port; an empty host is 127.0.0.1, and brackets go round IPv6."""
        host, _, port = self.target.rpartition(":")
        if not port.isascii() or not port.isdigit() or int(port) > 65535 or ":" not in self.target:
            raise ConfigError(
                f"link {self.text!r}: expected {self.kind}:HOST:PORT with a port from 0 to 65535"
            )
        return host.removeprefix("[").removesuffix("]") or "127.0.0.1", int(port)

    def path(self) -> str:
        """File system path of a port."""
        if not self.target or "\0" in self.target:
            raise ConfigError(f"link {self.text!r}: expected {self.kind}:PATH")
        return self.target
