"""Latches, timers and lights of appliances in a running kitchen: carried by states, and told by joint positions."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.kitchens.appliances.base import Appliance, take_effect

STILL = np.zeros(12, dtype=np.float32)


@pytest.fixture(scope="module")
def env():
    env = KitchenEnv("OpenDrawer", cameras=(), render_mode=None, horizon=100_000)
    env.reset(seed=0)
    yield env
    env.close()


def appliances(env):
    found = {}
    for fixture in env.scene.fixtures.values():
        if isinstance(fixture, Appliance):
            found.setdefault(fixture.record.category, fixture)
    return found


def test_a_kitchen_starts_with_everything_off_and_shut(env):
    env.reset(seed=0)
    found = appliances(env)
    assert {"microwave", "sink", "toaster", "coffee_machine"} <= set(found)
    for it in found.values():
        state = it.state(env.data)
        assert not any(state.get(key, False) for key in ("on", "on0", "on1", "water_on")), it.name
        assert it.is_closed(env.data), it.name


def test_a_timer_goes_on_from_a_state_bit_for_bit(env):
    env.reset(seed=0)
    it = appliances(env)["toaster"]
    it.set_share(env.data, "lever0", 1.0)
    take_effect(env.model, env.data)
    for _ in range(5):
        env.step(STILL)
    assert it.state(env.data)["on0"]
    middle = env.get_state()
    ends = []
    for _ in range(2):
        steps = 0
        while it.state(env.data)["on0"]:
            env.step(STILL)
            steps += 1
        for _ in range(10):
            env.step(STILL)
        ends.append((steps, env.get_state().physics, it.state(env.data)))
        env.set_state(middle)
        assert it.state(env.data)["on0"]
    assert ends[0][0] == ends[1][0] == 496
    assert np.array_equal(ends[0][1], ends[1][1])
    assert ends[0][2] == ends[1][2]
    assert ends[0][2]["lever0"] < 0.1


def test_another_env_takes_latches_over(env):
    env.reset(seed=0)
    found = appliances(env)
    found["microwave"].set_on(env.data, True)
    found["coffee_machine"].set_on(env.data, True)
    found["sink"].set_water(env.data, True)
    take_effect(env.model, env.data)
    env.step(STILL)
    state = env.get_state()
    other = KitchenEnv("OpenDrawer", cameras=(), render_mode=None)
    try:
        other.set_state(state)
        for category in ("microwave", "coffee_machine", "sink"):
            name = found[category].name
            assert other.scene.fixtures[name].state(other.data) == found[category].state(env.data)
        assert other.scene.fixtures[found["microwave"].name].state(other.data)["on"]
        other.step(STILL)
        env.step(STILL)
        assert np.array_equal(other.get_state().physics, env.get_state().physics)
    finally:
        other.close()
    # A reset to the same seed forgets them.
    env.reset(seed=0)
    assert not found["microwave"].state(env.data)["on"]
    assert not found["sink"].state(env.data)["water_on"]


def test_recorded_joint_positions_show_what_is_on(env):
    """As the converter renders: the model's XML and `[time, qpos, qvel]`, nothing else."""
    env.reset(seed=0)
    found = appliances(env)
    off = env.data.qpos.copy()
    found["microwave"].set_on(env.data, True)
    found["sink"].set_water(env.data, True)
    take_effect(env.model, env.data)
    env.step(STILL)
    model = mujoco.MjModel.from_xml_string(env.scene.spec.to_xml(), dict(env.scene.spec.assets))
    shown = {}
    for name, qpos in (("off", off), ("on", env.data.qpos)):
        data = mujoco.MjData(model)
        data.qpos[:] = qpos
        mujoco.mj_forward(model, data)
        sink, microwave = found["sink"].name, found["microwave"].name
        shown[name] = {
            "water": data.body(f"{sink}_water_cold_low").xpos[2] > 0.5,
            "lamp": float(data.joint(f"{microwave}_power_joint").qpos[0]) > 0.005,
        }
    assert shown == {"off": {"water": False, "lamp": False}, "on": {"water": True, "lamp": True}}
