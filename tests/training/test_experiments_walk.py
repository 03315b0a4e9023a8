"""The whole walk: every experiment file from its first step to a report, as a user runs it.

Each file is run by `python train.py --config_path FILE --evaluate --scale configs/scales/tiny.yaml` in a process of its
own, killed once in the middle, given again, and reported. Its data are small fakes of what the file says it reads, the
hub is a cache of tiny models with the published names and formats, and nothing of the project is patched. `make walk`
runs it, with a log of file, phases and minutes.
"""

from __future__ import annotations

import dataclasses
import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

import pytest
import walk_hub
from walk_numbers import expected_cells, shown_cells, with_known_numbers
from walk_support import (
    EPISODES,
    LENGTH,
    ROOT,
    SCALE,
    Walked,
    Walker,
    environment,
    steps_of,
    write_datasets,
    write_hub,
    write_log,
)

from robocasa_lerobot.benchmark import published
from robocasa_lerobot.benchmark.tasks import published_task_sets
from robocasa_lerobot.data.registry.published import PUBLISHED
from robocasa_lerobot.data.registry.registry import select_datasets
from robocasa_lerobot.evaluation.records.results import read_results
from robocasa_lerobot.training.config.experiment import ExperimentConfig, load_experiment
from robocasa_lerobot.training.config.phase import PhaseConfig
from robocasa_lerobot.training.config.scale import load_scale
from robocasa_lerobot.training.planning.evaluations import phase_evaluations
from robocasa_lerobot.training.planning.skipped import PHASE
from robocasa_lerobot.training.planning.unavailable import runnable

EXPERIMENTS = ROOT / "configs/experiments"
PATHS = sorted(path for path in EXPERIMENTS.rglob("*.yaml") if "parts" not in path.relative_to(EXPERIMENTS).parts)
COLUMN_BYTES = 113  # of a frame's states, actions and other numbers
# Runs a command and prints the most memory that it took, in gigabytes.
LIMITED = """
import resource, subprocess, sys
status = subprocess.call(sys.argv[1:])
print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1e6)
sys.exit(status)
"""
AT_ONCE = 2  # experiments that run beside each other
SECONDS = 1800  # for one experiment; the other of the two may be the slower one
pytestmark = [pytest.mark.slow, pytest.mark.render]


def name_of(path: Path) -> str:
    return path.relative_to(EXPERIMENTS).with_suffix("").as_posix()


def scaled(path: Path) -> ExperimentConfig:
    return load_experiment(path, scale=str(SCALE))


@dataclasses.dataclass
class Walk:
    """Experiments under way: what each came to, and the folder that all run in."""

    walker: Walker
    found: dict[Path, Future[Walked]]

    def run(self, members: dict[Path, ExperimentConfig]) -> None:
        for path, experiment in members.items():
            if not self.found[path].set_running_or_notify_cancel():
                continue
            try:
                self.found[path].set_result(self.walker.walk(path, experiment, name_of(path), SECONDS))
            except BaseException as error:  # the test of this file raises it
                self.found[path].set_exception(error)

    def of(self, path: Path) -> Walked:
        return self.found[path].result()


@pytest.fixture(scope="module")
def walk(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Walk]:
    """The walk through the files that were asked for, two at once; all data lie in one working directory."""
    asked = {item.callspec.params.get("path") for item in request.session.items if hasattr(item, "callspec")}
    experiments = {path: scaled(path) for path in PATHS if path in asked}
    base = tmp_path_factory.mktemp("walk")
    work, before = base / "work", Path.cwd()
    work.mkdir()
    os.chdir(work)  # registries count from the working directory
    try:
        write_datasets(work, experiments.values())
    finally:
        os.chdir(before)
    walk = Walk(Walker(work, write_hub(base / "hub")), {path: Future() for path in experiments})
    with ThreadPoolExecutor(AT_ONCE) as pool:
        running = [pool.submit(walk.run, members) for members in groups(experiments)]
        yield walk
        for future in (*running, *walk.found.values()):
            future.cancel()
    write_log(f.result() for f in walk.found.values() if f.done() and not f.cancelled() and not f.exception())


def groups(experiments: dict[Path, ExperimentConfig]) -> list[dict[Path, ExperimentConfig]]:
    """Experiments that share a folder, one after the other; the groups with most phases come first."""
    found: dict[str, dict[Path, ExperimentConfig]] = {}
    for path, experiment in experiments.items():
        found.setdefault(experiment.output_dir, {})[path] = experiment
    return sorted(found.values(), key=lambda group: -sum(len(one.phases) for one in group.values()))


@pytest.mark.timeout(2 * 3600)
@pytest.mark.parametrize("path", PATHS, ids=name_of)
def test_experiment_walks(path: Path, walk: Walk) -> None:
    walked, whole = walk.of(path), load_experiment(path)
    experiment, left_out = runnable(scaled(path))
    out = walk.walker.work / experiment.output_dir
    if walked.finished_before != walked.phases:
        assert walked.killed_in is not None, "it ended before the kill"
        assert f"phase {walked.killed_in}: going on from step" in walked.output
    skipped = walked.skipped
    assert {item.phase for item in skipped if item.kind == PHASE} == {i.phase for i in left_out if i.kind == PHASE}
    for phase in experiment.phases:
        folder = out / phase.name
        assert (folder / f"checkpoints/{phase.steps:06d}/pretrained_model/model.safetensors").is_file()
        assert steps_of(folder) == list(range(1, phase.steps + 1))
        if path.parent.name == "robocasa365" and beyond_memory(whole.phase(phase.name), 2.0):
            assert list((out / "frame_cache").glob("*.npy")), "what is beyond memory at full size has to be here"
        for evaluation in phase_evaluations(phase):
            results = folder / "evaluations" / evaluation.file.stem
            if any((item.phase, item.evaluation) == (phase.name, evaluation.file.stem) for item in skipped):
                continue
            trials = read_results(results).trials
            assert trials
            assert {trial.error for trial in trials} == {None}


@pytest.mark.timeout(2 * 3600)
@pytest.mark.parametrize("kind", ["robocasa365", "small"])
def test_every_number_stands_in_its_row_and_published_column(kind: str, walk: Walk, tmp_path: Path) -> None:
    """One report of all that was walked of a kind, with successes that tell every policy and task apart."""
    folders = {f: None for path in walk.found if path.parent.name == kind for f in walk.of(path).results}
    if not folders:
        pytest.skip(f"no experiment of {kind} was asked for")
    known = with_known_numbers(list(folders), tmp_path / "known")
    walk.walker.report(known, tmp_path / "report.html", SECONDS)
    shown, expected = shown_cells(tmp_path / "report_tables.csv"), expected_cells(known)
    assert expected
    assert {key: round(value, 3) for key, value in shown.items()} == pytest.approx(expected, abs=1e-3)


def test_limits_shrink_with_the_data() -> None:
    """The fakes of two tasks of the human data, as a share of all of its frames."""
    ours = (load_scale(str(SCALE)).tasks_per_set or 0) * EPISODES * LENGTH
    assert load_scale(str(SCALE)).data_share == pytest.approx(ours / full_frames("pretrain", "human"), rel=0.1)


def full_frames(split: str, source: str) -> float:
    """Frames of the published data, at 20 a second."""
    settings = {("pretrain", "human"): "pretraining, human", ("target", "human"): "target, human"}
    setting = settings.get((split, source), "pretraining, MimicGen")
    return next(row["hours"] for row in published.read("data")["rows"] if row["setting"] == setting) * 3600 * 20


def beyond_memory(phase: PhaseConfig, limit_gb: float) -> bool:
    """Whether states and actions of a phase, with its published data, are more than the loader keeps in memory."""
    total = 0.0
    for part in phase.mixture.select:
        tasks = {entry.task for entry in select_datasets(part)}
        of_all = published_task_sets()[PUBLISHED[str(part.split), str(part.source)]]
        share = float(str(part.demos or "100%").removesuffix("%")) / 100
        total += full_frames(str(part.split), str(part.source)) * len(tasks & {*of_all}) / len(of_all) * share
    return total * COLUMN_BYTES > limit_gb * 1e9


@pytest.mark.timeout(2 * 3600)
@pytest.mark.parametrize("kind", ["pi0", "pi05"])
def test_the_real_sizes_are_planned_without_memory_for_them(kind: str, tmp_path: Path) -> None:
    """Of the repository on the hub nothing but its configuration is there, as before a download."""
    snapshot = tmp_path / f"hub/models--lerobot--{kind}_base/snapshots/{walk_hub.COMMIT}"
    snapshot.mkdir(parents=True)
    (snapshot.parents[1] / "refs").mkdir()
    (snapshot.parents[1] / "refs/main").write_text(walk_hub.COMMIT)
    cameras = {f"observation.images.{name}": walk_hub.VISION for name in walk_hub.PI_CAMERAS}
    state, action = ({"type": name, "shape": [32]} for name in ("STATE", "ACTION"))
    config = {
        "input_features": {**cameras, "observation.state": state},
        "output_features": {"action": action},
        **{"type": kind, "paligemma_variant": "gemma_2b", "action_expert_variant": "gemma_300m"},
    }
    (snapshot / "config.json").write_text(json.dumps(config))
    command = [sys.executable, str(ROOT / "train.py"), "--plan", "--measure=0", "--device=cpu"]
    command += ["--config_path", str(EXPERIMENTS / f"robocasa365/multitask_{kind}.yaml")]
    limited = [sys.executable, "-c", LIMITED, *command]
    done = subprocess.run(limited, cwd=tmp_path, env=environment(tmp_path), capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-3000:]
    millions = re.search(r"parameters: ([\d,.]+) M", done.stdout)
    assert millions is not None, done.stdout[:3000]
    assert 3_300 < float(millions[1].replace(",", "")) < 4_500
    assert float(done.stdout.splitlines()[-1]) < 4, "gigabytes of memory: less than the weights alone"
