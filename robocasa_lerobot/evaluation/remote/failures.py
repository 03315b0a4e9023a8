"""What can go wrong with a policy behind a socket, told apart by whose fault it is."""

from __future__ import annotations


class RemoteError(RuntimeError):
    """A request to a policy behind a socket did not end with its actions."""


class LostError(RemoteError):
    """No connection, or none any more: refused, timed out or closed. The trial is repeated over a new one."""


class ServerSaidError(RemoteError):
    """The server answered with an error of its own, whose text this is."""


class AnswerError(RemoteError):
    """The server answered, and the answer is not what the protocol or the key map says."""
