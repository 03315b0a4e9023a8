"""Replay recorded robosuite action sequences in our simulator and tabulate how far the two robots drift apart.

The recordings are robosuite 1.5.1's PandaOmron on MuJoCo 3.3.7 in an empty room. A dozen travel with the tests, at each
fifth step; `--traces` names a file with all of them, whose figures go to `results/`. Each sequence starts from the
settled initial pose and is replayed open-loop: nothing of the recording but its actions enters our simulation.

    python benchmarks/trace_replay.py
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.envs.physics.options import apply_simulation_options
from robocasa_lerobot.envs.robots.control_step import control_step
from robocasa_lerobot.envs.robots.panda_omron.control.controller import PandaOmronController
from robocasa_lerobot.envs.robots.panda_omron.model import SPAWN_POSITION
from robocasa_lerobot.envs.robots.panda_omron.proprioception import read_observations
from robocasa_lerobot.envs.robots.panda_omron.robot import PANDA_OMRON
from robocasa_lerobot.envs.scene.scene import SETTLE_STEPS
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.progress import Bar

REPOSITORY = Path(__file__).parents[1]
KEPT_TRACES = REPOSITORY / "tests" / "envs" / "golden" / "robosuite_traces.npz"
RESULTS = REPOSITORY / "benchmarks" / "results" / "trace_replay.json"

# Limits: end-effector error at every step of a single-direction trace, and at the end of a random one.
EVERY_STEP_MM, EVERY_STEP_DEG = 5.0, 1.0
AT_END_MM, AT_END_DEG = 10.0, 2.0
BASE_MM, BASE_DEG = 10.0, 1.0
GRIPPER_MM = 1.0

# robosuite 1.5.1's first two joints are ours exchanged: it moves its "forward" joint for sideways commands.
JOINT_ORDER = (1, 0, *range(2, 13))
# Errors of this trace after this step are no longer those of the simulators: see `sensitivity`.
CHAOTIC_TRACE, CHAOTIC_AFTER = "arm_random_mode+1", 105
PERTURBATION_RAD = 1e-9

Array = NDArray[np.float64]
Recording = dict[str, Array]


@dataclass(frozen=True)
class TraceError:
    """Distance between recording and replay of one trace: positions in mm, angles in degrees, joints in rad or m.

    The recorded end-effector and base poses are one physics step (2 ms) older than the recorded joints, so at 0.75 m/s
    they differ from ours by 1.5 mm however well the simulators agree; `joints` compares the same instant.
    """

    name: str
    steps: int
    eef_mm_max: float
    eef_mm_end: float
    eef_deg_max: float
    eef_deg_end: float
    base_mm_max: float
    base_deg_max: float
    gripper_mm_max: float
    joints_max: float

    @property
    def is_random(self) -> bool:
        """Whether the end counts, not every step."""
        return "random" in self.name

    @property
    def keeps_heading(self) -> bool:
        """Whether the base stays at yaw 0, where every version of robosuite turns commands alike (1.5.1 as we do)."""
        return not (self.name.startswith("base_yaw") or self.name == "arm_and_base_random")

    def ratios(self) -> dict[str, float]:
        """Each error over its limit, by the name of the limit."""
        out = {"gripper": self.gripper_mm_max / GRIPPER_MM}
        if self.is_random:
            out |= {"end_position": self.eef_mm_end / AT_END_MM, "end_rotation": self.eef_deg_end / AT_END_DEG}
        else:
            out |= {"position": self.eef_mm_max / EVERY_STEP_MM, "rotation": self.eef_deg_max / EVERY_STEP_DEG}
        if self.keeps_heading:
            out |= {"base_position": self.base_mm_max / BASE_MM, "base_rotation": self.base_deg_max / BASE_DEG}
        return out


def kept_traces(path: Path = KEPT_TRACES) -> dict[str, Recording]:
    """The recordings that travel with the tests, as `load_traces` gives them, but only at their `steps` (S,)."""
    out: dict[str, Recording] = {}
    with np.load(path) as file:
        for key in file.files:
            name, part = key.rsplit("/", 1)
            out.setdefault(name, {})[part] = file[key]
    return out


def at_steps(ours: Recording, recorded: Recording) -> Recording:
    """Our run (T+1, ...) at the steps that a recording has."""
    if "steps" not in recorded:
        return ours
    return {key: values[recorded["steps"].astype(int)] for key, values in ours.items()}


def load_traces(path: Path) -> dict[str, Recording]:
    """The recordings by name: `actions` (T, 12) in HDF5 order, `qpos` (T+1, 13) in our joint order and with our spawn
    offset, and each observation (T+1, ...) under its robosuite name.

    Raises:
        UserError: there is no such file.
    """
    if not path.exists():
        raise UserError(f"no recorded traces at {path}. Give the path of panda_omron_traces.npz with --traces.")
    out = {}
    with np.load(path) as file:
        ends = np.cumsum(file["obs_sizes"])
        for name in (str(n) for n in file["names"]):
            observed = np.split(file[f"{name}/obs"], ends[:-1], axis=1)
            recording = dict(zip((str(key) for key in file["obs_keys"]), observed, strict=True))
            qpos = file[f"{name}/qpos"][:, JOINT_ORDER]
            qpos[:, :2] -= SPAWN_POSITION[:2]
            out[name] = recording | {"actions": file[f"{name}/actions"], "qpos": qpos}
    return out


def empty_room(multiccd: bool) -> mujoco.MjModel:
    """The robot on a floor, with the options of our kitchens; the recordings were made without `multiccd`."""
    spec = mujoco.MjSpec()
    apply_simulation_options(spec)
    if not multiccd:
        spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_MULTICCD)
    spec.worldbody.add_geom(name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=(20, 20, 0.1))
    PANDA_OMRON.add_to(spec, "fast")
    return spec.compile()


def replay(model: mujoco.MjModel, actions: Array, perturbation: float = 0.0) -> Recording:
    """Observations (T+1, ...) and `qpos` of the settled robot carrying out `actions` (T, 12) from the world's origin.

    `perturbation` radians are added to the second arm joint before the first action.
    """
    data = mujoco.MjData(model)
    PANDA_OMRON.set_home(model, data)
    PANDA_OMRON.place_base(model, data, 0.0, 0.0, 0.0)
    mujoco.mj_forward(model, data)
    controller = PandaOmronController(model, data)
    controller.reset()
    for _ in range(SETTLE_STEPS):
        control_step(model, data, controller, np.zeros(12))
    if perturbation:
        data.joint("robot0_joint2").qpos[0] += perturbation
        mujoco.mj_forward(model, data)
    rows = [read_observations(model, data) | {"qpos": data.qpos.copy()}]
    for action in actions:
        control_step(model, data, controller, action)
        rows.append(read_observations(model, data) | {"qpos": data.qpos.copy()})
    return {key: np.array([row[key] for row in rows]) for key in rows[0]}


def compare(name: str, recorded: Recording, ours: Recording, steps: int | None = None) -> TraceError:
    """The distances between two runs of a trace, over its first `steps` steps (all by default)."""
    upto = slice(None if steps is None else steps + 1)

    def millimetres(key: str) -> Array:
        return 1e3 * np.linalg.norm(ours[key][upto] - recorded[key][upto], axis=1)

    def degrees(key: str) -> Array:
        return rotation_distance(ours[key][upto], recorded[key][upto])

    position, rotation = millimetres("robot0_eef_pos"), degrees("robot0_eef_quat")
    fingers = np.abs(ours["robot0_gripper_qpos"][upto] - recorded["robot0_gripper_qpos"][upto])
    return TraceError(
        name=name,
        steps=len(position) - 1,
        eef_mm_max=float(position.max()),
        eef_mm_end=float(position[-1]),
        eef_deg_max=float(rotation.max()),
        eef_deg_end=float(rotation[-1]),
        base_mm_max=float(millimetres("robot0_base_pos").max()),
        base_deg_max=float(degrees("robot0_base_quat").max()),
        gripper_mm_max=float(1e3 * fingers.max()),
        joints_max=float(np.abs(ours["qpos"][upto] - recorded["qpos"][upto]).max()),
    )


def rotation_distance(first: Array, second: Array) -> Array:
    """Angle in degrees between unit quaternions (..., 4), whatever their signs."""
    chord = np.minimum(np.linalg.norm(first - second, axis=-1), np.linalg.norm(first + second, axis=-1))
    return np.degrees(4.0 * np.arcsin(np.clip(0.5 * chord, 0.0, 1.0)))


def sensitivity(model: mujoco.MjModel, name: str, actions: Array) -> TraceError:
    """How far two runs of our own simulator are apart that start `PERTURBATION_RAD` of one joint apart."""
    return compare(name, replay(model, actions), replay(model, actions, PERTURBATION_RAD))


def worst_ratios(errors: list[TraceError]) -> dict[str, float]:
    """The largest error over its limit, for each limit."""
    worst: dict[str, float] = {}
    for error in errors:
        for limit, ratio in error.ratios().items():
            worst[limit] = max(worst.get(limit, 0.0), ratio)
    return worst


def table(errors: list[TraceError]) -> str:
    """The errors as a Markdown table."""
    lines = [
        "| trace | steps | eef mm, max | end | eef deg, max | end | base mm | base deg | gripper mm | joints | ok |",
        "|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|---|",
    ]
    for e in errors:
        numbers = (e.eef_mm_max, e.eef_mm_end, e.eef_deg_max, e.eef_deg_end)
        numbers += (e.base_mm_max, e.base_deg_max, e.gripper_mm_max)
        verdict = "yes" if max(e.ratios().values()) <= 1.0 else "**no**"
        cells = " | ".join(f"{number:.3f}" for number in numbers)
        lines.append(f"| `{e.name}` | {e.steps} | {cells} | {e.joints_max:.0e} | {verdict} |")
    return "\n".join(lines)


def main(arguments: list[str] | None = None) -> int:
    from common import machine, versions, write_result  # here: the tests use the rest of this file without it

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--traces", type=Path, help="all recordings (.npz); default: those that travel with the tests")
    parser.add_argument("--output", type=Path, help="where the figures go (.json); default with --traces: results/")
    options = parser.parse_args(arguments)
    try:
        traces = load_traces(options.traces) if options.traces else kept_traces()
    except UserError as error:
        print(error, file=sys.stderr)
        return 2
    result: dict[str, Any] = {
        "machine": machine(),
        "versions": versions("mujoco", "numpy", "numba"),
        "limits": {
            "every_step": [EVERY_STEP_MM, EVERY_STEP_DEG],
            "at_end": [AT_END_MM, AT_END_DEG],
            "base": [BASE_MM, BASE_DEG],
            "gripper": GRIPPER_MM,
        },
    }
    for multiccd in (False, True):
        model = empty_room(multiccd)
        errors = []
        for name, trace in Bar(traces.items(), desc=f"multiccd {'on' if multiccd else 'off'}", unit="trace"):
            errors.append(compare(name, trace, at_steps(replay(model, trace["actions"]), trace)))
        print(f"\n## {'As in our kitchens: multiccd on' if multiccd else 'As recorded: multiccd off'}\n")
        print(table(errors))
        entry: dict[str, Any] = {"ratios": worst_ratios(errors), "traces": [asdict(error) for error in errors]}
        if CHAOTIC_TRACE in traces:
            chaotic = traces[CHAOTIC_TRACE]
            before = compare(CHAOTIC_TRACE, chaotic, replay(model, chaotic["actions"]), CHAOTIC_AFTER)
            own = sensitivity(model, CHAOTIC_TRACE, chaotic["actions"])
            entry["ratios_without_chaotic"] = worst_ratios([e for e in errors if e.name != CHAOTIC_TRACE])
            entry["chaotic"] = {"before": asdict(before), "own_runs_apart": asdict(own)}
            print(
                f"\n`{CHAOTIC_TRACE}` up to step {CHAOTIC_AFTER}: {before.eef_mm_max:.3f} mm, "
                f"{before.eef_deg_max:.3f} degrees, joints {before.joints_max:.0e}. Two runs of ours that start "
                f"{PERTURBATION_RAD:.0e} rad apart end {own.eef_mm_end:.0f} mm and {own.eef_deg_end:.0f} degrees apart."
            )
        print("\nWorst error over its limit: " + ", ".join(f"{k} {v:.2f}" for k, v in entry["ratios"].items()))
        result["multiccd_on" if multiccd else "multiccd_off"] = entry
    result["ratios"] = result["multiccd_on"]["ratios"]  # the production setting
    output = options.output or (RESULTS if options.traces else None)
    if output is not None:
        write_result(output, "trace_replay", result)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
