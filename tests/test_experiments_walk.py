"""The whole walk: every experiment file from its first step to a report, as a user runs it.

Each file is run by `python train.py --config_path FILE --evaluate --scale configs/scales/tiny.yaml` in a process of its
own, killed once in the middle, given again, and reported. Its data are small fakes of what the file says it reads, the
hub is a cache of tiny models with the published names and formats, and nothing of the project is patched. `make walk`
runs it, with a log of file, phases and minutes.
"""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

import pytest
from walk_support import EPISODES, LENGTH, ROOT, SCALE, Walked, Walker, steps_of, write_datasets, write_hub, write_log

from robocasa_lerobot.evaluation import published
from robocasa_lerobot.training.config import ExperimentConfig, load_experiment
from robocasa_lerobot.training.scale import load_scale
from robocasa_lerobot.training.skipped import PHASE, read

EXPERIMENTS = ROOT / "configs/experiments"
PATHS = sorted(path for path in EXPERIMENTS.rglob("*.yaml") if "parts" not in path.relative_to(EXPERIMENTS).parts)
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

    def of(self, path: Path) -> Walked:
        return self.found[path].result()


@pytest.fixture(scope="module")
def walk(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Walk]:
    """The walk through the files that were asked for, two at once; all data lie in one working directory."""
    asked = {item.callspec.params.get("path") for item in request.session.items if hasattr(item, "callspec")}
    paths = [path for path in PATHS if path in asked]
    base = tmp_path_factory.mktemp("walk")
    work, before = base / "work", Path.cwd()
    work.mkdir()
    experiments = {path: scaled(path) for path in paths}
    os.chdir(work)  # registries count from the working directory
    try:
        write_datasets(work, experiments.values())
    finally:
        os.chdir(before)
    walker = Walker(work, write_hub(base / "hub"))
    with ThreadPoolExecutor(AT_ONCE) as pool:
        found = {path: pool.submit(walker.walk, path, experiments[path], SECONDS) for path in paths}
        yield Walk(walker, found)
        for future in found.values():
            future.cancel()
    write_log({name_of(p): f.result() for p, f in found.items() if not f.cancelled() and not f.exception()})


@pytest.mark.timeout(2 * 3600)
@pytest.mark.parametrize("path", PATHS, ids=name_of)
def test_experiment_walks(path: Path, walk: Walk) -> None:
    walked, experiment = walk.of(path), scaled(path)
    out = walk.walker.work / experiment.output_dir
    left_out = {item.phase for item in read(out) if item.kind == PHASE}
    assert walked.killed_in is not None, "it ended before the kill"
    assert f"phase {walked.killed_in}: going on from step" in walked.output
    for phase in experiment.phases:
        if phase.name in left_out:
            assert not (out / phase.name / "checkpoints").exists()
            continue
        assert (out / phase.name / f"checkpoints/{phase.steps:06d}/pretrained_model/model.safetensors").is_file()
        assert steps_of(out / phase.name) == list(range(1, phase.steps + 1))


def test_limits_shrink_with_the_data() -> None:
    """The fakes of two tasks of the human data, as a share of all of its frames."""
    hours = {row["setting"]: row["hours"] for row in published.read("data")["rows"]}
    frames = hours["pretraining, human"] * 3600 * 20
    ours = load_scale(str(SCALE)).tasks_per_set * EPISODES * LENGTH
    assert load_scale(str(SCALE)).data_share == pytest.approx(ours / frames, rel=0.1)
