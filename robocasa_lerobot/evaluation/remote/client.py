"""The interface of a client, whatever its protocol, and what all clients share."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

# Seconds between two signs of life while a client waits.
POLL_SECONDS = 0.5
# Where a user puts the token of a server that wants one: never on a command line, never into results.
TOKEN_VARIABLE = "ROBOCASA_LEROBOT_POLICY_TOKEN"


@dataclass(frozen=True)
class Timeouts:
    """Seconds: until somebody listens and has introduced itself, for an answer, and for the first one.

    The first answer has its own, because servers compile on their first request, some for many minutes. Who asks a
    server that others ask as well gives `introduction` as long: it may be compiling for one of them.
    """

    connect: float = 60.0
    answer: float = 120.0
    first_answer: float = 900.0
    introduction: float = 0.0

    @property
    def introduced(self) -> float:
        """Until somebody who listens has introduced itself."""
        return max(self.connect, self.introduction)


def do_nothing() -> None:
    """What a client calls while it waits, unless it is told otherwise."""


Waiting = Callable[[], None]


class PolicyClient(Protocol):
    """A connection to a policy; one request at a time.

    Attributes:
        metadata: what the server said about itself when the connection was made; {} where it says nothing.
    """

    metadata: dict[str, Any]

    def infer(self, observation: Mapping[str, Any]) -> dict[str, Any]:
        """The server's answer to an observation: a map with the actions, arrays as read-only numpy arrays.

        Raises:
            LostError: the connection ended, or no answer came in time; this client is of no use any more.
            ServerSaidError: the server answered with an error.
            AnswerError: the answer cannot be read.
        """

    def reset(self, message: Mapping[str, Any] | None = None) -> None:
        """Tell the server that an episode begins, where the protocol can; `message` is what the key map adds.

        Raises:
            LostError, ServerSaidError, AnswerError: as for `infer`.
        """

    def close(self) -> None:
        """End the connection; a closed client stays closed."""
