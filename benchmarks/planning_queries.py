"""Questions to the planner, as demonstrations ask them: recorded, stored, and read back."""

from __future__ import annotations

import gzip
import pickle
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from robocasa_lerobot.demos.recorder import record_episode
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.progress import Bar

# Kinds of questions, and the functions that skills ask them by.
ASKED = {"plan_reach": "paths", "plan_near": "near", "plan_contact": "contact"}
FIRST_SEED = 100_000
MOST_OF_ONE = 6  # questions of one demonstration: a failing one asks the same again and again


@dataclass(frozen=True)
class Query:
    """One question, in numbers alone, so that any version of the planner can be asked.

    Attributes:
        kind: "paths" from where the robot could stand, "near" where it stands, or in "contact" with a part.
        task, split, seed: of the scene.
        qpos: of its state.
        positions, rotations: (paths, poses, 3), (paths, poses, 3, 3) of the hand.
        more: the rest of the request.
    """

    kind: str
    task: str
    split: str
    seed: int
    qpos: np.ndarray[Any, Any]
    positions: np.ndarray[Any, Any]
    rotations: np.ndarray[Any, Any]
    more: dict[str, Any] = field(default_factory=dict)


def record(tasks: list[str], seeds: int, split: str, wanted: int) -> list[Query]:
    """Questions of demonstrations of these tasks: `wanted` of them, evenly from all that were asked."""
    jobs = [(task, seed) for seed in range(FIRST_SEED, FIRST_SEED + seeds) for task in tasks]
    found: list[Query] = []
    with Bar(jobs, total=len(jobs), unit="demonstration") as bar:
        for task, seed in bar:
            env = KitchenEnv(task, split=split, cameras=(), terminate_on_success=False)
            asked: list[Query] = []
            with _Listening(env, task, split, seed, asked):
                record_episode(env, seed, varied=False)
            env.close()
            found += asked[:MOST_OF_ONE]
    every = np.linspace(0, len(found) - 1, min(wanted, len(found))).round().astype(int)
    return [found[index] for index in every]


class _Listening:
    """While it lasts, questions of skills are noted before they are answered."""

    def __init__(self, env: KitchenEnv, task: str, split: str, seed: int, asked: list[Query]) -> None:
        self._env, self._where, self._asked = env, (task, split, seed), asked
        self._old: list[tuple[Any, str, Any]] = []

    def __enter__(self) -> None:
        for name, module in list(sys.modules.items()):
            if not name.startswith("robocasa_lerobot.demos.skills"):
                continue
            for function in ASKED:
                if callable(original := getattr(module, function, None)):
                    self._old.append((module, function, original))
                    setattr(module, function, self._noting(function, original))

    def __exit__(self, *_: object) -> None:
        for module, function, original in self._old:
            setattr(module, function, original)

    def _noting(self, function: str, original: Callable[..., Any]) -> Callable[..., Any]:
        def noting(env: KitchenEnv, *arguments: Any, **options: Any) -> Any:
            arguments = tuple(list(value) if _is_lazy(value) else value for value in arguments)
            query = getattr(self, f"_{ASKED[function]}")(*arguments, **options)
            if query is not None:
                self._asked.append(query)
            return original(env, *arguments, **options)

        return noting

    def _query(self, kind: str, rows: list[list[Any]], **more: Any) -> Query:
        positions = np.array([[target.position for target in row] for row in rows], dtype=np.float32)
        rotations = np.array([[target.rotation for target in row] for row in rows], dtype=np.float32)
        return Query(kind, *self._where, self._env.data.qpos.copy(), positions, rotations, more)

    def _paths(self, paths: Any, point: Any, **options: Any) -> Query | None:
        if not paths:
            return None
        taken = [path.takes and (path.takes.name, path.takes.position, path.takes.rotation) for path in paths]
        held = options.get("held")
        return self._query(
            "paths",
            [list(path.targets) for path in paths],
            extra=np.array([path.extra for path in paths]),
            takes=taken if any(taken) else None,
            point=np.array(point),
            key=options["key"],
            held=held and (held.name, held.position, held.rotation),
            loaded=options.get("loaded", 0),
            allowed=sorted(options.get("allowed", ())),
        )

    def _near(self, rows: Any, shifts: Any, **options: Any) -> Query | None:
        if len(options.get("tried", ())):
            return None
        return self._query("near", list(rows), shifts=list(shifts), allowed=sorted(options.get("allowed", ())))

    def _contact(self, part: Any, paths: Any, stances: Any, **options: Any) -> Query:
        return self._query(
            "contact",
            [[waypoint.target for waypoint in path.waypoints] for path in paths],
            angles=np.array([[waypoint.angle for waypoint in path.waypoints] for path in paths]),
            progress=np.array([[waypoint.progress for waypoint in path.waypoints] for path in paths]),
            contact=[path.contact for path in paths],
            bias=np.array([path.bias for path in paths]),
            joint=part.name,
            opening=float(part.joint_value(1.0)),
            stances=list(stances),
            bends=options.get("bends"),
        )


def _is_lazy(value: Any) -> bool:
    return hasattr(value, "__next__")


def write(path: Path, queries: list[Query]) -> None:
    """Write questions to a file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    plain = [vars(query) for query in queries]
    with gzip.open(path, "wb", compresslevel=4) as file:
        pickle.dump(plain, file)
