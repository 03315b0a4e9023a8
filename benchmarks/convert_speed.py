"""Our converter beside LeRobot's own recording path, the official method, the encoder alone and the renderer alone.

One set of demonstrations of a kitchen task, recorded here, is converted by all; robosuite's Lift demonstrations by ours
and by the official method, re-enacted in robosuite's own virtual environment. Repetitions take turns, so that whatever
else the machine does hits all; medians count. The first run records the demonstrations and makes the environment.

    python benchmarks/convert_speed.py --quick
"""

from __future__ import annotations

import argparse
import contextlib
import json
import shutil
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import common
import convert_demos
import convert_report
from convert_demos import DemoFiles
from convert_memory import run_command
from convert_sections import SECTIONS, chosen_sections, merged
from sim_speed import note_noise
from venvs import prepare_venv
from workers import BARRIER_S, Worker, WorkerError

from robocasa_lerobot import contract, gl
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.progress import Bar

BENCHMARKS = Path(__file__).parent
OUTPUT = common.RESULTS / "convert_speed.json"
WORK = common.REPOSITORY / "outputs" / "convert_speed"
PROGRAM = BENCHMARKS / "convert_work.py"
PNG_THREADS = 4
SMALL_PIXELS = 64  # of a newcomer's datasets: the demo's and the study's


@dataclass(frozen=True)
class Effort:
    """How much is converted, and how often. `slow_repetitions` are those of LeRobot's and of the official way."""

    episodes: int
    repetitions: int
    slow_repetitions: int
    lift_steps: int  # of each of the three demonstrations
    memory_episodes: tuple[int, ...]
    decode_batches: int
    image_size: int = contract.IMAGE_SIZE


FULL = Effort(24, 3, 1, 160, (10, 100, 1000), 40)
QUICK = Effort(10, 2, 1, 100, (10, 100, 300), 20)


@dataclass
class Run:
    """Processes, files and what has been measured so far."""

    work: Path
    files: DemoFiles
    lift: Path | None
    assets: Path | None  # that its scenes name
    effort: Effort
    bar: Bar
    workers: list[Worker] = field(default_factory=list)
    peer: Worker | None = None
    rates: dict[str, list[float]] = field(default_factory=dict)
    sizes: dict[str, float] = field(default_factory=dict)
    cpu_ms: dict[str, list[float]] = field(default_factory=dict)  # a step, of what one process does
    loading: list[tuple[float, float, int]] = field(default_factory=list)  # opening, drawing, demos
    noise: list[float] = field(default_factory=list)

    def place(self, name: str) -> str:
        """A folder for what a part writes."""
        return str(self.work / "written" / name)


def parse(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """The command's options."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="less and less often: about 10 minutes")
    parser.add_argument(
        "--output", type=Path, help=f"JSON file to write; default: {OUTPUT.relative_to(common.REPOSITORY)}"
    )
    parser.add_argument(
        "--work",
        type=Path,
        default=WORK,
        help=f"folder for demonstrations, kept, and datasets; default: {WORK.relative_to(common.REPOSITORY)}",
    )
    parser.add_argument("--without-peer", action="store_true", help="leave the official method out")
    parser.add_argument("--without-memory", action="store_true", help="leave whole commands and their memory out")
    parser.add_argument(
        "--only",
        metavar="SECTIONS",
        help=f"measure some of {', '.join(SECTIONS)} again, separated by commas; a result keeps the others' figures",
    )
    return parser.parse_args(arguments)


def measure(effort: Effort, work: Path, peer: bool, memory: bool, sections: Sequence[str] = SECTIONS) -> dict[str, Any]:
    """Everything, or some sections of it, as the body of the result."""
    data = work / "demos"
    files = convert_demos.record(data, effort.episodes, max(convert_report.PROCESSES), effort.image_size)
    assets = convert_demos.lift_assets() if peer else None
    lift = convert_demos.cut_lift(data, effort.lift_steps, assets) if assets is not None else None
    shutil.rmtree(work / "written", ignore_errors=True)
    parts = [part for part in _parts(peer) if part.key.partition("_")[0] in sections]
    total = sum(effort.slow_repetitions if part.slow else effort.repetitions for part in parts)
    total += 2 + (len(effort.memory_episodes) + 4 if memory else 0)
    with contextlib.ExitStack() as stack:
        run = Run(work, files, lift, assets, effort, stack.enter_context(Bar(total=total, unit="part", smoothing=0)))
        startup, said = _start(run, stack)
        _repeat(run, parts)
        # The measuring processes end first: what they hold in memory is not the command's.
    with Bar(total=len(effort.memory_episodes) + 4, unit="command", disable=not memory) as bar:
        run.bar = bar
        commands = _commands(run) if memory else {}
        peaks = _memory(run) if memory else {}
    shutil.rmtree(work / "written", ignore_errors=True)
    rates = {key: common.spread(run.rates[key]) for key in convert_report.ROWS if key in run.rates}
    opening, drawing, demos = (sum(column) for column in zip(*run.loading, strict=True)) if run.loading else (0, 1, 1)
    return {
        "ratios": convert_report.ratios(rates, peaks),
        "frames_per_second": rates,
        "cpu_ms_per_step": {key: common.spread(values) for key, values in run.cpu_ms.items()},
        "commands": commands,
        "memory": peaks,
        "startup": startup,
        "scene_loading": {"seconds_per_demo": opening / demos, "share_of_drawing": opening / drawing},
        "dataset_mib": run.sizes,
        "demos": {"task": convert_demos.TASK, "lengths": list(files.lengths.values()), "frames": files.frames},
        "peer": said,
        "others_share_of_cores": common.spread(run.noise) if run.noise else None,
        "effort": asdict(effort),
    }


@dataclass(frozen=True)
class Part:
    """One thing that is measured, again and again."""

    key: str
    measure: Callable[[Run], float]
    slow: bool = False


def _parts(peer: bool) -> list[Part]:
    parts = []
    for n in convert_report.PROCESSES:
        parts.append(Part(f"images_ours_{n}", partial(_ours, kind="images", processes=n)))
        parts.append(Part(f"images_encoder_{n}", partial(_encoder, processes=n)))
        parts.append(Part(f"states_ours_{n}", partial(_ours, kind="states", processes=n)))
        parts.append(Part(f"states_renderer_{n}", partial(_renderer, processes=n)))
        parts.append(Part(f"small_ours_{n}", partial(_ours, kind="small", processes=n, size=SMALL_PIXELS)))
        if peer:
            parts.append(Part(f"lift_ours_{n}", partial(_lift_ours, key=f"lift_ours_{n}", processes=n)))
    parts.append(Part("images_lerobot", partial(_lerobot, kind="images"), slow=True))
    parts.append(Part("images_lerobot_alike", partial(_lerobot, kind="images", alike=True), slow=True))
    parts.append(Part("states_lerobot", partial(_lerobot, kind="states"), slow=True))
    parts.append(Part("decode_ours", partial(_decode, ours=True)))
    parts.append(Part("decode_lerobot", partial(_decode, ours=False)))
    if peer:
        shadows = partial(_lift_ours, key="lift_ours_quality", processes=1, preset="quality")
        parts.append(Part("lift_ours_quality", shadows, slow=True))
        parts.append(Part("lift_official", _official, slow=True))
    return parts


def _repeat(run: Run, parts: Sequence[Part]) -> None:
    effort = run.effort
    for repetition in range(effort.repetitions):
        # Who goes first alternates: a slow drift of the machine favours nobody. What is decoded must be there first.
        backwards = repetition % 2 == 1
        for part in reversed(parts) if backwards else parts:
            if part.slow and repetition >= effort.slow_repetitions:
                continue
            run.bar.set_description(part.key)
            note_noise(run.noise)
            run.rates.setdefault(part.key, []).append(part.measure(run))
            run.bar.update()


def _start(run: Run, stack: contextlib.ExitStack) -> tuple[dict[str, float], dict[str, Any]]:
    """Start the processes, let each do its work once where nothing is counted, and give what starting took."""
    run.bar.set_description("starting")
    for i in range(max(convert_report.PROCESSES)):
        run.workers.append(stack.enter_context(Worker(f"ours {i}", Path(sys.executable), PROGRAM)))
    said: dict[str, Any] = {}
    if run.lift is not None:
        program = BENCHMARKS / "peers" / "robosuite_convert.py"
        run.peer = stack.enter_context(Worker("robosuite", prepare_venv("robosuite"), program))
        said = run.peer.ask("make", cameras=list(convert_demos.LIFT_CAMERAS), size=contract.IMAGE_SIZE)
        said |= {"png_threads": PNG_THREADS}
    run.bar.update()
    first = run.workers[0]
    # Its 800 frames make several shards, so that two processes are used.
    tiny = convert_demos.tiny(run.work / "demos", 100)
    seconds = [first.ask("convert", file=str(tiny), out=run.place("tiny"), workers=2)["seconds"] for _ in range(2)]
    startup = {"process_s": run.workers[1].startup_s, "two_workers_s": max(0.0, seconds[0] - seconds[1])}
    reference = run.place("reference")
    first.ask("convert", file=str(run.files.images), out=reference, workers=1)
    hands = convert_demos.deal(run.files.lengths, 2)
    for worker, demos in zip(run.workers, (list(run.files.lengths), hands[1]), strict=True):
        worker.ask("load_pictures", file=str(run.files.images), demos=demos, reference=reference)
        worker.ask("encode", demos=demos[:1], folder=run.place("warm"), at=0.0)
        worker.ask("render", file=str(run.files.states), demos=hands[0][-1:], at=0.0)
    run.bar.update()
    return startup, said


def _ours(run: Run, kind: str, processes: int, size: int | None = None) -> float:
    file = run.files.images if kind == "images" else run.files.states
    key = f"{kind}_ours_{processes}"
    answer = run.workers[0].ask("convert", file=str(file), out=run.place(key), workers=processes, size=size)
    return _rate(run, key, answer)


def _lerobot(run: Run, kind: str, alike: bool = False) -> float:
    file = run.files.images if kind == "images" else run.files.states
    key = f"{kind}_lerobot{'_alike' if alike else ''}"
    answer = run.workers[0].ask(
        "record_with_lerobot",
        file=str(file),
        reference=run.place("reference"),
        out=run.place(key),
        render=kind == "states",
        alike=alike,
    )
    return _rate(run, key, answer)


def _encoder(run: Run, processes: int) -> float:
    hands = convert_demos.deal(run.files.lengths, processes)
    at = time.perf_counter() + BARRIER_S
    workers = run.workers[:processes]
    for i, (worker, demos) in enumerate(zip(workers, hands, strict=True)):
        worker.send("encode", demos=demos, folder=run.place(f"encoder_{i}"), at=at)
    return _sum_of_rates(run, f"images_encoder_{processes}", [worker.receive() for worker in workers])


def _renderer(run: Run, processes: int) -> float:
    hands = convert_demos.deal(run.files.lengths, processes)
    at = time.perf_counter() + BARRIER_S
    workers = run.workers[:processes]
    for worker, demos in zip(workers, hands, strict=True):
        worker.send("render", file=str(run.files.states), demos=demos, at=at)
    answers = [worker.receive() for worker in workers]
    if processes == 1:
        run.loading.append((answers[0]["loading_s"], answers[0]["seconds"], len(hands[0])))
    with_opening = sum(answer["frames"] / (answer["seconds"] + answer["loading_s"]) for answer in answers)
    run.rates.setdefault(f"states_scenes_{processes}", []).append(with_opening)
    return _sum_of_rates(run, f"states_renderer_{processes}", answers)


def _lift_ours(run: Run, key: str, processes: int, preset: str = "fast") -> float:
    answer = run.workers[0].ask(
        "convert",
        file=str(run.lift),
        out=run.place(key),
        workers=processes,
        cameras=list(convert_demos.LIFT_CAMERAS),
        asset_roots=[str(run.assets)],
        preset=preset,
    )
    return _rate(run, key, answer)


def _official(run: Run) -> float:
    """Every state through the env and into PNG files, then the encoder over those: both halves' seconds."""
    assert run.lift is not None
    assert run.peer is not None
    folder = Path(run.place("png"))
    shutil.rmtree(folder, ignore_errors=True)
    states = convert_demos.states_for_peer(run.lift)
    pictures = run.peer.ask("pictures", states=str(states), folder=str(folder), threads=PNG_THREADS)
    videos = run.workers[0].ask("encode_png", folder=str(folder), out=run.place("official"))
    return float(pictures["frames"] / (pictures["seconds"] + videos["seconds"]))


def _decode(run: Run, ours: bool) -> float:
    seed = len(run.rates.get("decode_ours" if ours else "decode_lerobot", ()))  # the same batches of both
    root = run.place("images_ours_1" if ours else "images_lerobot")
    answer = run.workers[1].ask("decode", root=root, batches=run.effort.decode_batches, seed=seed)
    assert answer["cameras"] == len(contract.CAMERAS)
    return _sum_of_rates(run, "decode_ours" if ours else "decode_lerobot", [answer])


def _rate(run: Run, key: str, answer: dict[str, Any]) -> float:
    run.sizes[key] = answer["mib"]
    return _sum_of_rates(run, key, [answer])


def _sum_of_rates(run: Run, key: str, answers: Sequence[dict[str, Any]]) -> float:
    """Each process's own rate, added: one that had less to do and ended earlier takes nothing from the sum."""
    if not key.endswith("_2"):  # workers of a conversion are children of another process, which does not end
        cpu, frames = (sum(answer[word] for answer in answers) for word in ("cpu_s", "frames"))
        run.cpu_ms.setdefault(key, []).append(1000 * cpu / frames)
    return float(sum(answer["frames"] / answer["seconds"] for answer in answers))


def _commands(run: Run) -> dict[str, Any]:
    """The command as users give it, on both files, with one process and with two."""
    found = {}
    for kind, file in (("images", run.files.images), ("states", run.files.states)):
        for n in convert_report.PROCESSES:
            found[f"{kind}_{n}"] = _command(run, file, n) | {"frames": run.files.frames}
    return found


def _memory(run: Run) -> dict[str, Any]:
    """Peak memory by the number of episodes, all in one process: more of them would only be added to it."""
    counts = run.effort.memory_episodes
    return {str(count): _command(run, convert_demos.tiny(run.work / "demos", count), 1) for count in counts}


def _command(run: Run, file: Path, processes: int) -> dict[str, Any]:
    run.bar.set_description(f"convert {file.name}")
    out = Path(run.place("command"))
    shutil.rmtree(out, ignore_errors=True)
    note_noise(run.noise)
    found = run_command(["convert", str(file), "--out", str(out), "--workers", str(processes)])
    run.bar.update()
    return found


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print, write."""
    options = parse(arguments)
    output = options.output or OUTPUT
    try:
        backend = gl.ensure_gl()
        renderer = common.renderers(backend)
        effort = QUICK if options.quick else FULL
        sections = chosen_sections(options.only, output)
        if options.only and options.without_peer and "lift" in sections:
            raise UserError("--only lift --without-peer: the section is ours beside the peer; leave one of both out.")
        peer = not options.without_peer and "lift" in sections
        memory = not options.without_memory and options.only is None
        body = measure(effort, options.work.absolute(), peer, memory, sections)
    except (UserError, WorkerError) as error:
        print(f"convert_speed: {error}", file=sys.stderr)
        return 2
    body = {
        "mode": "quick" if options.quick else "full",
        "machine": {**common.machine(), "renderer": renderer},
        "versions": common.versions(
            "robocasa-lerobot", "lerobot", "torch", "torchcodec", "mujoco", "av", "h5py", "numpy"
        ),
        **body,
    }
    print(convert_report.report(body))
    if options.only is not None:
        body = merged(json.loads(output.read_text(encoding="utf-8")), body, sections)
    if options.only is not None or options.output is not None or (peer and memory):
        common.write_result(output, "convert_speed", body)
        print(f"\nwritten: {output}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
