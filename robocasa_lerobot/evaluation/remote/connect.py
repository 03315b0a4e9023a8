"""A client for an address, whatever its protocol."""

from __future__ import annotations

from robocasa_lerobot.evaluation.remote.address import GR00T, OPENPI, Address, parse_address
from robocasa_lerobot.evaluation.remote.client import PolicyClient, Timeouts, Waiting, do_nothing
from robocasa_lerobot.evaluation.remote.gr00t import Gr00tClient
from robocasa_lerobot.evaluation.remote.openpi import OpenpiClient
from robocasa_lerobot.evaluation.remote.vla_eval import VlaEvalClient


def connect(
    url: str | Address,
    timeouts: Timeouts | None = None,
    waiting: Waiting = do_nothing,
    token: str | None = None,
) -> PolicyClient:
    """A connection to the policy server at `url`, such as `openpi://127.0.0.1:8000`.

    Args:
        url: protocol, host and port.
        timeouts: seconds of patience.
        waiting: called about twice a second while a client waits.
        token: for servers that want one.

    Raises:
        LostError: nobody listens, or nobody answers; the text tells refused, timed out and closed apart.
        UserError: the address is none, or the server refuses us.
    """
    address = parse_address(url) if isinstance(url, str) else url
    patience = timeouts or Timeouts()
    if address.protocol == OPENPI:
        return OpenpiClient(address, patience, waiting, token)
    if address.protocol == GR00T:
        return Gr00tClient(address, patience, waiting, token)
    return VlaEvalClient(address, patience, waiting, token)
