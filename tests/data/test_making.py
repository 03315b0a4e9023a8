"""`robocasa-lerobot data`: what an experiment needs, what is missing, and making it after a kill too."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import h5py
import pytest
import v2_support as v2
import yaml
from slurm_support import stand_in

from robocasa_lerobot import cli
from robocasa_lerobot.data.fake import write_fake_dataset
from robocasa_lerobot.data.registry.published import dataset_version
from robocasa_lerobot.demos.generate.settings import GenerationSettings
from robocasa_lerobot.demos.generate.sources import prepare
from robocasa_lerobot.demos.recording import RecordingResult, RecordingSettings, record_tasks
from robocasa_lerobot.errors import WorkerDiedError
from robocasa_lerobot.jobs.publish import held_lock
from robocasa_lerobot.making import estimate
from robocasa_lerobot.making.downloads import find_downloads
from robocasa_lerobot.making.make import SOURCES
from robocasa_lerobot.making.needs import WORK, needs_of, parse_episodes
from robocasa_lerobot.training.config.experiment import load_experiment

ROOT = Path(__file__).parents[2]
EXPERIMENTS = ROOT / "configs/experiments"
KITCHENS = EXPERIMENTS / "parts/kitchens.yaml"
SIMULATED = sorted(
    path for path in (EXPERIMENTS / "small").glob("*.yaml") if path.stem not in ("real_only", "sim_and_real")
)


@pytest.fixture(autouse=True)
def in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def experiment_on(tmp_path: Path, *selections: dict[str, object], tasks: tuple[str, ...] = ("CloseDrawer",)) -> Path:
    """An experiment whose datasets are those of our kitchens, of few tasks."""
    sets = {key: list(tasks) for key in ("pretrain300", "target50", "mimicgen60")}
    (tmp_path / "registry.yaml").write_text(yaml.safe_dump({"base": str(KITCHENS), "task_sets": sets}))
    content = {
        "name": "few",
        "output_dir": "out",
        "registry": str(tmp_path / "registry.yaml"),
        "policy": {"type": "act"},
        "phases": [{"name": "train", "steps": 1, "mixture": {"select": [dict(s) for s in selections]}}],
    }
    (tmp_path / "few.yaml").write_text(yaml.safe_dump(content))
    return tmp_path / "few.yaml"


def published_experiment() -> Path:
    """An experiment on what people have shown of two tasks, as it is published."""
    selection = {"tasks": ["OpenDrawer", "CloseDrawer"], "split": "pretrain", "source": "human"}
    content = {
        "name": "published",
        "output_dir": "out",
        "policy": {"type": "act"},
        "phases": [{"name": "train", "steps": 1, "mixture": {"select": [selection]}}],
    }
    Path("published.yaml").write_text(yaml.safe_dump(content))
    return Path("published.yaml")


HUMAN: dict[str, object] = {"task_set": "pretrain300", "split": "pretrain", "source": "human"}
REDRAWN: dict[str, object] = {**HUMAN, "views": "lerobot_cotraining_cams"}


@pytest.mark.parametrize("path", SIMULATED, ids=lambda path: path.stem)
def test_all_that_a_small_experiment_needs_can_be_made_here(path: Path) -> None:
    needs, said = needs_of(load_experiment(path))
    assert needs
    assert all(need.made is not None and need.demonstrations for need in needs)
    assert len({need.root for need in needs}) == len(needs)
    hours = estimate.estimate(needs, cores=2)
    assert hours.recording_hours + hours.converting_hours < 8  # a night of a laptop with two cores, at the most
    # Phases wait for tasks, or have some of theirs, or start earlier because the one before them waits.
    expected = ("is in this version yet", "are in this version", "is left out")
    assert all(any(text in item.reason for text in expected) for item in said)


@pytest.mark.usefixtures("atomic_only")
def test_hours_and_disk_come_first_and_check_says_it_with_its_status(capsys: pytest.CaptureFixture[str]) -> None:
    file = str(EXPERIMENTS / "small/foundation.yaml")
    assert cli.main(["data", file, "--workers", "2", "--episodes", "human=100,mg=10000,target=500"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "experiment small_foundation: 143 dataset(s), 0 there (0 MB)"
    assert "615,500 demonstrations in 143 dataset(s), about 60.8 h of recording and 97.6 h" in lines[1]
    assert any(line.startswith("pretrain/mg/{task}") and "600,000" in line for line in lines)
    assert any("composite_seen_10 is left out" in line for line in lines)
    assert f"robocasa-lerobot data {file} --make --episodes human=100,mg=10000,target=500" in lines[-1]
    assert cli.main(["data", file, "--check"]) == 1
    assert not Path("datasets").exists()


@pytest.mark.usefixtures("atomic_only")
def test_hours_count_the_sources_of_what_is_multiplied() -> None:
    experiment = load_experiment(EXPERIMENTS / "small/foundation.yaml")
    alone = estimate.SECONDS_PER_DEMONSTRATION["atomic"]
    source = alone + estimate.PREPARING_SECONDS_PER_STEP * estimate.STEPS_PER_DEMONSTRATION["atomic"]
    for asked, sources in ((40, 10), (3, 3)):  # ten, but no more than what is to come of them
        needs = needs_of(experiment, {"human": 1, "mg": asked, "target": 1})[0]
        mg, others = [need for need in needs if need.source == "mg"], [need for need in needs if need.source != "mg"]
        assert len(mg) == 60
        seconds = 60 * (asked * alone + sources * source)
        assert estimate.estimate(mg, 1).recording_hours == pytest.approx(seconds / 3600)
        assert estimate.estimate(others, 1).recording_hours == pytest.approx(len(others) * alone / 3600)


def test_published_data_name_their_command_and_page(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["data", str(EXPERIMENTS / "robocasa365/foundation.yaml")]) == 0
    said = capsys.readouterr().out
    assert "to download: 410 dataset(s)" in said
    assert "python -m robocasa.scripts.download_datasets --split pretrain --source mimicgen" in said
    assert "https://robocasa.ai/docs/" in said
    assert "robocasa-lerobot data --convert datasets" in said
    assert cli.main(["data", str(EXPERIMENTS / "robocasa365/scene_diversity_5.yaml")]) == 0
    said = capsys.readouterr().out
    assert "no download of mg_5x1 is known" in said
    assert "to download: 18 dataset(s)" in said


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--episodes", "humans=2"], "Did you mean 'human'"),
        (["--episodes", "human"], "is not KIND=NUMBER"),
        (["--episodes", "human=0"], "is not KIND=NUMBER"),
        (["--workers", "0"], "expected at least 1"),
        (["--phases.train.step=2"], "steps"),
        (["--convert", "nowhere"], "no folder nowhere"),
    ],
)
def test_mistakes_are_told(
    tmp_path: Path, options: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["data", str(experiment_on(tmp_path, HUMAN)), *options]) == 2
    assert message in capsys.readouterr().err
    assert cli.main(["data"]) == 2


def test_what_is_there_is_counted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = experiment_on(tmp_path, HUMAN)
    root = Path("datasets/kitchens/pretrain/human/CloseDrawer")
    write_fake_dataset(root, episodes=3, length=4, image_size=32, tasks=["CloseDrawer"])
    assert cli.main(["data", str(file), "--check"]) == 0
    said = capsys.readouterr().out
    assert "1 dataset(s), 1 there" in said
    assert "have fewer demonstrations than asked for" in said
    assert "all is there: python train.py" in said
    assert cli.main(["data", str(file), "--scale", "tiny", "--seed=3"]) == 0
    assert f"python train.py --config_path {file} --scale tiny --seed=3\n" in capsys.readouterr().out
    assert parse_episodes("human=3, mg=4") == {"human": 3, "mg": 4}
    assert cli.main(["data", str(file), "--make", "--episodes", "human=3"]) == 0  # nothing to do
    assert sorted(path.name for path in Path("datasets/kitchens").iterdir()) == ["pretrain"]


def test_downloads_behind_links_are_found(tmp_path: Path) -> None:
    there = tmp_path / "disk/OpenDrawer/lerobot"
    (there / "meta").mkdir(parents=True)
    (there / "meta/info.json").write_text(json.dumps({"codebase_version": "v2.1"}))
    folder = tmp_path / "datasets"
    folder.mkdir()
    (folder / "linked").symlink_to(tmp_path / "disk")
    (tmp_path / "disk/up").symlink_to(tmp_path / "disk")  # and one in a circle
    assert [download.source for download in find_downloads(folder)] == [folder / "linked/OpenDrawer/lerobot"]


def test_downloads_are_known_from_inside_their_folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    task = tmp_path / "datasets/v1.0/pretrain/atomic/OpenDrawer"
    there = task / "20250101/lerobot"
    (there / "meta").mkdir(parents=True)
    (there / "meta/info.json").write_text(json.dumps({"codebase_version": "v2.1"}))
    needs = needs_of(load_experiment(published_experiment()))[0]
    for folder in (task.parents[2], task.parents[1], task.parent, task):
        monkeypatch.chdir(folder)
        found = find_downloads(Path(), needs=needs)
        assert [download.source.absolute() for download in found] == [there]


def test_downloads_are_converted_in_bulk(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    whole = v2.write_dataset(tmp_path / "source", (6, 4))
    base = tmp_path / "datasets/v1.0"
    human = base / "pretrain/atomic/OpenDrawer/20250101"
    v2.clone(whole, human / "lerobot")
    v2.clone(whole, base / "pretrain/atomic/OpenDrawer/20250101/mg/demo/2025-02-02/lerobot")
    v2.clone(whole, base / "target/atomic/OpenDrawer/20250103/lerobot")
    broken = base / "pretrain/atomic/CloseDrawer/20250101/lerobot"
    v2.clone(whole, broken)
    (broken / "meta/episodes.jsonl").write_text("{")
    command = ["data", str(published_experiment()), "--convert", "datasets", "--workers", "1"]
    assert (
        cli.main(command) == 1
    )  # of the two that it needs, one is broken: that ends neither the other nor the command
    said = capsys.readouterr().out
    assert "2 dataset(s) below datasets to convert" in said
    assert "not made: datasets/v1.0/pretrain/atomic/CloseDrawer/20250101/lerobot" in said
    assert dataset_version(human / "lerobot_v3") == "v3.0"
    assert "license: other" in (human / "lerobot_v3/README.md").read_text()
    assert not broken.with_name("lerobot_v3").exists()
    assert cli.main(["data", "--convert", "datasets", "--to", "elsewhere", "--workers", "1"]) == 1
    assert "4 dataset(s) below datasets to convert" in capsys.readouterr().out
    made = sorted(path.parent.parent for path in Path("elsewhere").rglob("meta/info.json"))
    assert len(made) == 3
    assert all(dataset_version(path) == "v3.0" for path in made)
    (broken / "meta/info.json").unlink()
    assert cli.main(command) == 0
    assert "0 dataset(s) below datasets to convert" in capsys.readouterr().out


@pytest.mark.render
def test_missing_data_are_recorded_converted_and_drawn_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = experiment_on(tmp_path, HUMAN, REDRAWN)
    command = ["data", str(file), "--make", "--episodes", "human=1", "--workers", "1"]
    assert cli.main(command) == 0
    assert "done: all of it is there" in capsys.readouterr().out
    roots = [Path("datasets/kitchens/pretrain", kind, "CloseDrawer") for kind in ("human", "human_cotraining")]
    for root in roots:
        info = json.loads((root / "meta/info.json").read_text())
        assert info["total_episodes"] == 1
        shapes = [f["shape"] for key, f in info["features"].items() if key.startswith("observation.images")]
        assert shapes == [[128, 128, 3]] * 3
        card = (root / "README.md").read_text()
        assert "license: apache-2.0" in card.split("---")[1]
        assert "| CloseDrawer | 1 |" in card
        assert f"1 episodes, {info['total_frames']:,} steps" in card
        assert str(tmp_path) not in card
    episode = json.loads((roots[0] / "meta/robocasa/episodes.jsonl").read_text())
    assert episode["task_name"] == "CloseDrawer"
    assert sorted(path.name for path in Path("datasets/kitchens").iterdir()) == ["pretrain"]  # recordings are gone
    before = [root.stat().st_mtime_ns for root in roots]
    assert cli.main(command) == 0
    assert [root.stat().st_mtime_ns for root in roots] == before
    assert cli.main(["data", str(file), "--check"]) == 0


@pytest.mark.render
def test_only_sources_that_are_none_have_a_dataset_recorded_instead(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    file = experiment_on(tmp_path, {**HUMAN, "task_set": "mimicgen60", "source": "mg"})
    command = ["data", str(file), "--make", "--episodes", "mg=1", "--workers", "1"]
    work = Path("datasets/kitchens", WORK, "pretrain/mg/CloseDrawer")
    with held_lock(work / SOURCES / ".CloseDrawer.prepare.lock"):  # as another run does that prepares them
        assert cli.main(command) == 1
    assert "not made: datasets/kitchens/pretrain/mg/CloseDrawer: the same work is running" in capsys.readouterr().out
    assert (work / SOURCES / "CloseDrawer.hdf5").exists()
    assert not (work / "recorded").exists()
    monkeypatch.setattr(prepare, "prepare_files", lambda paths, workers: iter(()))
    assert cli.main(command) == 0
    assert "recorded, since generating it came to nothing" in capsys.readouterr().out
    assert dataset_version(Path("datasets/kitchens/pretrain/mg/CloseDrawer")) == "v3.0"


@pytest.mark.slow
@pytest.mark.render
def test_a_few_recorded_ones_are_multiplied_where_a_recipe_says_so(tmp_path: Path) -> None:
    file = experiment_on(tmp_path, {**HUMAN, "task_set": "mimicgen60", "source": "mg"})
    assert cli.main(["data", str(file), "--make", "--episodes", "mg=2", "--workers", "2", "--keep-recordings"]) == 0
    root = Path("datasets/kitchens/pretrain/mg/CloseDrawer")
    rows = [json.loads(line) for line in (root / "meta/robocasa/episodes.jsonl").read_text().splitlines()]
    assert len(rows) == 2
    with h5py.File(root.with_name("CloseDrawer.hdf5")) as recorded:
        for row, demo in zip(rows, recorded["data"].values(), strict=True):
            assert row["mimicgen"]["source_demos"] == demo["src_demo_inds"][:].tolist()
            assert {*row["mimicgen"]["source_demos"]} <= {*range(10)}
            kinds = demo["segment_kind"][:]
            assert [kind for kind, steps in row["mimicgen"]["segment_kinds"] for _ in range(steps)] == kinds.tolist()
            assert json.loads(demo.attrs["ep_meta"])["generation"]["segments"]


@pytest.mark.slow
@pytest.mark.render
def test_what_nothing_can_be_generated_of_is_recorded_and_people_are_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    asked: list[Path] = []

    def without_luck(settings: list[RecordingSettings], out: Path, **options: Any) -> list[RecordingResult]:
        if isinstance(settings[0], GenerationSettings):
            asked.append(out)
            return [RecordingResult(out / "none.hdf5", 0, 0, 20, [], "not one of 20 attempts succeeded")]
        if not out.joinpath("stop").exists():
            return record_tasks(settings, out, **options)
        raise WorkerDiedError("killed")

    monkeypatch.setattr("robocasa_lerobot.demos.recording.record_tasks", without_luck)
    file = experiment_on(tmp_path, {**HUMAN, "task_set": "mimicgen60", "source": "mg"})
    command = ["data", str(file), "--make", "--episodes", "mg=1", "--workers", "1"]
    work = Path("datasets/kitchens", WORK, "pretrain/mg/CloseDrawer")
    stop = work / "recorded" / "stop"  # what is recorded instead is ended from outside ...
    stop.parent.mkdir(parents=True)
    stop.touch()
    assert cli.main(command) == 1
    assert "not made: datasets/kitchens/pretrain/mg/CloseDrawer: killed" in capsys.readouterr().out
    stop.unlink()
    shutil.rmtree(work)
    assert cli.main(command) == 0
    assert "note: datasets/kitchens/pretrain/mg/CloseDrawer: recorded, since generating" in capsys.readouterr().out
    assert len(asked) == 1, "generating is not tried again where recording was begun"
    assert dataset_version(Path("datasets/kitchens/pretrain/mg/CloseDrawer")) == "v3.0"


@pytest.mark.slow
@pytest.mark.render
def test_a_kill_in_the_middle_costs_little(tmp_path: Path) -> None:
    file = experiment_on(tmp_path, HUMAN, tasks=("CloseDrawer", "OpenDrawer"))
    command = [sys.executable, "-m", "robocasa_lerobot.cli", "data", str(file)]
    command += ["--make", "--episodes", "human=4", "--workers", "2"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    process = subprocess.Popen(command, env=environment)
    work = Path("datasets/kitchens") / WORK
    parts: list[Path] = []
    while len(parts) < 3 and process.poll() is None:
        time.sleep(0.05)
        parts = list(work.rglob("[0-9]*.hdf5"))
    process.send_signal(signal.SIGKILL)
    process.wait()
    assert parts
    stamps = {part: part.stat().st_mtime_ns for part in work.rglob("[0-9]*.hdf5")}
    time.sleep(1)  # workers end with the process that started them
    process = subprocess.Popen(command, env=environment)
    while not all(map(Path.exists, work.rglob("*.hdf5"))) and process.poll() is None:
        time.sleep(0.05)
    kept = [part for part, stamp in stamps.items() if part.exists() and part.stat().st_mtime_ns == stamp]
    assert process.wait() == 0
    assert kept or not stamps
    for task in ("CloseDrawer", "OpenDrawer"):
        info = json.loads(Path("datasets/kitchens/pretrain/human", task, "meta/info.json").read_text())
        assert info["total_episodes"] == 4
    assert not work.exists()


@pytest.mark.slow
@pytest.mark.render
def test_slurm_makes_them_in_jobs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    stand_in(tmp_path, monkeypatch)
    file = experiment_on(tmp_path, HUMAN, tasks=("CloseDrawer", "OpenDrawer"))
    command = ["data", str(file), "--make", "--episodes", "human=1", "--executor", "slurm"]
    command += ["--slurm.partition", "cpu", "--slurm.time", "00:10:00", "--slurm.cpus", "1"]
    assert cli.main(command) == 0
    assert "submitted to Slurm: 2 pieces" in capsys.readouterr().out
    assert cli.main(["data", str(file), "--check"]) == 0


def test_estimates_agree_with_the_committed_benchmarks() -> None:
    results = ROOT / "benchmarks/results"
    demonstrators = json.loads((results / "demonstrators_alone.json").read_text())
    for kind, hourly in demonstrators["demonstrations_per_hour_of_kind"].items():
        assert estimate.SECONDS_PER_DEMONSTRATION[kind] == pytest.approx(3600 / hourly["one_process"], rel=0.1)
        medians = [task["seconds_median"] for task in demonstrators["tasks"].values() if task["kind"] == kind]
        assert estimate.STEPS_PER_DEMONSTRATION[kind] == pytest.approx(20 * sum(medians) / len(medians), rel=0.1)
    speeds = json.loads((results / "convert_speed.json").read_text())["frames_per_second"]
    for pixels, key in ((64, "small_ours_2"), (256, "states_ours_2")):
        assert estimate.STEPS_PER_SECOND[pixels] == pytest.approx(speeds[key]["median"] / 2, rel=0.1)
