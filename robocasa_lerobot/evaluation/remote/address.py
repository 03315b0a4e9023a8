"""Addresses of policies behind a socket: `openpi://host:8000`, `gr00t://host:5555`, `vla_eval://host:8000`."""

from __future__ import annotations

from dataclasses import dataclass

from robocasa_lerobot.errors import UnknownNameError, UserError

OPENPI, GR00T, VLA_EVAL = "openpi", "gr00t", "vla_eval"
DEFAULT_PORTS = {OPENPI: 8000, GR00T: 5555, VLA_EVAL: 8000}  # of the projects' own servers
_MARK, _ENCRYPTED = "://", "+wss"


@dataclass(frozen=True)
class Address:
    """Where a server listens and what it speaks; `path` is that of a websocket, "" or with its leading slash."""

    protocol: str
    host: str
    port: int
    path: str = ""
    encrypted: bool = False

    @property
    def text(self) -> str:
        """The address as a user writes it, with its port."""
        return f"{self.protocol}{_ENCRYPTED * self.encrypted}{_MARK}{self.host}:{self.port}{self.path}"

    @property
    def websocket(self) -> str:
        """The address for a websocket."""
        return f"{'wss' if self.encrypted else 'ws'}://{self.host}:{self.port}{self.path}"


def is_address(text: str) -> bool:
    """Whether this names a policy behind a socket, and not a folder."""
    return _MARK in text


def parse_address(text: str) -> Address:
    """The address in a text such as `openpi://127.0.0.1:8000`; `openpi+wss://` is the encrypted websocket.

    Raises:
        UnknownNameError: a protocol that is not spoken here.
        UserError: no host, or a port that is none.
    """
    scheme, mark, rest = text.partition(_MARK)
    protocol, plus, _ = scheme.partition(_ENCRYPTED)
    if not mark or protocol not in DEFAULT_PORTS or (plus and protocol == GR00T):
        raise UnknownNameError("protocol of a policy", scheme, DEFAULT_PORTS, f"(in {text})")
    place, slash, path = rest.partition("/")
    if place.startswith("["):  # an IPv6 address, [::1]:8000
        host, _, port = place[1:].partition("]")
        host, port = f"[{host}]", port.removeprefix(":")
    else:
        host, _, port = place.partition(":")
    if not host or (port and not (port.isdigit() and 0 < int(port) < 65536)):
        raise UserError(
            f"policy.path {text}: expected {protocol}://HOST:PORT, such as {protocol}://127.0.0.1:"
            f"{DEFAULT_PORTS[protocol]}."
        )
    return Address(protocol, host, int(port or DEFAULT_PORTS[protocol]), slash + path, bool(plus))
