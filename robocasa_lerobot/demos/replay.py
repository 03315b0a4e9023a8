"""Do recorded demonstrations replay? Their actions open loop from the first state, and their states one by one.

The kitchen is made again from the task, split and seed in the file (and the layouts and styles it was restricted to).
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot import contract
from robocasa_lerobot.demos.recorder import SUCCESS_HOLD_STEPS
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.predicates import parts_with_memory
from robocasa_lerobot.envs.scene.reset_noise import InitialNoise
from robocasa_lerobot.envs.tasks.task import Task
from robocasa_lerobot.errors import LackingMachineError, UserError
from robocasa_lerobot.hdf5_files import hdf5_files_of
from robocasa_lerobot.jobs.as_completed import as_they_end

Array = NDArray[np.float64]
_CHOICES = ("layouts", "styles", "initial_noise")  # in `ep_meta`: what kitchens were restricted to, or moved by
_NUMBERED = re.compile(r"demo_(\d+)")


@dataclass(frozen=True)
class Replayed:
    """What came of one demonstration.

    Attributes:
        path: the file.
        demo: its name in the file.
        task: name; empty where that cannot be read.
        actions: whether the goal held for as long as a recording asks for, when the actions were carried out.
        states: whether the goal holds in the last recorded state; where it has memory, as the recorded terms say too.
        same_start: whether the kitchen's own first state is the recorded one, bit for bit.
        deviation: largest difference of a joint position between the recorded states and those passed through;
            infinite where they are of another kitchen than is made now, or of none.
        note: what went wrong, or "".
    """

    path: Path
    demo: str
    task: str
    actions: bool
    states: bool
    same_start: bool
    deviation: float
    note: str = ""


@dataclass(frozen=True)
class Kitchen:
    """What a demonstration's kitchen is made from.

    Attributes:
        task: name.
        meta: the demonstration's `ep_meta`.
    """

    task: str
    meta: dict[str, Any]

    @property
    def seed(self) -> int:
        """Of the kitchen."""
        return int(self.meta["seed"])

    @property
    def split(self) -> str:
        """Of the kitchen."""
        return str(self.meta["split"])

    @property
    def kind(self) -> str:
        """The same for kitchens that one env makes, each from its own seed."""
        return json.dumps([self.task, self.split, *(self.meta.get(key) for key in _CHOICES)], sort_keys=True)

    @property
    def instruction(self) -> str:
        """What was to be done."""
        return str(self.meta["lang"])


@dataclass(frozen=True)
class Demonstration(Kitchen):
    """What a file holds of a demonstration of T steps.

    Attributes:
        states: (T, 1 + nq + nv) time, positions, velocities.
        actions: (T, 12) in stored order.
        last_terms: whether each of the goal's terms held in the last state, by name; empty where that is not recorded.
        stage: (T,) number of the stage of each step; None where that is not recorded.
    """

    states: Array
    actions: Array
    last_terms: dict[str, bool] = field(default_factory=dict)
    stage: NDArray[np.int64] | None = None


def demonstrations(paths: Iterable[Path]) -> list[tuple[Path, str]]:
    """Files and names of all demonstrations in files and folders, in order, each once however often it was given.

    Raises:
        UserError: there are none.
    """
    found: list[tuple[Path, str]] = []
    seen: set[Path] = set()
    for path in paths:
        for file in hdf5_files_of(path):
            if file.resolve() in seen:
                continue
            seen.add(file.resolve())
            if not file.is_file():
                raise UserError(f"{file}: no such file or folder; `robocasa-lerobot demos` records demonstrations.")
            try:
                with h5py.File(file) as opened:
                    numbers = {name: _NUMBERED.fullmatch(name) for name in opened.get("data", ())}
            except OSError as error:
                raise UserError(f"{file} is no HDF5 file ({error}).") from error
            numbered = sorted((int(match[1]), name) for name, match in numbers.items() if match)
            found += [(file, name) for _, name in numbered]
    if not found:
        raise UserError("no demonstrations: give files or folders that `robocasa-lerobot demos` wrote.")
    return found


def replay_all(chosen: Sequence[tuple[Path, str]], workers: int = 1) -> Iterator[Replayed]:
    """Replay demonstrations, in several processes, as they end; of those that cannot be, a note says why."""
    yield from as_they_end(_replay_or_note, chosen, workers)


def _replay_or_note(path: Path, demo: str) -> Replayed:
    try:
        return replay(path, demo)
    except LackingMachineError:
        raise
    except UserError as error:  # one file of other software must not cost what came of the rest
        return Replayed(path, demo, "", False, False, False, np.inf, str(error))


def read_kitchen(path: Path, demo: str) -> Kitchen:
    """The kitchen of a demonstration that `demos` recorded.

    Raises:
        UserError: other software recorded it.
    """
    with h5py.File(path) as file:
        return _kitchen_in(file, demo)


def _kitchen_in(file: h5py.File, demo: str) -> Kitchen:
    task = file["data"].attrs.get("env")
    meta = json.loads(file[f"data/{demo}"].attrs.get("ep_meta", "{}"))
    if task is None or not isinstance(meta, dict) or not {"seed", "split"} <= meta.keys():
        raise UserError(
            f"{file.filename}, {demo}: its ep_meta has no scene seed and split; it was recorded by other software."
        )
    return Kitchen(str(task), meta)


def read_demonstration(path: Path, demo: str) -> Demonstration:
    """A demonstration that `demos` recorded.

    Raises:
        UserError: other software recorded it.
    """
    with h5py.File(path) as file:
        kitchen = _kitchen_in(file, demo)
        group = file[f"data/{demo}"]
        states, actions = group["states"][()], contract.hdf5_to_stored(group["actions"][()])
        terms = _last_terms(group)
        stage = np.asarray(group["stage"][()], dtype=np.int64) if "stage" in group else None
    return Demonstration(kitchen.task, kitchen.meta, states, actions, terms, stage)


def _last_terms(group: h5py.Group) -> dict[str, bool]:
    recorded = group.get("success_terms")
    if recorded is None or "names" not in recorded.attrs:
        return {}
    return dict(zip(json.loads(recorded.attrs["names"]), recorded[-1].astype(bool).tolist(), strict=True))


def replay(path: Path, demo: str, declaration: Task | None = None) -> Replayed:
    """Replay one demonstration, its states and its actions; of a task that is in the making, its declaration is given.

    Raises:
        UserError: its kitchen cannot be made again.
    """
    recorded = read_demonstration(path, demo)
    task, states = recorded.task, recorded.states
    env = kitchen_of(recorded, declaration)
    try:
        env.reset(seed=recorded.seed)
        if note := made_otherwise(env, states):
            return Replayed(path, demo, task, False, False, False, np.inf, note)
        same = bool(np.array_equal(_state(env), states[0]))
        final, note = _goal_held_at_the_end(env, recorded)
        done, deviation = _carry_out(env, states, recorded.actions)
    finally:
        env.close()
    return Replayed(path, demo, task, done, final, same, deviation, note)


def made_otherwise(env: KitchenEnv, states: Array) -> str:
    """Why recorded states (T, N) are not of the kitchen that an env has made of their seed; empty where they may be."""
    size = 1 + env.model.nq + env.model.nv
    if states.shape[1] == size:
        return ""
    return f"{states.shape[1]} numbers in a state, {size} in the kitchen as it is made now"


def kitchen_of(kitchen: Kitchen, declaration: Task | None = None, **drawn: Any) -> KitchenEnv:
    """An env that makes the kitchen of a demonstration when it is reset with its seed.

    It has no cameras, unless `drawn` says how it is drawn, as KitchenEnv takes it.
    """
    noise = kitchen.meta.get("initial_noise")
    return KitchenEnv(
        declaration or kitchen.task,
        split=kitchen.split,
        terminate_on_success=False,
        layouts=kitchen.meta.get("layouts"),
        styles=kitchen.meta.get("styles"),
        initial_noise=InitialNoise(**noise) if noise else None,
        **(drawn or {"cameras": ()}),
    )


def _carry_out(env: KitchenEnv, states: Array, actions: Array) -> tuple[bool, float]:
    """Whether the actions reach the goal and keep it, from the recorded first state, and the largest deviation."""
    put_state(env, env.data, states[0])
    held, deviation = 0, 0.0
    for state, action in zip(states, actions, strict=True):
        deviation = max(deviation, float(np.abs(env.data.qpos - state[1 : 1 + env.model.nq]).max()))
        _, reward, _, _, _ = env.step(action.astype(np.float32))
        held = held + 1 if reward > 0 else 0
    return held >= SUCCESS_HOLD_STEPS, deviation


def _goal_held_at_the_end(env: KitchenEnv, recorded: Demonstration) -> tuple[bool, str]:
    """Whether the goal holds in the last recorded state, set into a simulation of its own.

    What has no velocity at all in it slept, and counts as touching what slept beside it as it did then: nearly.

    What a goal remembers is in the state, as positions of joints that only the recording vouches for: nothing in the
    state itself shows how it came about. The terms that were recorded at the time must say the same.
    """
    data = mujoco.MjData(env.model)
    put_state(env, data, recorded.states[-1])
    _put_to_sleep(env.model, data)
    found: dict[str, bool] = {}
    holds = bool(env.declaration.goal.evaluate(env.scene, data, found))
    # Of one that reads another, as of steps in which something moves, the outer alone is a term of the goal.
    for name in sorted(found.keys() & {part.name for part in parts_with_memory([env.declaration.goal])}):
        then, now = recorded.last_terms.get(name), found[name]
        if recorded.last_terms and then != now:
            said = "was not recorded" if then is None else f"was recorded as {then}"
            return False, f"`{name}` is {now} in the last state, but {said}"
    return holds, ""


def _put_to_sleep(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Mark what has no velocity as asleep, each tree by itself, for predicates to read."""
    for tree, (first, count) in enumerate(zip(model.tree_dofadr, model.tree_dofnum, strict=True)):
        if not data.qvel[first : first + count].any():
            data.tree_asleep[tree] = tree


def put_state(env: KitchenEnv, data: mujoco.MjData, state: Array) -> None:
    """Write a recorded state, unless it is there already: variables that are not in it (latches, sleep) then stay."""
    model = env.model
    wanted = state[1 : 1 + model.nq], state[1 + model.nq :]
    if np.array_equal(data.qpos, wanted[0]) and np.array_equal(data.qvel, wanted[1]):
        return
    data.time, data.qpos[:], data.qvel[:] = state[0], *wanted
    mujoco.mj_forward(model, data)


def _state(env: KitchenEnv) -> Array:
    return np.concatenate([[env.data.time], env.data.qpos, env.data.qvel])
