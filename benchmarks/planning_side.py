"""Answers stored questions with the planner of the checkout that it runs in: `planning.py` starts it, once for each.

Modules are imported by name, since the two checkouts have different ones.
"""

from __future__ import annotations

import gzip
import importlib
import json
import pickle
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np

DEMOS = "robocasa_lerobot.demos"


def module(name: str) -> Any:
    """A module of the demonstrators."""
    return importlib.import_module(f"{DEMOS}.{name}")


class Part:
    """A part on a joint, as planners see it."""

    def __init__(self, env: Any, joint: str, opening: float) -> None:
        self._data, self._model, self.name, self._opening = env.data, env.model, joint, opening
        self._address = int(env.model.joint(joint).qposadr[0])
        self.body = int(env.model.jnt_bodyid[env.model.joint(joint).id])

    @property
    def angle(self) -> float:
        """From shut, radians."""
        return self._opening * float(self._data.qpos[self._address])

    def joint_value(self, angle: float) -> float:
        """Position of the joint at an angle."""
        return self._opening * angle

    def place(self, data: Any, angle: float) -> None:
        """The same, written into a state: the planner of before asks so."""
        data.qpos[self._address] = self._opening * angle


def rows(query: dict[str, Any]) -> list[tuple[Any, ...]]:
    """Its rows of hand poses."""
    target = module("motion").HandTarget
    positions, rotations = (query[name].astype(np.float64) for name in ("positions", "rotations"))
    return [
        tuple(target(p, r) for p, r in zip(path, turns, strict=True))
        for path, turns in zip(positions, rotations, strict=True)
    ]


class Now:
    """The planner of this checkout."""

    def __init__(self) -> None:
        reaching, self._near = module("skills.reaching"), module("planning.motion_planner")
        self._held, self._path, self._plan_paths = reaching.Held, reaching.WaypointPath, reaching.plan_reach
        self._contact = module("planning.articulated")

    def paths(self, env: Any, query: dict[str, Any], options: list[Any]) -> tuple[int, Any, Any] | None:
        """Of paths from where the robot could stand: the number, the place, the joint path."""
        more = query["more"]
        held = self._held(*more["held"]) if more["held"] else None
        allowed = frozenset(more["allowed"])
        found = self._plan_paths(
            env, options, more["point"], key=more["key"], held=held, loaded=more["loaded"], allowed=allowed
        )
        if not found:
            return None
        path, stand = self.chosen(found[0])
        return index_of(options, path), stand and (stand.x, stand.y, stand.yaw), found[0].joints

    def chosen(self, plan: Any) -> tuple[Any, Any]:
        """The path of a plan, and where the robot is to stand."""
        return plan.path, plan.base

    def near(self, env: Any, query: dict[str, Any], options: list[Any]) -> tuple[int, Any, Any]:
        """Of rows near where the robot stands."""
        more = query["more"]
        plan = self._near.plan_near(env, options, more["shifts"], allowed=frozenset(more["allowed"]))
        return index_of(options, plan.targets), plan.shift, plan.joints

    def contact(self, env: Any, query: dict[str, Any], options: list[Any]) -> tuple[int, Any, Any]:
        """Of paths along a part."""
        more = query["more"]
        bends = {} if more["bends"] is None else {"bends": more["bends"]}
        part = Part(env, more["joint"], more["opening"])
        plan = self._contact.plan_contact(env, part, options, more["stances"], **bends)
        return index_of(options, plan.path), (plan.start, plan.end), plan.joints

    def options(self, query: dict[str, Any]) -> list[Any]:
        """What is asked about, in the planner's own types."""
        more, found = query["more"], rows(query)
        if query["kind"] == "near":
            return found
        if query["kind"] == "paths":
            takes = more["takes"] or [None] * len(found)
            held = [what and self._held(*what) for what in takes]
            return [self._path(*of) for of in zip(found, more["extra"].tolist(), held, strict=True)]
        return [self.contact_path(query, number, row) for number, row in enumerate(found)]

    def contact_path(self, query: dict[str, Any], number: int, row: tuple[Any, ...]) -> Any:
        """One path along a part."""
        more = query["more"]
        points = zip(more["angles"][number].tolist(), row, more["progress"][number].tolist(), strict=True)
        bias = float(more["bias"][number])
        return self._contact.ContactPath(
            tuple(self._contact.Waypoint(*point) for point in points), more["contact"][number], None, bias
        )


class Before(Now):
    """The four planners of commit 5b97785."""

    def __init__(self) -> None:
        ways, arc_plan = module("skills.ways"), module("skills.arc_plan")
        self._held, self._path, self._plan_paths = ways.Held, ways.Way, ways.choose
        self._contact = SimpleNamespace(ContactPath=arc_plan.Way, Waypoint=arc_plan.Via, plan_arc=arc_plan.plan_arc)
        self._few, self._many = module("skills.reach"), module("skills.reach_many")

    def chosen(self, plan: Any) -> tuple[Any, Any]:
        """The path of a plan, and where the robot is to stand."""
        return plan.way, plan.stand

    def near(self, env: Any, query: dict[str, Any], options: list[Any]) -> tuple[int, Any, Any]:
        """Hundreds of rows were asked of another planner."""
        more = query["more"]
        plan_reach = self._many.plan_reach_of_many if len(options) > 100 else self._few.plan_reach
        plan = plan_reach(env, options, more["shifts"], allowed=frozenset(more["allowed"]))[0]
        return index_of(options, plan.targets), plan.shift, np.zeros((1, 7))

    def contact(self, env: Any, query: dict[str, Any], options: list[Any]) -> tuple[int, Any, Any]:
        """Of paths along a part."""
        more = query["more"]
        plan = self._contact.plan_arc(env, Part(env, more["joint"], more["opening"]), options, more["stances"])
        return index_of(options, plan.way), (plan.start, plan.end), plan.joints


def index_of(options: list[Any], chosen: Any) -> int:
    """The number of the very object among others."""
    return next(number for number, option in enumerate(options) if option is chosen)


def states(queries: list[dict[str, Any]]) -> Iterator[tuple[int, dict[str, Any], Any]]:
    """Each question with an env in its state; those of one scene share it."""
    from robocasa_lerobot.envs.kitchen_env import KitchenEnv

    before, env = None, None
    order = sorted(range(len(queries)), key=lambda i: (queries[i]["task"], queries[i]["seed"], i))
    for number in order:
        query = queries[number]
        where = query["task"], query["split"], query["seed"]
        if where != before:
            if env is not None:
                env.close()
            env = KitchenEnv(query["task"], split=query["split"], cameras=(), terminate_on_success=False)
            env.reset(seed=query["seed"])
            before = where
        assert env is not None
        env.data.qpos[:] = query["qpos"]
        mujoco.mj_forward(env.model, env.data)
        yield number, query, env
    if env is not None:
        env.close()


def read(path: Path) -> list[dict[str, Any]]:
    """Stored questions."""
    with gzip.open(path, "rb") as file:
        found: list[dict[str, Any]] = pickle.load(file)
    return found


def main() -> None:
    """Answer all questions; the arguments are the side, the file of questions and the file of answers."""
    side, questions, out = sys.argv[1], Path(sys.argv[2]), Path(sys.argv[3])
    planner = Before() if side == "before" else Now()
    answers: dict[int, dict[str, Any]] = {}
    warm: set[str] = set()
    for number, query, env in states(read(questions)):
        options, kind = planner.options(query), query["kind"]
        seconds = []
        answer = None
        for _ in range(1 if kind in warm else 2):  # the first question of a kind compiles what it needs
            started = time.process_time()
            try:
                answer = getattr(planner, kind)(env, query, options)
            except RuntimeError:
                answer = None
            seconds.append(time.process_time() - started)
        warm.add(kind)
        answers[number] = {"ms": 1000 * seconds[-1]}
        if answer is not None:
            path, place, joints = answer
            answers[number] |= {"path": path, "place": place, "nodes": len(np.atleast_2d(joints))}
        out.write_text(json.dumps(answers), encoding="utf-8")


if __name__ == "__main__":
    main()
