"""Preparing: replay a demonstration's actions and write down what generation needs to know of every step.

The file is replaced by one that has `datagen_info` beside each demonstration that replays; all that was recorded stays
as it was. Each demonstration leaves a small file of its own meanwhile, so that a killed run goes on where it was.
"""

from __future__ import annotations

import contextlib
import json
import shutil
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from robocasa_lerobot.demos.generate.sources.frames import HANDLE, Part, body_pose, parts_of, possible_parts
from robocasa_lerobot.demos.generate.sources.prepared import GROUP, Prepared, is_prepared, world_pose, write_prepared
from robocasa_lerobot.demos.generate.sources.segments import cut, signals_of
from robocasa_lerobot.demos.generate.sources.transform import inverse, make_pose, yaw_pose
from robocasa_lerobot.demos.generate.sources.uses import is_about_itself, is_use, use_frame, use_key, working_point
from robocasa_lerobot.demos.hdf5 import versions
from robocasa_lerobot.demos.motion import Array, base_pose, grip_position, hand_rotation
from robocasa_lerobot.demos.recorder import SUCCESS_HOLD_STEPS
from robocasa_lerobot.demos.replay import (
    Demonstration,
    demonstrations,
    kitchen_of,
    made_otherwise,
    put_state,
    read_demonstration,
)
from robocasa_lerobot.demos.skills.pick_place.graspable import Graspable, graspable
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.tasks.task import Stage
from robocasa_lerobot.errors import OF_THE_MACHINE, UserError
from robocasa_lerobot.files import write_text
from robocasa_lerobot.hdf5_files import changed_hdf5, new_hdf5
from robocasa_lerobot.jobs.as_completed import as_they_end
from robocasa_lerobot.jobs.publish import held_lock

DROPPED = "datagen_dropped"  # attribute of `data`: demonstrations that do not replay, and why
FILE = "file.json"  # in the folder of what is being prepared: which file that is of
_STAGE_WORDS = ("skill", "verb", "target", "object", "part", "to")


@dataclass(frozen=True)
class Outcome:
    """What came of preparing a demonstration: `dropped` says why it is no source, or is empty."""

    path: Path
    demo: str
    dropped: str = ""


def prepare_files(paths: Iterable[Path], *, workers: int = 1, fresh: bool = False) -> Iterator[Outcome]:
    """Prepare all demonstrations of files and folders; files are replaced one by one, as they are complete.

    Args:
        paths: files that `demos` or `teleop` wrote, or folders of them.
        workers: processes.
        fresh: prepare again what is prepared already.

    Raises:
        UserError: there are no demonstrations, or one was recorded by other software.
    """
    by_file: dict[Path, list[str]] = {}
    for path, demo in demonstrations(paths):
        by_file.setdefault(path, []).append(demo)
    with contextlib.ExitStack() as locks:
        begun: dict[Path, _Begun] = {}
        for path, demos in by_file.items():
            known = {} if fresh else known_outcomes(path)
            if all(demo in known for demo in demos):
                _clear_left(path)
                yield from known.values()
            else:
                begun[path] = _begin(path, demos, locks, fresh=fresh)
        jobs = [(path, demo, one.folder) for path, one in begun.items() for demo in one.demos]
        for outcome in as_they_end(prepare_one, jobs, workers):
            yield outcome
            begun[outcome.path].end(outcome.demo)


@dataclass
class _Begun:
    """A file that is being prepared.

    Attributes:
        path, demos: it, and its demonstrations.
        folder: of what has been found out of them.
        lock: that is held meanwhile.
        left: demonstrations that have not ended.
    """

    path: Path
    demos: list[str]
    folder: Path
    lock: contextlib.ExitStack
    left: set[str]

    def end(self, demo: str) -> None:
        """Note that a demonstration has ended; with the last one replace the file, and let others at it."""
        self.left.remove(demo)
        if not self.left:
            _publish(self.path, self.demos, self.folder)
            shutil.rmtree(self.folder)
            self.lock.close()


def _clear_left(path: Path) -> None:
    """Remove what a run left that was killed when it had replaced a file."""
    folder = _folder_of(path)
    if folder.exists():
        with contextlib.suppress(UserError), held_lock(_lock_of(path)):  # held: another one prepares it afresh
            shutil.rmtree(folder, ignore_errors=True)


def _folder_of(path: Path) -> Path:
    return path.with_name(f".{path.stem}.prepare")


def _lock_of(path: Path) -> Path:
    return path.with_name(f".{path.stem}.prepare.lock")


def _begin(path: Path, demos: list[str], locks: contextlib.ExitStack, *, fresh: bool) -> _Begun:
    lock = locks.enter_context(contextlib.ExitStack())
    lock.enter_context(held_lock(_lock_of(path)))
    folder = _folder_of(path)
    note, identity = folder / FILE, work_identity(path)
    # What a killed run left may be of another recording that had the file's name then.
    if folder.exists() and (fresh or not note.exists() or json.loads(note.read_text()) != identity):
        shutil.rmtree(folder)
    folder.mkdir(exist_ok=True)
    write_text(note, json.dumps(identity))
    return _Begun(path, demos, folder, lock, set(demos))


def file_identity(path: Path) -> dict[str, int]:
    """What tells a file from another that had its place."""
    status = path.stat()
    return {"size": status.st_size, "modified_ns": status.st_mtime_ns}


def work_identity(path: Path) -> dict[str, Any]:
    """The same, and what tells what is found out of it from what other software would find."""
    return {**file_identity(path), **versions()}


def known_outcomes(path: Path) -> dict[str, Outcome]:
    """What is known of a file's demonstrations already, by their names."""
    with h5py.File(path) as file:
        dropped = json.loads(file["data"].attrs.get(DROPPED, "{}"))
        same = dropped.get("versions") == versions()  # others may replay what these do not
        found = {demo: Outcome(path, demo, reason) for demo, reason in dropped.get("reasons", {}).items() if same}
        found |= {demo: Outcome(path, demo) for demo, group in file["data"].items() if is_prepared(group)}
    return found


def prepare_one(path: Path, demo: str, folder: Path) -> Outcome:
    """Prepare a demonstration, unless it has left its file in `folder` already."""
    part, note = folder / f"{demo}.hdf5", folder / f"{demo}.json"
    if part.exists():
        return Outcome(path, demo)
    if note.exists():
        return Outcome(path, demo, json.loads(note.read_text()))
    recorded = read_demonstration(path, demo)  # a file of other software is not to be written to
    try:
        found = replayed(recorded)
        signals = {} if isinstance(found, str) else signals_of(cut(found), len(found))
    except OF_THE_MACHINE:
        raise
    except Exception as error:  # one that cannot be used must not keep the others of its file from being sources
        found, signals = f"{type(error).__name__}: {error}", {}
    if isinstance(found, str):
        write_text(note, json.dumps(found))
        return Outcome(path, demo, found)
    with new_hdf5(part) as file:
        write_prepared(file.create_group("demo"), found, signals)
    return Outcome(path, demo)


def _publish(path: Path, demos: list[str], folder: Path) -> None:
    """Write the file again with what was found beside its demonstrations; it is replaced when that is complete."""
    dropped: dict[str, str] = {}
    with changed_hdf5(path) as file:
        for demo in demos:
            group, part = file[f"data/{demo}"], folder / f"{demo}.hdf5"
            if GROUP in group:
                del group[GROUP]
            if part.exists():
                with h5py.File(part) as source:
                    source.copy(source[f"demo/{GROUP}"], group, name=GROUP)
            else:
                dropped[demo] = json.loads((folder / f"{demo}.json").read_text())
        file["data"].attrs[DROPPED] = json.dumps({"versions": versions(), "reasons": dropped})


def replayed(recorded: Demonstration) -> Prepared | str:
    """What a demonstration's replay shows, or why it is no source."""
    env = kitchen_of(recorded)
    try:
        env.reset(seed=recorded.seed)
        if made_otherwise(env, recorded.states):
            return "its kitchen is made differently now"
        put_state(env, env.data, recorded.states[0])
        watcher = _Watcher(env, recorded)
        held = 0
        for action in recorded.actions:
            watcher.before()
            _, reward, _, _, _ = env.step(action.astype(np.float32))
            watcher.after(float(action[-1]))
            held = held + 1 if reward > 0 else 0
        if held < SUCCESS_HOLD_STEPS:
            return f"its actions do not reach the goal any more: it holds for {held} steps at the end"
        return watcher.prepared()
    except OF_THE_MACHINE:
        raise
    except UserError as error:
        return str(error)
    finally:
        env.close()


class _Watcher:
    """Notes every step of a running episode."""

    def __init__(self, env: KitchenEnv, recorded: Demonstration) -> None:
        self._env, self._stages = env, env.declaration.stages
        self._stage = np.asarray(recorded.stage if recorded.stage is not None else np.zeros(len(recorded.actions)))
        self._words = [{word: getattr(stage, word) for word in _STAGE_WORDS} for stage in self._stages]
        self._parts: dict[str, Part] = {}
        for stage, words in zip(self._stages, self._words, strict=True):
            words["parts"] = [part.name for part in parts_of(env, stage)]
            words["drawn_to"] = env.scene.fill(stage.to)
            words["thing"] = env.scene.fill(stage.object)
            words["place"] = env.scene.fill(stage.target)
            words["about_itself"] = is_use(stage) and is_about_itself(env, stage)
            self._parts |= {part.name: part for part in possible_parts(env, stage)}
        loose = {*env.scene.objects, *(w["thing"] for w in self._words if w["thing"])}
        self._objects: dict[str, Graspable] = {name: graspable(env, name) for name in sorted(loose)}
        self._bodies = {name: int(env.model.body(name).id) for name in self._objects}
        self._bodies |= {name: part.body for name, part in self._parts.items()}
        self._roles = {role: env.scene.fixtures[name] for role, name in env.scene.roles.items()}
        model, names = env.model, env.scene.robot.names
        self._hand = env.scene.subtree(names.hand)
        below = {name: env.scene.subtree(model.body(body).name) for name, body in self._bodies.items()}
        self._masks = below
        self._site_to_hand = self._turn_of_hand()
        self._rows: dict[str, list[Any]] = {}

    def _turn_of_hand(self) -> Array:
        data = self._env.data
        site = data.site(self._env.scene.robot.names.grip_site).xmat.reshape(3, 3)
        turn: Array = site.T @ hand_rotation(data)
        return turn

    def _note(self, key: str, value: Any) -> None:
        self._rows.setdefault(key, []).append(value)

    def before(self) -> None:
        """Note the state before a step."""
        env, data = self._env, self._env.data
        step = len(self._rows.get("eef", ()))
        if step == 0 or self._stage[step] != self._stage[step - 1]:
            self._begin_stage(int(self._stage[step]))
        (x, y, _), yaw = base_pose(data)
        self._frame = make_pose(*env.controller.arm_frame())
        self._note("eef", make_pose(grip_position(data), hand_rotation(data)))
        self._note("base", [x, y, yaw])
        fingers = env.scene.robot.names.finger_joints
        self._note("gap", float(sum(abs(data.joint(name).qpos[0]) for name in fingers)))
        touched = self._touched()
        for name, body in self._bodies.items():
            pose = body_pose(data, body)
            self._note(f"poses/{name}", pose)
            self._note(f"touching/{name}", touched[name][0])
            if name in self._parts:
                self._note(f"joints/{name}", self._parts[name].position(data))
                self._note(f"contact_points/{name}", (inverse(pose) @ [*touched[name][1], 1.0])[:3])
            else:
                low = data.xpos[body][2] - self._objects[name].below(data.xmat[body].reshape(3, 3))
                self._note(f"undersides/{name}", [*data.xpos[body][:2], low])
        for number, stage in enumerate(self._stages):
            if is_use(stage):
                self._before_use(number, stage)

    def _begin_stage(self, number: int) -> None:
        """Note which parts a stage is about: that may follow from where something was put in one before."""
        if number < len(self._stages):
            self._words[number]["parts"] = [part.name for part in parts_of(self._env, self._stages[number])]

    def _before_use(self, number: int, stage: Stage) -> None:
        """Note where a stage uses its object, and the point of it that counts."""
        thing, words = self._objects[self._words[number]["thing"]], self._words[number]
        if not words["about_itself"]:
            self._note(f"poses/{use_key(number)}", use_frame(self._env, stage))
        turn = self._env.data.body(thing.name).xmat.reshape(3, 3)
        self._note(f"working_points/{use_key(number)}", working_point(thing, stage.verb, turn))

    def after(self, gripper: float) -> None:
        """Note what the controller was told."""
        position, turn = self._env.controller.goal_in_base()
        self._note("target", self._frame @ world_pose(position, turn @ self._site_to_hand))
        self._note("gripper", gripper)

    def _touched(self) -> dict[str, tuple[int, Array]]:
        """Of each body what of it the hand touches, and the middle of the contacts (3,), world, or NaN."""
        model, data = self._env.model, self._env.data
        nothing = (0, np.full(3, np.nan))
        if data.ncon == 0:
            return dict.fromkeys(self._masks, nothing)
        geoms = data.contact.geom[: data.ncon]
        bodies = model.geom_bodyid[geoms]
        met = data.contact.dist[: data.ncon] <= 0.0
        found: dict[str, tuple[int, Array]] = {}
        for name, mask in self._masks.items():
            mine = mask[bodies] & self._hand[bodies][:, ::-1] & met[:, None]
            which = mine.any(axis=1)
            if not which.any():
                found[name] = nothing
                continue
            handle = any(HANDLE in model.geom(int(geom)).name for geom in geoms[mine])
            found[name] = (1 if handle else 2, data.contact.pos[: data.ncon][which].mean(axis=0))
        return found

    def prepared(self) -> Prepared:
        """All that was noted."""
        parts = {name for words in self._words for name in words["parts"]}
        left_out = set(self._parts) - parts  # another burner's knob

        def series(prefix: str) -> dict[str, Any]:
            found = {key.partition("/")[2]: rows for key, rows in self._rows.items() if key.startswith(f"{prefix}/")}
            return {name: np.array(rows) for name, rows in found.items() if name not in left_out}

        about = {
            "stages": self._words,
            "parts": {name: _described(part) for name, part in self._parts.items() if name in parts},
            "objects": {name: self._size(name) for name in self._objects},
            "fixtures": {
                role: {"kind": type(fixture).__name__, "yaw": fixture.yaw} for role, fixture in self._roles.items()
            },
        }
        return Prepared(
            **{key: np.array(self._rows[key], dtype=np.float64) for key in ("eef", "target", "gripper", "base", "gap")},
            stage=self._stage.astype(np.int64),
            poses=self._fixture_poses() | series("poses"),
            joints=series("joints"),
            touching=series("touching"),
            contact_points=series("contact_points"),
            undersides=series("undersides"),
            working_points=series("working_points"),
            about=about,
        )

    def _fixture_poses(self) -> dict[str, Array]:
        """The same at every step: what MimicGen's subtasks may be relative to."""
        steps = len(self._rows["eef"])
        poses = {role: yaw_pose(*fixture.pos[:2], fixture.yaw, fixture.pos[2]) for role, fixture in self._roles.items()}
        return {role: np.repeat(pose[None], steps, axis=0) for role, pose in poses.items()}

    def _size(self, name: str) -> list[float]:
        cloud = self._objects[name].cloud
        return [float(v) for v in np.ptp(cloud, axis=0)]


def _described(part: Part) -> dict[str, Any]:
    return {
        "range": part.range.tolist(),
        "slides": part.slides,
        "side": part.side,
        "boxes": {group: box.tolist() for group, box in part.boxes.items()},
    }
