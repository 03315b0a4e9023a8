"""Where a recording stands. LeRobot tells its robots and teleoperators nothing of episodes, but it tells its log.

`lerobot-record` 0.6.1 announces each phase with `log_say`, before the phase begins, in this process: "Recording episode
0", "Reset the environment", "Re-record episode". Between two announcements it calls nothing but `get_observation`,
`get_action` and `send_action`. `tests/devices` pins the sentences.
"""

from __future__ import annotations

import logging
from collections.abc import Callable

BEGIN = "Recording episode "  # with its number, the same one again after "Re-record episode"


class Announcements(logging.Handler):
    """Calls `begin(number)` before an episode is recorded; it is that of the episode in the dataset.

    So it goes on where a recording is resumed, and is said again where an episode was thrown away.

    Usage: `listen()` when the device connects, `close()` when it disconnects.
    """

    def __init__(self, begin: Callable[[int], None]) -> None:
        super().__init__(logging.INFO)
        self._begin = begin

    def listen(self) -> None:
        """Start."""
        logging.getLogger().addHandler(self)

    def close(self) -> None:
        """Stop."""
        logging.getLogger().removeHandler(self)
        super().close()

    def emit(self, record: logging.LogRecord) -> None:
        """Take an announcement; everything else is let through."""
        text = record.getMessage() if isinstance(record.msg, str) else ""
        number = text.removeprefix(BEGIN)
        if number != text and number.isdecimal():
            self._begin(int(number))
