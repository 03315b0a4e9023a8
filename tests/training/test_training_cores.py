"""A training on a CPU that shares each batch among processes which it starts by itself."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import psutil
import pytest
from training_support import ROOT, experiment_file, losses

from robocasa_lerobot.data.fake import write_fake_dataset
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.training.config.experiment import load_experiment
from robocasa_lerobot.training.cores import in_processes, launched, processes_for
from robocasa_lerobot.training.weights.checkpoint import checkpoint_step, last_checkpoint

CALM = {"policy": {"dropout": 0.0}}  # its masks belong to processes


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_fake_dataset(tmp_path_factory.mktemp("data") / "fake", episodes=4, length=12, image_size=32)


def start(path: Path, *settings: str) -> subprocess.Popen[str]:
    words = [sys.executable, str(ROOT / "train.py"), "--config_path", str(path), *settings]
    return subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


def others_of(run: subprocess.Popen[str], seconds: float = 60.0) -> list[psutil.Process]:
    """The processes that a training has started which train with it."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        found = [p for p in psutil.Process(run.pid).children() if "spawn_main" in " ".join(p.cmdline())]
        if found:
            return found
        time.sleep(0.05)
    raise AssertionError("it trains alone")


def wait_for(folder: Path, run: subprocess.Popen[str]) -> None:
    while not folder.is_dir():
        assert run.poll() is None, run.communicate()[0][-3000:]
        time.sleep(0.05)


def test_two_processes_train_as_one_does_and_only_one_speaks(tmp_path: Path, data: Path) -> None:
    one, two = (experiment_file(tmp_path / name, data, **CALM, defaults={"steps": 4}) for name in ("one", "two"))
    said = []
    for path, settings in ((one, ()), (two, ("--cpu_processes=2",))):
        run = start(path, *settings)
        said.append(run.communicate(timeout=280)[0])
        assert run.returncode == 0, said[-1][-3000:]
    for phase in ("pretrain", "finetune"):
        ours, theirs = (np.array(losses(tmp_path / name, phase)) for name in ("two", "one"))
        np.testing.assert_allclose(ours[:, :2], theirs[:, :2], rtol=1e-5)
    assert [text.count("phase pretrain:") for text in said] == [1, 1]
    # As many processes as now are there may go on with it.
    again = start(two, "--cpu_processes=1", "--defaults.save_every=1")
    assert "finished before" in again.communicate(timeout=280)[0]
    assert again.returncode == 0


def test_what_is_asked_to_end_saves_and_all_end(tmp_path: Path, data: Path) -> None:
    path = experiment_file(tmp_path, data, defaults={"steps": 100_000, "save_every": 2})
    run = start(path, "--cpu_processes=2")
    try:
        others = others_of(run)
        wait_for(tmp_path / "out/pretrain/checkpoints/000002", run)
        run.send_signal(signal.SIGTERM)
        text = run.communicate(timeout=120)[0]
        assert run.returncode == 75, text[-3000:]
        assert "the same command goes on" in text
        assert not any(other.is_running() for other in others)
    finally:
        run.kill()
    last = last_checkpoint(tmp_path / "out/pretrain")
    assert last is not None
    assert 2 <= checkpoint_step(last) == losses(tmp_path, "pretrain")[-1][0]


@pytest.mark.parametrize("killed", ["first", "other"])
def test_where_one_is_killed_all_end(tmp_path: Path, data: Path, killed: str) -> None:
    path = experiment_file(tmp_path, data, defaults={"steps": 100_000, "save_every": 2})
    run = start(path, "--cpu_processes=2")
    try:
        others = others_of(run)
        wait_for(tmp_path / "out/pretrain/checkpoints/000002", run)
        (run if killed == "first" else others[0]).kill()
        text = run.communicate(timeout=120)[0]
        gone, left = psutil.wait_procs(others, timeout=60)
        assert not left, gone
        if killed == "other":
            assert run.returncode == 2, text[-3000:]
            assert "process 1 of the 2 that train here has ended by SIGKILL" in text
            assert "`--cpu_processes=1` trains in one process" in text
    finally:
        run.kill()


def test_mistakes_are_told_once(tmp_path: Path, data: Path) -> None:
    path = experiment_file(tmp_path, data, defaults={"steps": 2, "batch_size": 3})
    run = start(path, "--cpu_processes=2")
    text = run.communicate(timeout=120)[0]
    assert run.returncode == 2
    assert text.count("batch of 3 samples cannot be shared by 2 processes") == 1, text[-3000:]
    with pytest.raises(UserError, match="cpu_processes is -1"):
        load_experiment(path, ["--cpu_processes=-1"])


def test_as_many_are_chosen_as_share_every_batch(monkeypatch: pytest.MonkeyPatch) -> None:
    assert processes_for(0, [64, 32], cores=4) == 4
    assert processes_for(0, [64, 6], cores=4) == 2
    assert processes_for(0, [64], cores=100) == 8
    assert processes_for(0, [7], cores=2) == 1
    assert processes_for(3, [64]) == 3
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    assert processes_for(0, [64]) == 1, "whoever trains twice at once says so"


def test_one_process_stays_as_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    before = dict(os.environ)
    assert in_processes(1, dict, found=3) == {"found": 3}
    assert dict(os.environ) == before
    assert not launched()
    monkeypatch.setenv("RANK", "0")
    assert launched()
