"""Settings of a LeRobot device that leads the hand: `--teleop.type=robocasa_hand --teleop.device=gamepad`."""

from __future__ import annotations

from dataclasses import dataclass

# Their names are imported for LeRobot's commands too, of which some know `gamepad` and `phone` only by that.
from lerobot.teleoperators.config import TeleoperatorConfig
from lerobot.teleoperators.gamepad.configuration_gamepad import GamepadTeleopConfig
from lerobot.teleoperators.keyboard.configuration_keyboard import KeyboardEndEffectorTeleopConfig
from lerobot.teleoperators.phone.config_phone import PhoneConfig, PhoneOS

from robocasa_lerobot.errors import UnknownNameError, UserError

DEVICES = ("gamepad", "keyboard_ee", "phone")


@TeleoperatorConfig.register_subclass("robocasa_hand")
@dataclass(kw_only=True)
class RobocasaHandConfig(TeleoperatorConfig):
    """One of LeRobot's own devices, whose motions become the kitchen's twelve numbers.

    Attributes:
        device: LeRobot's name of it: gamepad, keyboard_ee or phone.
        speed: share of the full speed at full deflection, above 0 and at most 1.
        hidapi_fallback: of the gamepad, as LeRobot has it.
        phone_os: of the phone, as LeRobot has it.
    """

    device: str = "gamepad"
    speed: float = 1.0
    hidapi_fallback: bool = False
    phone_os: PhoneOS = PhoneOS.ANDROID

    def __post_init__(self) -> None:
        """Check them.

        Raises:
            UnknownNameError: a device that does not lead a hand.
            UserError: a speed outside (0, 1].
        """
        if self.device not in DEVICES:
            raise UnknownNameError("teleop.device", self.device, DEVICES)
        if not 0 < self.speed <= 1:
            raise UserError(f"teleop.speed: found {self.speed}, expected a share above 0 and at most 1.")

    def of_device(self) -> TeleoperatorConfig:
        """LeRobot's configuration of the device."""
        # draccus cannot nest a choice of teleoperators in a teleoperator, so it is not a field.
        if self.device == "phone":
            return PhoneConfig(id=self.id, phone_os=self.phone_os)
        if self.device == "keyboard_ee":
            return KeyboardEndEffectorTeleopConfig(id=self.id)
        return GamepadTeleopConfig(id=self.id, hidapi_fallback=self.hidapi_fallback)
