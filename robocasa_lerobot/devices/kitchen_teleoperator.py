"""What our teleoperators have in common: twelve numbers by name, and the beginnings of episodes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from lerobot.teleoperators.teleoperator import Teleoperator

from robocasa_lerobot.devices.announcements import Announcements
from robocasa_lerobot.devices.translation import NAMES


class KitchenTeleoperator(Teleoperator):
    """Says the kitchen's twelve numbers; hears when an episode begins, and has nothing to calibrate or to feed back.

    Args:
        config: LeRobot's, of the device.
        begin: called at the beginning of an episode, with its number in the dataset.
    """

    def __init__(self, config: Any, begin: Callable[[int], None]) -> None:
        super().__init__(config)
        self._announcements = Announcements(begin)
        self._connected = False

    @property
    def action_features(self) -> dict[str, type]:
        """The twelve numbers by name."""
        return dict.fromkeys(NAMES, float)

    @property
    def feedback_features(self) -> dict[str, type]:
        """None."""
        return {}

    @property
    def is_connected(self) -> bool:
        """Between `connect` and `disconnect`."""
        return self._connected

    def connect(self, calibrate: bool = True) -> None:
        """Listen for the beginnings of episodes."""
        self._announcements.listen()
        self._connected = True

    @property
    def is_calibrated(self) -> bool:
        """Nothing is to be calibrated here."""
        return True

    def calibrate(self) -> None:
        """Do nothing."""

    def configure(self) -> None:
        """Do nothing."""

    def send_feedback(self, feedback: dict[str, Any]) -> None:
        """Do nothing."""

    def disconnect(self) -> None:
        """Stop listening."""
        self._announcements.close()
        self._connected = False
