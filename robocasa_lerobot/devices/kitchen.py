"""The simulated kitchen, driven by LeRobot's commands as a real robot is."""

from __future__ import annotations

import itertools
import logging
import sys
import time
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from lerobot.robots.robot import Robot

from robocasa_lerobot import contract
from robocasa_lerobot.demos.replay import Kitchen, demonstrations, kitchen_of, read_kitchen
from robocasa_lerobot.devices.announcements import Announcements
from robocasa_lerobot.devices.config_kitchen import RobocasaKitchenConfig
from robocasa_lerobot.devices.translation import NAMES, HandTranslator
from robocasa_lerobot.envs.kitchen_env import KitchenEnv, Observation
from robocasa_lerobot.errors import UserError

_STATES = tuple(contract.component_names(contract.STATE_PARTS))
_STEP_S = 1.0 / contract.CONTROL_HZ
_SLACK_S = 0.5 * _STEP_S
_RATE_FLAG = "--dataset.fps"


class RobocasaKitchen(Robot):
    """PandaOmron in a kitchen: sixteen numbers of state, three pictures, twelve numbers of action, 20 steps/s.

    One `send_action` is one control step. An action is the twelve numbers by name, or what LeRobot's gamepad says. The
    dataset's robot type and features are those of a converted one, in float32. Raises UserError for an unknown task,
    split or preset, and where a recording is to be kept at another rate.
    """

    config_class = RobocasaKitchenConfig
    name = contract.ROBOT_TYPE

    def __init__(self, config: RobocasaKitchenConfig) -> None:
        super().__init__(config)
        self.config = config
        self._recorded = _kitchens_of(config)
        first = self._recorded[0] if self._recorded else None
        drawn: dict[str, Any] = {"render_preset": config.render_preset, "image_size": config.image_size}
        self._env = (
            kitchen_of(first, **drawn)
            if first
            else KitchenEnv(config.task, split=config.split, terminate_on_success=False, **drawn)
        )
        self.cameras: dict[str, None] = dict.fromkeys(contract.CAMERAS)  # LeRobot counts them
        self._states = tuple(name + config.suffix for name in _STATES)
        self._names = tuple(name + config.suffix for name in NAMES)
        self._translator = HandTranslator()
        self._announcements = Announcements(self._begin)
        self._observation: Observation | None = None
        self._episode = self._steps = 0
        self._succeeded = False
        self._due = 0.0

    @property
    def observation_features(self) -> dict[str, Any]:
        """State by component, pictures by camera."""
        size = self.config.image_size
        return {**dict.fromkeys(self._states, float), **dict.fromkeys(contract.CAMERAS, (size, size, 3))}

    @property
    def action_features(self) -> dict[str, type]:
        """The twelve numbers by name."""
        return dict.fromkeys(self._names, float)

    @property
    def is_connected(self) -> bool:
        """Whether there is a kitchen."""
        return self._observation is not None

    def connect(self, calibrate: bool = True) -> None:
        """Make the first kitchen.

        Raises:
            UserError: `lerobot-record` is to keep another rate than the kitchen's.
        """
        _check_rate(sys.argv)
        self._announcements.listen()
        self._reset()

    @property
    def is_calibrated(self) -> bool:
        """Nothing is to be calibrated."""
        return True

    def calibrate(self) -> None:
        """Do nothing."""

    def configure(self) -> None:
        """Do nothing."""

    def get_observation(self) -> dict[str, Any]:
        """State (floats by component) and pictures (S, S, 3) uint8 of this moment.

        Raises:
            UserError: before `connect`.
        """
        seen = self._seen()
        return {**dict(zip(self._states, seen["agent_pos"].tolist(), strict=True)), **seen["pixels"]}

    def send_action(self, action: Mapping[str, Any]) -> dict[str, float]:
        """Carry out one action; returns it as it was carried out.

        Raises:
            UserError: before `connect`, or an action of no known kind.
        """
        self._seen()
        if set(self._names) <= action.keys():
            said = [action[name] for name in self._names]
        else:  # a teleoperator's own names
            named = action if set(NAMES) <= action.keys() else self._translator.action(action)
            said = [named[name] for name in NAMES]
        vector = np.array([float(number) for number in said], dtype=np.float32)
        self._wait()
        self._observation, _, _, _, info = self._env.step(vector)
        self._steps += 1
        if info["success"] and not self._succeeded:
            logging.info("The goal is reached: %s", info["instruction"])
        self._succeeded |= bool(info["success"])
        return dict(zip(self._names, contract.binarize(vector).tolist(), strict=True))

    def disconnect(self) -> None:
        """Leave the kitchen."""
        self._announcements.close()
        self._env.close()
        self._observation = None

    def _seen(self) -> Observation:
        if self._observation is None:
            raise UserError("the kitchen is not connected: call connect() first.")
        return self._observation

    def _begin(self, number: int) -> None:
        """An episode is to be recorded: from the beginning of a kitchen that nobody has touched."""
        episode = number if self.config.next_kitchen else 0
        if self._steps == 0 and episode == self._episode:
            return
        self._episode = episode
        self._reset()

    def _reset(self) -> None:
        if self._recorded:
            seed = self._recorded[self._episode % len(self._recorded)].seed
        else:
            seed = self.config.seed + self._episode
        self._observation, info = self._env.reset(seed=seed)
        self._steps, self._succeeded, self._due = 0, False, 0.0
        self._translator.reset()
        logging.info("Kitchen of seed %d: %s", seed, info["instruction"])

    def _wait(self) -> None:
        now = time.monotonic()
        # Half a step early is let through: LeRobot's loops keep the pace themselves, not to the millisecond.
        early = self._due - _SLACK_S - now
        if self.config.realtime and early > 0:
            time.sleep(early)
        self._due = max(now, self._due) + _STEP_S


def _kitchens_of(config: RobocasaKitchenConfig) -> list[Kitchen]:
    """The kitchens of demonstrations, all of one task and split, and drawn in the same manner."""
    if config.demos is None:
        return []
    found = [read_kitchen(path, demo) for path, demo in demonstrations([config.demos])]
    kinds = {kitchen.kind for kitchen in found}
    if len(kinds) > 1:
        raise UserError(
            f"robot.demos: found demonstrations of {len(kinds)} tasks, splits or ways to start, expected one: "
            "give one file."
        )
    return found


def _check_rate(arguments: Sequence[str]) -> None:
    """A robot is not told at which rate its frames are kept; another rate makes every time stamp wrong, silently."""
    if not any(argument.startswith("--dataset.") for argument in arguments):
        return  # no recording, or its settings are in a file
    given = [a.partition("=")[2] for a in arguments if a.startswith(f"{_RATE_FLAG}=")]
    given += [b for a, b in itertools.pairwise(arguments) if a == _RATE_FLAG]
    if not given and any(argument.startswith("--config_path") for argument in arguments):
        return  # it may stand in that file
    if not given or float(given[-1]) != contract.CONTROL_HZ:
        found = given[-1] if given else "none (LeRobot's default is 30)"
        raise UserError(
            f"{_RATE_FLAG}: found {found}, but a kitchen's frames are {contract.CONTROL_HZ} a second; "
            f"give {_RATE_FLAG}={contract.CONTROL_HZ}."
        )
