"""Appliances that would do nothing again are not asked: the same bits as when all are asked in every step."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from demonstration_steps import demonstrated_commands
from numpy.typing import NDArray
from task_selection import every_task

from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.kitchens.appliances.acting import ActingAppliances
from robocasa_lerobot.envs.kitchens.appliances.base import Appliance

Commands = list[NDArray[np.float32]]


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the appliances that were asked, in order."""
    names: list[str] = []
    plain = Appliance.update

    def update(self: Appliance, *given: Any) -> bool:
        names.append(self.name)
        return plain(self, *given)

    monkeypatch.setattr(Appliance, "update", update)
    return names


def states(task: str, commands: Commands) -> list[bytes]:
    env = KitchenEnv(task, cameras=(), horizon=10**6, terminate_on_success=False)
    env.reset(seed=4)
    found = []
    for command in commands:
        _, _, _, _, info = env.step(command)
        data = env.data
        arrays = (data.qpos, data.qvel, data.userdata, data.eq_active, data.tree_asleep)
        found.append(b"".join(array.tobytes() for array in arrays) + repr(info).encode())
    return found


def assert_same_as_all_asked(task: str, commands: Commands, asked: list[str]) -> None:
    found = states(task, commands)
    few = len(asked)
    act = ActingAppliances.act

    def always(self: ActingAppliances, *given: Any) -> None:
        self._idle = None
        act(self, *given)

    asked.clear()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ActingAppliances, "act", always)
        assert states(task, commands) == found
    assert few < len(asked), "all were asked all the time, so nothing is compared"


@pytest.mark.parametrize("task", every_task())
def test_random_motion_is_the_same(task: str, asked: list[str]) -> None:
    rng = np.random.default_rng(6)
    assert_same_as_all_asked(task, list(rng.uniform(-1, 1, (40, 12)).astype(np.float32)), asked)


@pytest.mark.parametrize("task", ["TurnOnMicrowave", "TurnOnStove", "TurnOnSinkFaucet"])
def test_a_demonstration_at_an_appliance_is_the_same(task: str, asked: list[str]) -> None:
    env = KitchenEnv(task, cameras=())
    env.reset(seed=4)
    commands = list(demonstrated_commands(env))
    asked.clear()
    assert_same_as_all_asked(task, commands, asked)


def test_they_are_asked_when_something_of_theirs_has_changed(asked: list[str]) -> None:
    env = KitchenEnv("TurnOnMicrowave", cameras=(), terminate_on_success=False)
    env.reset(seed=0)
    hold = np.zeros(12, np.float32)
    for _ in range(30):
        env.step(hold)
    asked.clear()
    env.step(hold)
    assert not asked
    microwave = env.scene.fixture("microwave", Appliance)
    changes = {
        "a joint": lambda: microwave.set_share(env.data, "door", 0.4),
        "memory": lambda: env.data.userdata.__setitem__(0, env.data.userdata[0] + 5),
        "a catch": lambda: env.data.eq_active.__setitem__(0, 1 - env.data.eq_active[0]),
    }
    for what, change in changes.items():
        change()
        env.scene.update_appliances(env.data)
        assert microwave.name in asked, what
        for _ in range(30):
            env.step(hold)
        asked.clear()


def test_a_lamp_follows_at_once_and_again_after_a_reset() -> None:
    """What was seen idle in one state says nothing about another."""
    env = KitchenEnv("TurnOnMicrowave", cameras=(), terminate_on_success=False)
    env.reset(seed=0)
    hold = np.zeros(12, np.float32)
    env.step(hold)
    microwave = env.scene.fixture("microwave", Appliance)
    for _ in range(2):
        microwave.set_on(env.data, True)
        microwave.set_share(env.data, "door", 1.0)
        env.step(hold)
        assert not microwave.lit(env.data, "power"), "off while the door is open"
        env.reset(seed=0)
        env.step(hold)
