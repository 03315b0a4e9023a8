"""The kitchen as a LeRobot robot and the teleoperators for it, as LeRobot's loops call them."""

from __future__ import annotations

import enum
import inspect
import json
import logging
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
from lerobot.robots.config import RobotConfig
from lerobot.robots.utils import make_robot_from_config
from lerobot.scripts import lerobot_record
from lerobot.teleoperators.config import TeleoperatorConfig
from lerobot.teleoperators.keyboard import teleop_keyboard
from lerobot.teleoperators.phone.config_phone import PhoneConfig, PhoneOS
from lerobot.teleoperators.utils import make_teleoperator_from_config
from scipy.spatial.transform import Rotation

import robocasa_lerobot.plugins  # noqa: F401
from robocasa_lerobot import contract
from robocasa_lerobot.demos.motion import base_pose
from robocasa_lerobot.devices.announcements import BEGIN, Announcements
from robocasa_lerobot.devices.config_hand import RobocasaHandConfig
from robocasa_lerobot.devices.config_kitchen import RobocasaKitchenConfig
from robocasa_lerobot.devices.hand import RobocasaHand, _phone_step
from robocasa_lerobot.devices.kitchen import RobocasaKitchen, _check_rate
from robocasa_lerobot.devices.translation import NAMES, HandTranslator
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.scene.reset_noise import InitialNoise
from robocasa_lerobot.errors import UserError

STAY, CLOSE, OPEN = 1, 0, 2


@pytest.fixture(scope="module")
def robot() -> Iterator[RobocasaKitchen]:
    # Through LeRobot's own factory, which finds the class beside its configuration.
    made = make_robot_from_config(RobocasaKitchenConfig(seed=100_000, image_size=32, realtime=False))
    made.connect()
    yield made
    made.disconnect()


def deltas(x: float = 0, y: float = 0, z: float = 0, gripper: int = STAY) -> dict[str, float]:
    return {"delta_x": x, "delta_y": y, "delta_z": z, "gripper": gripper}


def phone(position: list[float], rotation: list[float] | None = None, enabled: bool = True) -> dict[str, float]:
    names = ("target_x", "target_y", "target_z", "target_wx", "target_wy", "target_wz")
    return {
        "enabled": enabled,
        "gripper_vel": 0.0,
        **dict(zip(names, [*position, *(rotation or [0, 0, 0])], strict=True)),
    }


def test_lerobot_knows_the_types() -> None:
    assert "robocasa_kitchen" in RobotConfig.get_known_choices()
    assert {"robocasa_hand", "robocasa_replay", "gamepad", "phone"} <= set(TeleoperatorConfig.get_known_choices())


@pytest.mark.render
def test_kitchens_of_demonstrations_start_as_those_did(tmp_path: Path) -> None:
    meta = {"seed": 5, "split": "target", "lang": "", "initial_noise": {"base_within_m": 1.0}}
    with h5py.File(tmp_path / "OpenDrawer.hdf5", "w") as file:
        file.create_group("data/demo_0").attrs["ep_meta"] = json.dumps(meta)
        file["data"].attrs["env"] = "OpenDrawer"
    env = KitchenEnv("OpenDrawer", cameras=(), initial_noise=InitialNoise(base_within_m=1.0))
    env.reset(seed=5)
    made = make_robot_from_config(RobocasaKitchenConfig(demos=tmp_path, image_size=32, realtime=False))
    made.connect()
    seen = made.get_observation()
    found = [seen[name] for name in contract.component_names(contract.STATE_PARTS)[:2]]
    np.testing.assert_allclose(found, base_pose(env.data)[0][:2], atol=1e-6)
    made.disconnect()
    env.close()


@pytest.mark.render
def test_observation_and_features_are_the_contract(robot: RobocasaKitchen) -> None:
    seen = robot.get_observation()
    assert list(seen) == list(robot.observation_features)
    for name, kind in robot.observation_features.items():
        assert seen[name].shape == kind if isinstance(kind, tuple) else isinstance(seen[name], float)
    assert tuple(robot.action_features) == NAMES == tuple(contract.dataset_features()["action"]["names"])
    assert robot.name == contract.ROBOT_TYPE


@pytest.mark.render
def test_a_gamepads_motion_moves_the_hand_forward(robot: RobocasaKitchen) -> None:
    before = robot.get_observation()
    for _ in range(8):
        sent = robot.send_action(deltas(x=0.5))
    after = robot.get_observation()
    assert sent["eef_dx"] == 0.5
    assert sent["control_mode"] == -1
    assert 0.02 < after["eef_x"] - before["eef_x"] < 0.25
    assert abs(after["eef_y"] - before["eef_y"]) < 0.02


@pytest.mark.render
def test_announcements_bring_the_kitchen_of_their_number(robot: RobocasaKitchen) -> None:
    def begin(*announcements: str) -> dict[str, object]:
        for text in announcements:
            logging.info(text)
        return robot.get_observation()

    logging.getLogger().setLevel(logging.INFO)
    robot._reset()
    first = robot.get_observation()
    assert begin(f"{BEGIN}0")["base_x"] == first["base_x"]  # nobody has touched it
    robot.send_action(dict.fromkeys(NAMES, 0.0))
    again = begin("Re-record episode", f"{BEGIN}0")
    assert all(np.array_equal(again[key], first[key]) for key in first)  # type: ignore[call-overload]
    robot.send_action(dict.fromkeys(NAMES, 0.0))
    second = begin(f"{BEGIN}1")
    assert second["base_x"] != first["base_x"]
    # A recording that is resumed goes on with the number of its next episode, before anybody has touched a kitchen.
    assert begin(f"{BEGIN}3")["base_x"] not in (first["base_x"], second["base_x"])
    assert begin(f"{BEGIN}1")["base_x"] == second["base_x"]


@pytest.mark.render
def test_all_episodes_are_in_the_first_kitchen_where_that_is_asked_for(
    robot: RobocasaKitchen, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(robot.config, "next_kitchen", False)
    logging.getLogger().setLevel(logging.INFO)
    robot._episode = 0
    robot._reset()
    first = robot.get_observation()
    for number in (0, 1, 4):
        logging.info(f"{BEGIN}{number}")
        begun = robot.get_observation()
        assert all(np.array_equal(begun[key], first[key]) for key in first)
        robot.send_action(dict.fromkeys(NAMES, 0.5))
        assert robot.get_observation()["eef_z"] != first["eef_z"]


@pytest.mark.render
def test_a_hurried_sender_gets_twenty_steps_a_second(robot: RobocasaKitchen) -> None:
    still = dict.fromkeys(NAMES, 0.0)
    robot.config.realtime = True
    robot.send_action(still)
    begun = time.monotonic()
    for _ in range(20):
        robot.send_action(still)
    robot.config.realtime = False
    assert time.monotonic() - begun > 0.9  # a busy machine takes longer, none less


def test_the_sentences_are_those_of_lerobot() -> None:
    source = inspect.getsource(lerobot_record.record)
    assert f'log_say(f"{BEGIN}{{dataset.num_episodes}}"' in source


def test_announcements_are_read_from_the_log_until_closed() -> None:
    heard: list[int] = []
    listener = Announcements(heard.append)
    listener.listen()
    logging.getLogger().setLevel(logging.INFO)
    for text in ("Reset the environment", f"{BEGIN}0", "Re-record episode", f"{BEGIN}0", f"{BEGIN}1", f"{BEGIN}now"):
        logging.info(text)
    listener.close()
    logging.info(f"{BEGIN}2")
    assert heard == [0, 0, 1]


def test_the_gripper_stays_as_it_was_told() -> None:
    translator = HandTranslator()
    told = [OPEN, STAY, CLOSE, STAY, STAY, OPEN, STAY]
    assert [translator.action(deltas(gripper=g))["gripper_close"] for g in told] == [-1, -1, 1, 1, 1, -1, -1]
    translator.action(deltas(gripper=CLOSE))
    assert translator.action({})["gripper_close"] == 1
    translator.reset()
    assert translator.action({})["gripper_close"] == -1


def test_speed_and_the_keyboards_own_axes() -> None:
    said = HandTranslator(speed=0.5, keyboard_axes=True).action(deltas(x=1, y=-1, z=3))
    assert (said["eef_dx"], said["eef_dy"], said["eef_dz"]) == (0.5, 0.5, 1.0)  # up key: forward; left key: left


def test_a_phone_moves_the_hand_by_what_it_moved_while_held() -> None:
    translator = HandTranslator()
    turn = Rotation.from_rotvec([0, 0, -0.1]).as_rotvec().tolist()
    assert translator.action(phone([0.5, 0, 0]))["eef_dx"] == 0  # the first pose is the reference
    moved = translator.action(phone([0.52, 0, -0.01], turn))
    np.testing.assert_allclose([moved["eef_dx"], moved["eef_dz"], moved["eef_rz"]], [0.4, -0.2, 0.2], atol=1e-9)
    assert translator.action(phone([0.72, 0, 0], turn))["eef_dx"] == 0  # a jump: tracking was lost
    assert translator.action(phone([0.9, 0, 0], enabled=False))["eef_dx"] == 0
    assert translator.action(phone([0.95, 0, 0]))["eef_dx"] == 0  # held again: a new reference


def test_a_phone_leads_by_its_goal_until_it_is_let_go() -> None:
    translator = HandTranslator()
    said = [translator.action(phone([x, 0, 0], enabled=on)) for x, on in ((0.0, True), (0.02, True), (0.04, False))]
    assert [action["control_mode"] for action in said] == [-1, 1, -1]


@pytest.mark.render
def test_the_hand_goes_as_far_as_the_phone_did(robot: RobocasaKitchen) -> None:
    robot._reset()
    before = robot.get_observation()
    for step in range(36):  # 10 cm up in a second, then held there
        robot.send_action(phone([0.0, 0.0, min(step, 20) * 0.005]))
    after = robot.get_observation()
    moved = [after[name] - before[name] for name in ("eef_x", "eef_y", "eef_z")]
    np.testing.assert_allclose(moved, [0.0, 0.0, 0.1], atol=0.01)


class Pad:
    """Stands in for a gamepad's driver: what LeRobot's own device asks of it."""

    deltas, grip = (0.0, 0.0, 0.0), "stay"

    def update(self) -> None: ...

    def get_deltas(self) -> tuple[float, float, float]:
        return self.deltas

    def gripper_command(self) -> str:
        return self.grip


def test_lerobots_gamepad_leads_the_hand() -> None:
    hand = make_teleoperator_from_config(RobocasaHandConfig(speed=0.5))
    assert isinstance(hand, RobocasaHand)
    hand.device.gamepad = pad = Pad()
    pad.deltas, pad.grip = (1.0, -0.5, 0.0), "close"
    said = hand.get_action()
    assert list(said) == list(NAMES) == list(hand.action_features)
    assert (said["eef_dx"], said["eef_dy"], said["gripper_close"], said["control_mode"]) == (0.5, -0.25, 1, -1)
    assert not hand.device.config.hidapi_fallback
    other = make_teleoperator_from_config(RobocasaHandConfig(hidapi_fallback=True))
    assert isinstance(other, RobocasaHand)
    assert other.device.config.hidapi_fallback


class Key(enum.Enum):
    """Stands in for the keys of pynput, which needs a display."""

    up, down, left, right, shift, shift_r, ctrl_l, ctrl_r, esc = range(9)


class Listener:
    """Stands in for pynput's listener."""

    def is_alive(self) -> bool:
        return True


def test_keys_that_are_let_go_say_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """On LeRobot's own keyboard, into which its events are put by hand."""
    monkeypatch.setattr(teleop_keyboard, "PYNPUT_AVAILABLE", True)
    monkeypatch.setattr(teleop_keyboard, "keyboard", SimpleNamespace(Key=Key, Listener=Listener))
    monkeypatch.setattr(teleop_keyboard, "require_package", lambda *_, **__: None)
    hand = RobocasaHand(RobocasaHandConfig(device="keyboard_ee"))
    hand.device.listener = Listener()

    def tap(key: Key) -> tuple[float, float]:
        """Forward and gripper while the key is down; then it is let go, and a step passes."""
        hand.device._on_press(key)
        said = hand.get_action()
        hand.device._on_release(key)
        hand.get_action()
        return said["eef_dx"], said["gripper_close"]

    assert [tap(key)[0] for key in (Key.up, Key.down, Key.up, Key.down)] == [1, -1, 1, -1]
    assert [tap(key)[1] for key in (Key.ctrl_l, Key.ctrl_r, Key.ctrl_l, Key.ctrl_r)] == [1, -1, 1, -1]
    tap(Key.ctrl_l)
    hand._translator.reset()  # a new episode: the hand is open
    assert hand.get_action()["gripper_close"] == -1


@pytest.mark.parametrize("system", PhoneOS)
def test_a_phone_is_read_as_lerobot_reads_it(system: PhoneOS) -> None:
    """Each kind has its own buttons for the gripper."""
    config = RobocasaHandConfig(device="phone", phone_os=system)
    assert config.of_device() == PhoneConfig(phone_os=system)
    step, translator = _phone_step(config), HandTranslator()

    def said(x: float, button: str = "") -> dict[str, float]:
        inputs = {"reservedButtonA": button == "A", "reservedButtonB": button == "B"}
        if system is PhoneOS.IOS:
            inputs = {"a3": {"": 0.0, "A": 1.0, "B": -1.0}[button], "reservedButtonA": button == "B"}
        pose = {"phone.pos": np.array([0.0, -x, 0.0]), "phone.rot": Rotation.identity()}
        return translator.action(step.action({**pose, "phone.raw_inputs": inputs, "phone.enabled": True}))

    said(0.0)
    assert said(0.02, "B")["eef_dx"] == pytest.approx(0.4)
    assert [said(0.02)["gripper_close"], said(0.02, "A")["gripper_close"]] == [1, -1]


@pytest.mark.parametrize("axis", range(3))
def test_a_phone_turns_the_hand_as_it_is_turned(axis: int) -> None:
    """About the base's forward, left and up: a phone's own first axis is the base's right, its second the front."""
    step, translator = _phone_step(RobocasaHandConfig(device="phone")), HandTranslator()
    turn = 0.2 * np.eye(3)[axis]
    of_phone = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]).T

    def said(moved: np.ndarray, turned: np.ndarray) -> list[float]:
        pose = {"phone.pos": of_phone @ moved, "phone.rot": Rotation.from_rotvec(of_phone @ turned)}
        action = translator.action(step.action({**pose, "phone.raw_inputs": {}, "phone.enabled": True}))
        return [action[name] for name in ("eef_dx", "eef_dy", "eef_dz", "eef_rx", "eef_ry", "eef_rz")]

    said(np.zeros(3), np.zeros(3))
    np.testing.assert_allclose(said(turn / 10, turn), [*turn * 2, *turn / 0.5], atol=1e-9)


def test_mistakes_are_explained() -> None:
    with pytest.raises(UserError, match=r"shoulder\.pos.*robocasa_hand"):
        HandTranslator().action({"shoulder.pos": 1.0})
    with pytest.raises(UserError, match="gamepad"):
        RobocasaHandConfig(device="gamepd")
    with pytest.raises(UserError, match="speed"):
        RobocasaHandConfig(speed=0)
    with pytest.raises(UserError, match=r"--dataset\.fps=20"):
        _check_rate(["lerobot-record", "--dataset.repo_id=a/b"])
    with pytest.raises(UserError, match="found 30"):
        _check_rate(["lerobot-record", "--dataset.repo_id=a/b", "--dataset.fps", "30"])
    _check_rate(["lerobot-record", "--dataset.repo_id=a/b", "--dataset.fps=20"])
    _check_rate(["lerobot-record", "--config_path=record.yaml", "--dataset.repo_id=a/b"])
    _check_rate(["lerobot-teleoperate"])
