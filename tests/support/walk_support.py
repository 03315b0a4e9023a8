"""What the walk through all experiments needs: their data as small fakes, a hub, and the commands that a user types."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from robocasa_lerobot.data.fake import write_fake_dataset
from robocasa_lerobot.data.mixture_config import MixtureConfig
from robocasa_lerobot.data.registry.registry import missing_datasets, select_datasets
from robocasa_lerobot.training.config.experiment import ExperimentConfig
from robocasa_lerobot.training.phases import is_finished
from robocasa_lerobot.training.planning.skipped import Skipped, read
from robocasa_lerobot.training.planning.unavailable import runnable

ROOT = Path(__file__).parents[2]
SCALE = ROOT / "configs/scales/tiny.yaml"
EPISODES, LENGTH, SIZE = 12, 6, 32  # of each task in a fake dataset: demonstrations, frames of each, pixels
DATE = "20250101"
_POLL = 0.005  # seconds


@dataclass
class Walked:
    """How an experiment went: minutes of wall time, and what the commands printed."""

    name: str
    phases: list[str]
    finished_before: list[str]  # by another experiment in the same folder
    killed_in: str | None = None
    minutes: float = 0.0
    output: str = ""
    results: list[Path] = field(default_factory=list)
    skipped: list[Skipped] = field(default_factory=list)  # another experiment in the same folder says other things


def write_datasets(work: Path, experiments: Iterable[ExperimentConfig]) -> dict[Path, tuple[str, ...]]:
    """Make every dataset that the experiments miss in the folder `work`, and tell the tasks of each.

    What is missing is what the mixtures and registries of their phases that can run say, in the working directory.
    """
    tasks: dict[Path, dict[str, None]] = {}
    for experiment in experiments:
        for phase in runnable(experiment)[0].phases:
            for place, task in _missing(phase.mixture):
                tasks.setdefault(place, {})[task] = None
    written: dict[tuple[str, ...], Path] = {}
    for place, names in tasks.items():
        own, target = tuple(sorted(names)), work / place
        if own in written:  # the same demonstrations in another place
            shutil.copytree(written[own], target)
            continue
        episodes = EPISODES * len(own)
        written[own] = write_fake_dataset(target, episodes, LENGTH, SIZE, seed=len(written), tasks=own, decisions=True)
    return {place: tuple(sorted(names)) for place, names in tasks.items()}


def _missing(mixture: MixtureConfig) -> Iterable[tuple[Path, str]]:
    """Folder and task of each dataset of the mixture that is not there."""
    for selection in mixture.select:
        for entry in select_datasets(selection):
            if not entry.missing:
                continue
            if entry.registered is None:  # a published one, of which the entry names the task's folder
                inner = DATE if entry.source == "human" else f"{DATE}/{entry.source}/demo/000000"
                yield entry.root / inner / selection.views, entry.task
            else:
                yield entry.root, entry.task
    for member in mixture.members:
        if missing_datasets(MixtureConfig(members=[member])):
            for task in member.tasks or ("OpenDrawer", "CloseDrawer"):
                yield Path(member.root), task


def write_hub(home: Path) -> Path:
    """The fake cache of the hub, written by a process of its own: its policies need what `tiny_gemma` registers."""
    subprocess.run(
        [sys.executable, str(ROOT / "tests/support/walk_hub.py"), str(home)], env=environment(home), check=True
    )
    return home


def environment(home: Path) -> dict[str, str]:
    """The environment of the commands: this checkout, the fake hub and no network."""
    path = [str(ROOT), str(ROOT / "tests/support/tiny_gemma"), *os.environ.get("PYTHONPATH", "").split(os.pathsep)]
    own = {"PYTHONPATH": os.pathsep.join(filter(None, dict.fromkeys(path))), "PYTHONUNBUFFERED": "1"}
    return {**os.environ, **own, "HF_HOME": str(home), "HF_HUB_OFFLINE": "1", "OMP_NUM_THREADS": "1"}


class Walker:
    """Runs experiments in the folder `work`, with a hub at `home`."""

    def __init__(self, work: Path, home: Path) -> None:
        self.work, self.home = work, home

    def walk(self, path: Path, experiment: ExperimentConfig, name: str, seconds: float) -> Walked:
        """Train and evaluate the experiment of a file, killed once in the middle, and report.

        `experiment` is what the file says at this scale. Raises an AssertionError with the output of what failed.
        """
        began, out = time.monotonic(), self.work / experiment.output_dir
        phases = runnable(experiment)[0].phases
        before = [phase.name for phase in phases if is_finished(out, phase)]
        walked = Walked(name, [phase.name for phase in phases], before)
        log = self.work / f"{name.replace('/', '__')}.log"
        command = [str(ROOT / "train.py"), "--config_path", str(path), "--evaluate", "--scale", str(SCALE)]
        ahead = [phase for phase in phases if phase.name not in before]
        if ahead:
            middle = ahead[len(ahead) // 2]
            if self._run(command, log, seconds, kill_at=out / middle.name / f"checkpoints/{middle.save_every:06d}"):
                walked.killed_in = middle.name
        self._run(command, log, seconds)
        walked.skipped = read(out)
        walked.output = log.read_text(encoding="utf-8")
        found = [results for phase in phases for results in (out / phase.name / "evaluations").glob("*/trials.jsonl")]
        walked.results = sorted(results.parent for results in found)
        if walked.results:
            self.report(walked.results, log.with_suffix(".html"), seconds)
        walked.minutes = (time.monotonic() - began) / 60
        return walked

    def report(self, results: Sequence[Path], out: Path, seconds: float) -> None:
        """`robocasa-lerobot report` of the results."""
        command = ["-m", "robocasa_lerobot.cli", "report", *map(str, results), "--out", str(out)]
        self._run(command, out.with_name(f"{out.stem}.report.log"), seconds)

    def _run(self, arguments: Sequence[str], log: Path, seconds: float, kill_at: Path | None = None) -> bool:
        """Run a command to its end, or kill it as soon as the folder `kill_at` is there; returns whether it was."""
        with log.open("a", encoding="utf-8") as out:
            process = subprocess.Popen(
                [sys.executable, *arguments],
                cwd=self.work,
                env=environment(self.home),
                stdout=out,
                stderr=subprocess.STDOUT,
                start_new_session=True,  # a kill takes the processes that it started along, as a machine's end does
            )
            until = time.monotonic() + seconds
            try:
                while process.poll() is None and time.monotonic() < until:
                    if kill_at is not None and kill_at.is_dir():
                        return True
                    time.sleep(_POLL if kill_at is not None else 0.1)
            finally:
                if process.poll() is None:
                    os.killpg(process.pid, signal.SIGKILL)
                    status: int | str = process.wait() if kill_at is None else "killed"
                else:
                    status = process.returncode
        assert status == 0, f"{' '.join(arguments)} ended with {status}:\n{log.read_text(encoding='utf-8')[-4000:]}"
        return False


def steps_of(folder: Path) -> list[int]:
    """The steps of a phase's metrics, in the order of the lines."""
    return [json.loads(line)["step"] for line in (folder / "metrics.jsonl").read_text().splitlines()]


def write_log(walked: Iterable[Walked]) -> None:
    """File, phases, evaluations and minutes of what was walked, at $WALK_LOG (.md), and for machines beside it."""
    target, found = os.environ.get("WALK_LOG"), list(walked)
    if not target or not found:
        return
    rows = [(w.name, len(w.phases), len(w.results), w.killed_in or "-", f"{w.minutes:.1f}") for w in found]
    lines = ["| file | phases | evaluations | killed in | minutes |", "|---|---|---|---|---|"]
    lines += [f"| {' | '.join(map(str, row))} |" for row in rows]
    total = sum(w.minutes for w in found)
    lines.append(
        f"| {len(rows)} files | {sum(row[1] for row in rows)} | {sum(row[2] for row in rows)} | | {total:.1f} |"
    )
    Path(target).parent.mkdir(parents=True, exist_ok=True)
    Path(target).write_text("\n".join(lines) + "\n", encoding="utf-8")
    keys = ("file", "phases", "evaluations", "killed_in", "minutes")
    data = [dict(zip(keys, (*row[:4], float(row[4])), strict=True)) for row in rows]
    Path(target).with_suffix(".json").write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
