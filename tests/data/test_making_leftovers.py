"""What earlier makings have left is no reason to skip work, or to refuse it: markers, files of other numbers, locks."""

from __future__ import annotations

import hashlib
import json
import os
from dataclasses import dataclass
from pathlib import Path

import h5py
import pytest
import yaml
from ray_support import StandIn

from robocasa_lerobot import cli
from robocasa_lerobot.demos.attempts import Parts
from robocasa_lerobot.jobs.executors import Execution, RaySettings, SlurmSettings
from robocasa_lerobot.jobs.pieces import report_frames
from robocasa_lerobot.jobs.pieces import run_pieces as run_frames
from robocasa_lerobot.jobs.publish import held_folder, partial_folder
from robocasa_lerobot.making.make import SOURCES, MadeDataset, pieces_of, recording_settings
from robocasa_lerobot.making.needs import needs_of
from robocasa_lerobot.making.pieces import run_pieces
from robocasa_lerobot.training.config.experiment import load_experiment

KITCHENS = Path(__file__).parents[2] / "configs/experiments/parts/kitchens.yaml"
SLURM = SlurmSettings(partition="cpu", time="1:00")


@pytest.fixture(autouse=True)
def in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def experiment(tmp_path: Path, source: str) -> Path:
    """An experiment on one task of our kitchens."""
    sets = {key: ["CloseDrawer"] for key in ("pretrain300", "mimicgen60")}
    (tmp_path / "registry.yaml").write_text(yaml.safe_dump({"base": str(KITCHENS), "task_sets": sets}))
    selection = {
        "task_set": "mimicgen60" if source == "mg" else "pretrain300", "split": "pretrain", "source": source,
    }  # fmt: skip
    content = {
        "name": "few",
        "output_dir": "out",
        "registry": str(tmp_path / "registry.yaml"),
        "policy": {"type": "act"},
        "phases": [{"name": "train", "steps": 1, "mixture": {"select": [selection]}}],
    }
    (tmp_path / "few.yaml").write_text(yaml.safe_dump(content))
    return tmp_path / "few.yaml"


def piece_of(file: Path, **episodes: int) -> MadeDataset:
    (piece,) = pieces_of(needs_of(load_experiment(file), episodes)[0])
    return piece


def finished_file(path: Path, episodes: int) -> None:
    """What a recording leaves, as far as it says how many demonstrations it was to have."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with h5py.File(path, "w") as file:
        file.create_group("data").attrs["recording_settings"] = json.dumps({"episodes": episodes})


@dataclass(frozen=True)
class Dataset:
    """A piece that is quick to make."""

    root: Path
    size: int = 1

    @property
    def name(self) -> str:
        return str(self.root)

    @property
    def work(self) -> Path:
        return self.root.with_name("work").absolute()

    def done(self) -> float:
        return float(self.root.exists())

    def make(self, workers: int) -> str:
        self.root.mkdir()
        return ""


def stale_marker(folder: Path, piece: Dataset) -> None:
    """What a making of one piece leaves that was killed before it summed up."""
    markers = folder / hashlib.sha256(piece.name.encode()).hexdigest()[:12] / "completions"
    markers.mkdir(parents=True)
    (markers / "00000").touch()


def test_a_marker_of_a_dataset_that_is_gone_lets_no_piece_be_skipped(tmp_path: Path, ray: StandIn) -> None:
    folder, pieces = tmp_path / "making", [Dataset(tmp_path / "one")]
    asked = (Execution("ray", ray=RaySettings(cpus=1)), 1, "making", "demo", ())
    assert run_pieces(pieces, folder, *asked).failed == {}
    pieces[0].root.rmdir()
    stale_marker(folder, pieces[0])
    assert run_pieces(pieces, folder, *asked).failed == {}
    assert pieces[0].root.is_dir()


def test_slurm_gets_pieces_of_which_a_marker_is_left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "sbatch").write_text("#!/bin/bash\necho Submitted batch job 7\n")
    (tmp_path / "sbatch").chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}{os.pathsep}{os.environ['PATH']}")
    folder, pieces = tmp_path / "making", [Dataset(tmp_path / "one")]
    stale_marker(folder, pieces[0])
    outcome = run_pieces(pieces, folder, Execution("slurm", slurm=SLURM), 1, "making", "demo", ())
    assert "1 pieces in job 7" in outcome.submitted


def test_files_of_other_numbers_go_and_what_goes_on_stays(tmp_path: Path) -> None:
    piece = piece_of(experiment(tmp_path, "mg"), mg=20)
    settings, name = recording_settings(piece.need), "CloseDrawer.hdf5"
    parts = Parts(piece.work, settings).folder
    files = {piece.work / name: 20, piece.work / "recorded" / name: 20, piece.work / SOURCES / name: 10}
    parts.mkdir(parents=True)
    for path, episodes in files.items():
        finished_file(path, episodes)
    piece._drop_other_numbers()
    assert all(path.exists() for path in (parts, *files)), "these are asked for"
    more = piece_of(experiment(tmp_path, "mg"), mg=30)
    more._drop_other_numbers()
    assert [path.exists() for path in (parts, *files)] == [True, False, False, True], "from the same ten sources"
    finished_file(piece.work / name, 5)
    few = piece_of(experiment(tmp_path, "mg"), mg=5)
    few._drop_other_numbers()
    assert not (piece.work / SOURCES).exists()
    assert not parts.exists(), "generated from sources that are gone"
    assert not (piece.work / name).exists()


def test_two_makings_of_a_dataset_do_not_take_each_other_s_files(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = experiment(tmp_path, "human")
    recorded = piece_of(file, human=2).work / "CloseDrawer.hdf5"
    finished_file(recorded, 2)
    command = ["data", str(file), "--make", "--episodes", "human=1", "--workers", "1"]
    with held_folder(recorded.parent):
        assert cli.main(command) == 1
    assert "the same work is running already" in capsys.readouterr().out
    assert recorded.exists()


@pytest.mark.render
def test_a_killed_making_does_not_block_one_of_another_number(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = experiment(tmp_path, "human")
    finished_file(piece_of(file, human=2).work / "CloseDrawer.hdf5", 2)
    command = ["data", str(file), "--make", "--episodes", "human=1", "--workers", "1"]
    assert cli.main(command) == 0, capsys.readouterr().out
    info = json.loads(Path("datasets/kitchens/pretrain/human/CloseDrawer/meta/info.json").read_text())
    assert info["total_episodes"] == 1


def test_a_dataset_counts_half_when_it_is_recorded_and_more_as_it_is_drawn(tmp_path: Path) -> None:
    piece = piece_of(experiment(tmp_path, "human"))
    need = piece.need
    assert piece.done() == 0.0
    settings = recording_settings(need)
    piece.work.mkdir(parents=True)
    (piece.work / f"{settings.task}.hdf5").touch()
    assert piece.done() == settings.episodes / 2
    need.root.parent.mkdir(parents=True, exist_ok=True)
    partial = partial_folder(need.root, "0123")
    seen = []

    def convert(data: None, rank: int = 0, world_size: int = 1) -> None:
        report_frames(partial, rank, 10)
        seen.append(piece.done())

    with held_folder(partial):
        run_frames(convert, 4, partial, Execution(), 1, 40, "converting", int, "json")
    half = settings.episodes / 2
    assert seen == pytest.approx([half + half * 0.99 * share for share in (0.25, 0.5, 0.75, 1.0)])
    assert seen[-1] < settings.episodes  # the dataset is not there
