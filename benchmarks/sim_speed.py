"""Our simulator beside robosuite's, in one run: control steps per second, resets, memory, and where our time goes.

robosuite 1.5.1 on MuJoCo 3.3.7 steps its PandaOmron in `PickPlace`, we step ours in a full kitchen: the same number of
physics steps per control step, the same actions, the same measuring loop (`peers/sim_loop.py`), repetitions in turn so
that whatever else the machine does hits both. The first run makes robosuite's virtual environment.

    python benchmarks/sim_speed.py --quick
"""

from __future__ import annotations

import argparse
import contextlib
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import common
import sim_report
from venvs import prepare_venv
from workers import Worker, WorkerError, run_together

from robocasa_lerobot import gl
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.progress import Bar

BENCHMARKS = Path(__file__).parent
OUTPUT = common.RESULTS / "sim_speed.json"
PEER, OURS = sim_report.PEER, sim_report.OURS
PEER_VERSIONS = {"robosuite": "1.5.1", "mujoco": "3.3.7"}
MAX_PROCESSES = 2


@dataclass(frozen=True)
class Effort:
    """How long and how often is measured. Windows are seconds of stepping, without and with cameras."""

    repetitions: int
    window_s: tuple[float, float]
    resets: int
    split_steps: int


FULL = Effort(repetitions=7, window_s=(6.0, 12.0), resets=10, split_steps=200)
QUICK = Effort(repetitions=3, window_s=(3.0, 8.0), resets=4, split_steps=100)


def parse(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """The command's options."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="fewer and shorter repetitions: about 5 minutes")
    parser.add_argument(
        "--output", type=Path, help=f"JSON file to write; default: {OUTPUT.relative_to(common.REPOSITORY)}"
    )
    parser.add_argument(
        "--without-peer",
        action="store_true",
        help="measure ours alone: no ratios, and no file unless --output is given",
    )
    return parser.parse_args(arguments)


@contextlib.contextmanager
def started(programs: dict[str, tuple[Path, Path]], bar: Bar) -> Iterator[tuple[dict[Any, list[Worker]], Any]]:
    """All processes, by (program, cameras), two of each, and what each program's second one said of its env.

    The second one, because the first may have compiled things that all later ones find on disk.
    They wait without using a core while others measure.
    """
    workers: dict[Any, list[Worker]] = {}
    said: dict[str, dict[str, Any]] = {name: {} for name in programs}
    with contextlib.ExitStack() as stack:
        for cameras in (False, True):
            for name, (python, program) in programs.items():
                for i in range(MAX_PROCESSES):
                    bar.set_description(f"starting {name}")
                    worker = stack.enter_context(Worker(f"{name} ({_camera_key(cameras)})", python, program))
                    answer = worker.ask("make", cameras=cameras, seed=i)
                    workers.setdefault((name, cameras), []).append(worker)
                    said[name][_camera_key(cameras)] = {"startup_s": worker.startup_s, **answer}
                    bar.update()
        yield workers, said


def measure_steps(
    workers: dict[Any, list[Worker]], names: Sequence[str], effort: Effort, bar: Bar, noise: list[float]
) -> dict[str, dict[str, Any]]:
    """Control steps per second of each program in each configuration: the sum over the processes, and its spread."""
    rates: dict[str, dict[str, list[float]]] = {name: {} for name in names}
    for repetition in range(effort.repetitions):
        for number, (key, cameras, processes, standing) in enumerate(sim_report.CONFIGURATIONS):
            # Who goes first alternates: a slow drift of the machine favours nobody.
            for name in names if repetition % 2 == 0 else reversed(names):
                bar.set_description(f"{name}, {_camera_key(cameras)}, {processes} process(es)")
                note_noise(noise)
                seed = 10_000 * (repetition + 1) + 1_000 * number
                answers = run_together(workers[name, cameras][:processes], effort.window_s[cameras], seed, standing)
                rates[name].setdefault(key, []).append(sum(a["steps"] / a["seconds"] for a in answers))
                bar.update()
    return {name: {key: common.spread(values) for key, values in by_key.items()} for name, by_key in rates.items()}


def measure_resets(
    workers: dict[Any, list[Worker]], names: Sequence[str], effort: Effort, bar: Bar, noise: list[float]
) -> dict[str, Any]:
    """Seconds of a reset to a new scene and to the same scene, without and with cameras (and their first pictures)."""
    seconds: dict[str, Any] = {name: {} for name in names}
    for cameras in (False, True):
        for same_scene in (False, True):
            for name in names:
                bar.set_description(f"{name}, resets")
                note_noise(noise)
                answer = workers[name, cameras][0].ask(
                    "resets", count=effort.resets, seed=500_000 + 100 * same_scene, same_scene=same_scene
                )
                key = ("same_scene_" if same_scene else "new_scene_") + _camera_key(cameras)
                seconds[name][key] = {**common.spread(answer["seconds"]), "growth_mib": answer["growth_mib"]}
                bar.update()
    return seconds


def note_noise(noise: list[float]) -> None:
    """Add the share of the cores that others take at this moment, while everything of ours waits."""
    share = common.busy_share()
    if share is not None:
        noise.append(share)


def measure(programs: dict[str, tuple[Path, Path]], effort: Effort) -> dict[str, Any]:
    """Everything, as the body of the result."""
    names = list(programs)
    total = len(names) * (2 * MAX_PROCESSES + 4 + effort.repetitions * len(sim_report.CONFIGURATIONS)) + 1
    noise: list[float] = []
    with Bar(total=total, unit="part", smoothing=0) as bar, started(programs, bar) as (workers, said):
        check_peer(said)
        steps = measure_steps(workers, names, effort, bar, noise)
        resets = measure_resets(workers, names, effort, bar, noise)
        bar.set_description("split of our time")
        split = workers[OURS, True][0].ask("split", seed=600_000, steps=effort.split_steps)
        bar.update()
    return {
        "ratios": sim_report.ratios(steps),
        "steps_per_second": steps,
        "split_of_our_step": split,
        "reset_seconds": resets,
        "envs": said,
        "others_share_of_cores": common.spread(noise) if noise else None,
        "effort": effort.__dict__,
    }


def check_peer(said: dict[str, dict[str, Any]]) -> None:
    """Raise UserError where the peer is not the version that the figures are about."""
    for answer in said.get(PEER, {}).values():
        wrong = {k: v for k, v in answer["versions"].items() if v != PEER_VERSIONS.get(k, v)}
        if wrong:
            raise UserError(
                f"the environment of robosuite has {wrong}, expected {PEER_VERSIONS}: "
                "delete benchmarks/.venvs/robosuite and run this again."
            )


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print, write."""
    options = parse(arguments)
    try:
        backend = gl.ensure_gl()
        programs = {OURS: (Path(sys.executable), BENCHMARKS / "ours_sim.py")}
        if not options.without_peer:
            programs = {PEER: (prepare_venv("robosuite"), BENCHMARKS / "peers" / "robosuite_sim.py"), **programs}
        renderer = common.renderers(backend)
        body = measure(programs, QUICK if options.quick else FULL)
    except (UserError, WorkerError) as error:
        print(f"sim_speed: {error}", file=sys.stderr)
        return 2
    body = {
        "mode": "quick" if options.quick else "full",
        "machine": {**common.machine(), "renderer": renderer},
        "versions": common.versions("robocasa-lerobot", "mujoco", "numpy", "numba"),
        **body,
    }
    print(sim_report.report(body))
    output = options.output or (None if options.without_peer else OUTPUT)
    if output is not None:
        common.write_result(output, "sim_speed", body)
        print(f"\nwritten: {output}")
    return 0


def _camera_key(cameras: bool) -> str:
    return "three_cameras" if cameras else "no_cameras"


if __name__ == "__main__":
    raise SystemExit(main())
