"""Who may ask: loopback alone, or whoever knows the token."""

from __future__ import annotations

import hmac
import ipaddress
import os
from dataclasses import dataclass
from pathlib import Path

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.remote.client import TOKEN_VARIABLE

_MIN_TOKEN = 16


@dataclass(frozen=True)
class Access:
    """Where a server listens, and the token that its clients send; None asks for none."""

    host: str
    port: int
    token: str | None

    def allows(self, given: object) -> bool:
        """Whether a client that sent this token, or None, may go on."""
        if self.token is None:
            return True
        return isinstance(given, str) and hmac.compare_digest(given.encode(), self.token.encode())


def make_access(host: str, port: int, token_file: Path | None) -> Access:
    """Check where a server is to listen.

    The token comes from a file, or from the environment, where our clients look as well: what stands on a command line
    is seen by everybody on the machine.

    Raises:
        UserError: another host than loopback without a token, a short or unreadable token, or no such port.
    """
    if not 0 <= port < 2**16:
        raise UserError(f"port: found {port}, expected 0 (any free one) to 65535.")
    token = os.environ.get(TOKEN_VARIABLE) or None
    if token_file is not None:
        try:
            token = token_file.read_text(encoding="utf-8").strip()
        except (OSError, UnicodeDecodeError) as error:
            raise UserError(f"token-file {token_file}: cannot be read: {error}") from error
    if token is not None and (len(token) < _MIN_TOKEN or not token.isascii() or not token.isprintable()):
        raise UserError(
            f"the token has {len(token)} characters, expected at least {_MIN_TOKEN} printable ones of ASCII; for "
            "example what `openssl rand -hex 32` prints."
        )
    if token is None and not is_loopback(host):
        raise UserError(
            f"host {host}: others could reach the server, and it would answer anybody; give a token with "
            f"--token-file FILE or {TOKEN_VARIABLE}, or listen on 127.0.0.1."
        )
    return Access(host, port, token)


def is_loopback(host: str) -> bool:
    """Whether only this machine reaches a host's address."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False
