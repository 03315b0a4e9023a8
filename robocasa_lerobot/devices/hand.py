"""One of LeRobot's own devices leads the kitchen's hand."""

from __future__ import annotations

from typing import Any

from lerobot.teleoperators.keyboard.teleop_keyboard import KeyboardEndEffectorTeleop
from lerobot.teleoperators.utils import make_teleoperator_from_config

from robocasa_lerobot.devices.config_hand import RobocasaHandConfig
from robocasa_lerobot.devices.kitchen_teleoperator import KitchenTeleoperator
from robocasa_lerobot.devices.translation import HandTranslator


class RobocasaHand(KitchenTeleoperator):
    """Reads a gamepad, keyboard or phone through LeRobot and says the kitchen's twelve numbers.

    The base stands: these devices have no more axes. A new episode starts with an open hand.
    """

    config_class = RobocasaHandConfig
    name = "robocasa_hand"

    def __init__(self, config: RobocasaHandConfig) -> None:
        super().__init__(config, lambda number: self._translator.reset())
        self.device = make_teleoperator_from_config(config.of_device())
        self._phone = _phone_step(config) if config.device == "phone" else None
        self._translator = HandTranslator(config.speed, keyboard_axes=config.device == "keyboard_ee")

    def connect(self, calibrate: bool = True) -> None:
        """Open the device (a phone is calibrated by that)."""
        self.device.connect()
        super().connect(calibrate)

    def calibrate(self) -> None:
        """Leave it to the device."""
        self.device.calibrate()

    def configure(self) -> None:
        """Leave it to the device."""
        self.device.configure()

    def get_action(self) -> dict[str, float]:
        """What the operator does now."""
        said: dict[str, Any] = dict(self.device.get_action())
        if isinstance(self.device, KeyboardEndEffectorTeleop):
            _forget_released(self.device)
        if self._phone is not None and said:
            said = self._phone.action(said)
        return self._translator.action(said)

    def get_teleop_events(self) -> dict[Any, Any]:
        """The device's own events, such as success, where it has any."""
        ask = getattr(self.device, "get_teleop_events", None)
        return dict(ask()) if ask is not None else {}

    def disconnect(self) -> None:
        """Close the device."""
        super().disconnect()
        self.device.disconnect()


def _forget_released(keyboard: KeyboardEndEffectorTeleop) -> None:
    # LeRobot goes through its keys in the order of their first presses, those that are let go as well, and the last one
    # of an axis counts: a key that was let go would undo its opposite, and the left Ctrl close the hand for ever.
    pressed = keyboard.current_pressed
    for key in [key for key, down in pressed.items() if not down]:
        del pressed[key]


def _phone_step(config: RobocasaHandConfig) -> Any:
    # LeRobot knows how each kind of phone is held and which of its buttons grips.
    from lerobot.teleoperators.phone.phone_processor import MapPhoneActionToRobotAction

    return MapPhoneActionToRobotAction(platform=config.phone_os)
