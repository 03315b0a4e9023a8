"""Bodies out of reach are left out of the search for contacts: the same states, contacts and models, bit for bit."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import mujoco
import numpy as np
import pytest
from demonstration_steps import demonstrated_commands
from numpy.typing import NDArray
from task_selection import demonstrated, every_task

from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.physics.nearby import Nearby
from robocasa_lerobot.envs.robots.panda_omron.control import kernel

TASK = "PickPlaceCounterToSink"
Rows = list[bytes]
Meddle = Callable[[KitchenEnv, int], None]


@contextmanager
def all_looked_at() -> Iterator[None]:
    """MuJoCo's own search, with nothing left out."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Nearby, "leave_out", lambda self: None)
        yield


@contextmanager
def counted() -> Iterator[list[int]]:
    """How many bodies were left out in each control step."""
    left_out: list[int] = []
    plain = Nearby.leave_out

    def count(self: Nearby) -> None:
        plain(self)
        left_out.append(int(((self.watch.contype != 0) & (self.watch.contype_now == 0)).sum()))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Nearby, "leave_out", count)
        yield left_out


def actions(count: int, seed: int) -> list[NDArray[np.float32]]:
    rng = np.random.default_rng(seed)
    ways = np.repeat(rng.uniform(-1, 1, (count // 25 + 1, 12)), 25, axis=0)[:count]
    return list(np.clip(ways + 0.3 * rng.normal(size=(count, 12)), -1, 1).astype(np.float32))


def row(env: KitchenEnv) -> bytes:
    """Everything that depends on contacts, and the contacts themselves."""
    data = env.data
    contacts = [getattr(data.contact, name)[: data.ncon] for name in ("geom", "dist", "pos", "frame")]
    arrays = (data.qpos, data.qvel, data.qacc_warmstart, data.tree_asleep, data.xpos, *contacts)
    return b"".join(np.ascontiguousarray(array).tobytes() for array in arrays)


def run(task: str, seed: int, commands: list[NDArray[np.float32]], meddle: Meddle | None = None) -> Rows:
    env = KitchenEnv(task, cameras=(), horizon=10**6, terminate_on_success=False)
    env.reset(seed=seed)
    masks = env.model.body_contype.copy(), env.model.body_conaffinity.copy()
    rows = []
    for number, command in enumerate(commands):
        if meddle is not None:
            meddle(env, number)
        env.step(command)
        rows.append(row(env))
        assert np.array_equal(env.model.body_contype, masks[0])
        assert np.array_equal(env.model.body_conaffinity, masks[1])
    return rows


def assert_same_as_with_all(task: str, seed: int, steps: int = 60, meddle: Meddle | None = None) -> None:
    commands = actions(steps, seed)
    with counted() as left_out:
        rows = run(task, seed, commands, meddle)
    assert min(left_out[5:]) > 20, "hardly anything was left out, so nothing is compared"
    with all_looked_at():
        expected = run(task, seed, commands, meddle)
    differing = [number for number, (a, b) in enumerate(zip(rows, expected, strict=True)) if a != b]
    assert not differing, f"{task}, seed {seed}: other bits from step {differing[0]} on"


@pytest.mark.costly
@pytest.mark.parametrize("task", every_task())
def test_random_motion_is_the_same(task: str) -> None:
    assert_same_as_with_all(task, seed=2)


@pytest.mark.parametrize("task", demonstrated(fast=("CloseDrawer",)))
def test_demonstrations_are_the_same(task: str) -> None:
    """In grasps, with doors and drawers in motion, while things fall asleep and wake."""
    env = KitchenEnv(task, cameras=())
    env.reset(seed=1)
    commands = list(demonstrated_commands(env))
    rows = run(task, 1, commands)
    with all_looked_at():
        assert rows == run(task, 1, commands)


def object_joint(env: KitchenEnv) -> int:
    """Where the first object of the scene stands in `qpos`."""
    return int(env.model.joint(f"{next(iter(env.scene.objects))}_joint0").qposadr[0])


def lift(env: KitchenEnv, number: int) -> None:
    """Take a sleeping object and drop it over another counter, without evaluating anything."""
    if number == 20:
        at = object_joint(env)
        env.data.qpos[at : at + 3] = [*env.model.stat.center[:2], 1.4]


def throw(env: KitchenEnv, number: int) -> None:
    """Throw an object faster than anything may move while others are left out: 12 cm in a physics step."""
    if number in (10, 30):
        joint = env.model.joint(f"{next(iter(env.scene.objects))}_joint0")
        env.data.qvel[joint.dofadr[0] : joint.dofadr[0] + 3] = (60.0, 0.0, 5.0) if number == 10 else (0.0, 60.0, 5.0)


def pull(env: KitchenEnv, number: int) -> None:
    """Pull at a sleeping object."""
    if number >= 20:
        env.data.xfrc_applied[env.model.body(next(iter(env.scene.objects))).id, :3] = (2.0, -1.0, 6.0)


def teleport(env: KitchenEnv, number: int) -> None:
    """Put the robot elsewhere in the room, with everything awake evaluated as a user would."""
    if number == 30:
        env.robot.place_base(env.model, env.data, *env.model.stat.center[:2], 1.0)


@pytest.mark.costly
@pytest.mark.parametrize("meddle", [lift, throw, pull, teleport])
@pytest.mark.parametrize("seed", [0, 3])
def test_what_a_user_writes_is_the_same(meddle: Meddle, seed: int) -> None:
    assert_same_as_with_all(TASK, seed, steps=60, meddle=meddle)


def test_after_an_interruption_all_is_looked_at_again() -> None:
    """Ctrl-C just before the compiled steps: the next control step would take the zero masks for the model's own."""
    env = KitchenEnv(TASK, cameras=())
    env.reset(seed=0)
    model, masks = env.model, (env.model.body_contype.copy(), env.model.body_conaffinity.copy())

    def interrupt(*_: object) -> None:
        assert not np.array_equal(model.body_contype, masks[0])
        raise KeyboardInterrupt

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(kernel, "run", interrupt)
        with pytest.raises(KeyboardInterrupt):
            env.step(np.zeros(12, np.float32))
    assert np.array_equal(model.body_contype, masks[0])
    assert np.array_equal(model.body_conaffinity, masks[1])


def test_nothing_is_left_out_where_more_can_move() -> None:
    """A body that is moved by hand, or a tree that wakes with another, could come near without notice."""
    for extra in (
        '<body name="hand" mocap="true"><geom size="0.1"/></body>',
        "",
    ):
        model = mujoco.MjModel.from_xml_string(
            f"""<mujoco><option><flag sleep="enable"/></option><worldbody>{extra}
            <body><joint/><geom size="0.1"/></body>
            <body pos="5 0 0"><geom size="0.1"/></body></worldbody></mujoco>"""
        )
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        nearby = Nearby(model, data)
        nearby.leave_out()
        assert bool(nearby.watch.n_watched[0]) is not bool(extra)
        assert bool((model.body_contype[1:] == 0).any()) is not bool(extra)
        nearby.look_at_all()
        assert (model.body_contype[1:] == 1).all()
