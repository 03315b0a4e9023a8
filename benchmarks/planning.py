"""The demonstrators' planner: plans found, and milliseconds, on questions that skills have asked.

    python benchmarks/planning.py record --queries 500     # plays demonstrations, notes what they ask (minutes)
    python benchmarks/planning.py run                      # answers, beside the four planners of before

Both planners get the same states and the same candidates. Their choices are judged by one measure, the present cost of
the chosen path from the chosen place. The planners of before knew no path round anything: their straight line counts.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import common
import planning_side
from planning_poses import poses
from planning_queries import record, write

from robocasa_lerobot.demos.choose import expand_names
from robocasa_lerobot.demos.motion import base_pose, floor_axes
from robocasa_lerobot.demos.planning.articulated import plan_contact
from robocasa_lerobot.demos.planning.collision import Held
from robocasa_lerobot.demos.planning.costs import NEARBY
from robocasa_lerobot.demos.planning.errors import NoPlanError
from robocasa_lerobot.demos.planning.motion_planner import MotionPlanner, WaypointPath
from robocasa_lerobot.envs.scene.robot_poses import RobotPose

OUTPUT = common.RESULTS / "planning.json"
QUERIES = common.REPOSITORY / "outputs" / "planning_queries.pkl.gz"
BEFORE = "5b97785"
WILL_DO = 1.0  # cost, without the candidate's own, up to which nothing is touched and nothing missed by much
TASKS = (
    "OpenFridge,CloseDishwasher,PickPlaceCounterToOven,PickPlaceToasterOvenToCounter,TurnOnToaster,TurnOffMicrowave,"
    "OpenCabinet,TurnSinkSpout,SlideOvenRack,CloseBlenderLid,OpenBlenderLid,PickPlaceCabinetToCounter,"
    "PickPlaceCounterToSink,PickPlaceToasterToCounter,TurnOnStove,CloseStandMixerHead,OpenDrawer,CloseOven,"
    "PickPlaceCounterToMicrowave,TurnOnMicrowave"
)


def parse(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """The command's options."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("record", "run"), help="make the file of questions, or answer them")
    parser.add_argument("--queries", type=int, default=500, help="how many (default 500)")
    parser.add_argument("--file", type=Path, default=QUERIES, help="of questions; made again by `record`")
    parser.add_argument("--tasks", default=TASKS, help="that are played for `record`")
    parser.add_argument("--seeds", type=int, default=12, help="of each of them (default 12)")
    parser.add_argument("--split", default="target", help="default: target")
    parser.add_argument("--out", type=Path, default=OUTPUT, help="result")
    return parser.parse_args(arguments)


def answers(side: str, file: Path, checkout: Path) -> dict[int, dict[str, Any]]:
    """What the planner of a checkout answers, in a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "answers.json"
        script = Path(planning_side.__file__)
        environment = {**os.environ, "PYTHONPATH": str(checkout)}
        command = [sys.executable, str(script), side, str(file.resolve()), str(out)]
        subprocess.run(command, check=True, env=environment, cwd=checkout)
        return {int(number): answer for number, answer in json.loads(out.read_text(encoding="utf-8")).items()}


def judged(query: dict[str, Any], env: Any, answer: dict[str, Any], *, detours: int) -> float | None:
    """Cost of a chosen path from the chosen place, without what was added to it beforehand."""
    if "path" not in answer:
        return None
    side, more, index = planning_side.Now(), query["more"], answer["path"]
    option = side.options(query)[index]
    if query["kind"] == "contact":
        part = planning_side.Part(env, more["joint"], more["opening"])
        try:
            stance = tuple(tuple(shift) for shift in answer["place"])
            return plan_contact(env, part, [option], [stance], detours=detours).cost - float(more["bias"][index])
        except NoPlanError:
            return None
    near = query["kind"] == "near"
    path = WaypointPath(option) if near else option
    key = 0 if near else more["key"]
    held = None if near or not more["held"] else Held(*more["held"])
    planner = MotionPlanner(
        env,
        [path],
        key,
        held=held,
        loaded=0 if near else more["loaded"],
        allowed=frozenset(more["allowed"]),
        **({"costs": NEARBY} if near else {}),
    )
    found = planner.best([_place(env, answer["place"], near=near)], folded=not near, detours=detours)
    return found[0].cost - path.extra if found else None


def _place(env: Any, place: Any, *, near: bool) -> RobotPose | None:
    if place is None:
        return None
    if not near:
        return RobotPose(*place)
    base, yaw = base_pose(env.data)
    x, y, _ = base + place @ floor_axes(yaw)
    return RobotPose(float(x), float(y), yaw)


def summary(milliseconds: list[float], costs: list[float | None]) -> dict[str, Any]:
    """Of one planner's answers to questions of one kind."""
    found = [cost for cost in costs if cost is not None]
    return {
        "ms_mean": round(statistics.fmean(milliseconds), 2),
        "ms_median": round(statistics.median(milliseconds), 2),
        "ms_max": round(max(milliseconds), 1),
        "plans": len(found),
        "that_will_do": sum(cost <= WILL_DO for cost in found),
        "cost_median": round(statistics.median(found), 3) if found else None,
    }


def compare(file: Path) -> dict[str, Any]:
    """Ask both planners, and judge what they say."""
    with tempfile.TemporaryDirectory() as folder:
        common.unpack(BEFORE, Path(folder), "robocasa_lerobot")
        sides = {"before": answers("before", file, Path(folder)), "now": answers("now", file, common.REPOSITORY)}
    queries = planning_side.read(file)
    costs: dict[str, dict[int, float | None]] = {"before": {}, "now": {}}
    for number, query, env in planning_side.states(queries):
        for side, most in (("before", 0), ("now", 2)):
            costs[side][number] = judged(query, env, sides[side][number], detours=most)
    groups = {"all": list(range(len(queries)))}
    for number, query in enumerate(queries):
        groups.setdefault(query["kind"], []).append(number)
    return {
        kind: {
            "queries": len(numbers),
            **{
                side: summary([sides[side][n]["ms"] for n in numbers], [costs[side][n] for n in numbers])
                for side in ("before", "now")
            },
        }
        for kind, numbers in groups.items()
    }


def main(arguments: Sequence[str] | None = None) -> int:
    """Record, or answer, print and write."""
    options = parse(arguments)
    if options.what == "record":
        queries = record(expand_names(options.tasks), options.seeds, options.split, options.queries)
        write(options.file, queries)
        print(f"{options.file}: {len(queries)} questions")
        return 0
    result = compare(options.file)
    whole = result["all"]
    ratios = {
        "planning_ms_now_to_before": round(whole["now"]["ms_mean"] / whole["before"]["ms_mean"], 4),
        "plans_that_will_do_now_to_before": round(
            whole["now"]["that_will_do"] / max(whole["before"]["that_will_do"], 1), 4
        ),
    }
    header = ["questions", "", "ms before", "now", "will do before", "now"]
    lines = [
        [
            kind,
            str(row["queries"]),
            *(f"{row[side]['ms_mean']:.1f}" for side in ("before", "now")),
            *(str(row[side]["that_will_do"]) for side in ("before", "now")),
        ]
        for kind, row in result.items()
    ]
    print(common.table(header, lines))
    body = {
        "machine": common.machine(),
        "versions": common.versions("mujoco", "numpy", "numba"),
        "before": BEFORE,
        "settings": {"will_do": WILL_DO, "split": options.split},
        "ratios": ratios,
        "kinds": result,
        "single_poses": poses(),
    }
    common.write_result(options.out, "planning", body)
    print(options.out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
