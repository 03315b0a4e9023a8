"""Several processes train as one does."""

from __future__ import annotations

import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
import psutil
import pytest
import torch
from training_support import ROOT, experiment_file, losses

from robocasa_lerobot.data.fake import write_fake_dataset
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.jobs.locks import locked
from robocasa_lerobot.training.config.experiment import load_experiment
from robocasa_lerobot.training.phases import run_experiment
from robocasa_lerobot.training.weights.checkpoint import checkpoint_step, last_checkpoint

# Without dropout, whose masks belong to processes; everything else that is random belongs to samples.
CALM = {
    "diffusion_transformer": {"dropout": 0.0},
    "act": {"dropout": 0.0, "use_vae": False, "chunk_size": 8},
    "diffusion": {"do_mask_loss_for_padding": True, "drop_n_last_frames": 0, "use_group_norm": True},
    "flow_vla": {},
}


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    torch.set_num_threads(1)
    return write_fake_dataset(tmp_path_factory.mktemp("data") / "fake", episodes=4, length=12, image_size=32)


def command(path: Path, *settings: str) -> list[str]:
    return [sys.executable, str(ROOT / "train.py"), "--config_path", str(path), *settings]


def environment(**more: str) -> dict[str, str]:
    return {**os.environ, "OMP_NUM_THREADS": "1", **more}


def run_in_two_processes(path: Path) -> None:
    assert [status for status, _ in in_two_processes(command(path), path.parent)] == [0, 0]


def in_two_processes(words: list[str], folder: Path) -> list[tuple[int, str]]:
    """Exit status and log of each, started as `torchrun` does, on this machine and with gloo."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = str(free.getsockname()[1])
    common = {"WORLD_SIZE": "2", "MASTER_ADDR": "127.0.0.1", "MASTER_PORT": port, "LOCAL_WORLD_SIZE": "2"}
    logs = [folder / f"rank{rank}.log" for rank in range(2)]
    processes = []
    try:
        for rank, log in enumerate(logs):
            with log.open("w") as file:
                own = environment(**common, RANK=str(rank), LOCAL_RANK=str(rank), ACCELERATE_USE_CPU="true")
                processes.append(subprocess.Popen(words, env=own, stdout=file, stderr=file))
        return [(process.wait(timeout=280), log.read_text()) for process, log in zip(processes, logs, strict=True)]
    finally:
        for process in processes:
            process.kill()


@pytest.mark.slow
@pytest.mark.parametrize("kind", sorted(CALM))
def test_two_processes_train_as_one_does(tmp_path: Path, data: Path, kind: str) -> None:
    changes = {"policy": CALM[kind], "defaults": {"augment": {"crop": 0.9, "brightness": 0.2}, "steps": 4}}
    one = experiment_file(tmp_path / "one", data, kind, **changes)
    two = experiment_file(tmp_path / "two", data, kind, **changes)
    done = subprocess.run(command(one), env=environment(), capture_output=True, text=True, timeout=280, check=False)
    assert done.returncode == 0, done.stderr[-3000:]
    run_in_two_processes(two)
    for phase in ("pretrain", "finetune"):
        ours, theirs = (np.array(losses(tmp_path / name, phase)) for name in ("two", "one"))
        np.testing.assert_allclose(ours[:, :2], theirs[:, :2], rtol=1e-5)
        # Norms of gradients have kinks: a unit whose input is zero but for rounding is on in one order of the sums and
        # off in another. A gradient that is averaged wrongly is off by far more.
        np.testing.assert_allclose(ours[:, 2], theirs[:, 2], rtol=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("send", [os.kill, os.killpg])
def test_the_slurm_recipe_passes_the_signal_on_to_the_trainers(
    tmp_path: Path, data: Path, send: Callable[[int, int], None]
) -> None:
    """What the documentation has a node run; Slurm tells bash alone, or with `proctrack/pgid` its whole group."""
    found = re.search(r"srun [^\n]* bash -c '\n(.*?)' &\n", (ROOT / "docs/training.md").read_text(), re.DOTALL)
    assert found is not None
    script, path = found[1], experiment_file(tmp_path, data, defaults={"steps": 100000, "save_every": 2})
    for theirs, ours in (
        ("configs/experiments/robocasa365/foundation.yaml", str(path)), (" * 8", " * 2"), ("29500", "0")
    ):  # fmt: skip
        assert theirs in script
        script = script.replace(theirs, ours)
    places = {"PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}", "MASTER": "127.0.0.1"}
    own, log = environment(**places, SLURM_NNODES="1", SLURM_NODEID="0"), tmp_path / "log"
    with log.open("w") as file:
        node = subprocess.Popen(
            ["bash", "-c", script], env=own, cwd=ROOT, stdout=file, stderr=file, start_new_session=True
        )
    processes = [psutil.Process(node.pid)]
    try:
        while not (tmp_path / "out/pretrain/checkpoints/000002").is_dir():
            assert node.poll() is None, log.read_text()[-3000:]
            time.sleep(0.05)
        processes += processes[0].children(recursive=True)  # in sessions of their own, which outlive the others
        send(node.pid, signal.SIGUSR1)
        assert node.wait(timeout=120) == 1  # as the launcher calls each failure
    finally:
        for process in processes:
            with suppress(psutil.NoSuchProcess):
                process.kill()
    last = last_checkpoint(tmp_path / "out/pretrain")
    assert last is not None
    assert 2 <= checkpoint_step(last) == losses(tmp_path, "pretrain")[-1][0] < 100000, log.read_text()[-3000:]
    assert "the same command goes on" in log.read_text()


@pytest.mark.costly
def test_one_run_at_a_time_trains_a_phase_and_its_end_lets_the_next_one_in(tmp_path: Path, data: Path) -> None:
    path = experiment_file(tmp_path, data, defaults={"steps": 100000, "save_every": 2})
    words = [*command(path), "--end-with-input"]
    log = tmp_path / "log"
    with log.open("w") as file:
        first = subprocess.Popen(words, env=environment(), stdin=subprocess.PIPE, stdout=file, stderr=file)
    try:
        while not (tmp_path / "out/pretrain/checkpoints/000002").is_dir():
            assert first.poll() is None, log.read_text()[-3000:]
            time.sleep(0.05)
        with pytest.raises(UserError, match="the same training is running: another process trains"):
            run_experiment(load_experiment(path))
        assert first.poll() is None
        assert first.stdin is not None
        first.stdin.close()  # as the system does where its caller is killed
        assert first.wait(60) == 1, log.read_text()[-3000:]
    finally:
        first.kill()
    assert not run_experiment(load_experiment(path), stop_after=1), "it goes on"


@pytest.mark.slow
def test_none_of_several_processes_trains_what_another_run_trains(tmp_path: Path, data: Path) -> None:
    path = experiment_file(tmp_path, data)
    (tmp_path / "out").mkdir()
    with locked(tmp_path / "out/.pretrain.lock", wait=False):
        found = in_two_processes(command(path), tmp_path)
    assert [status for status, _ in found] == [2, 2]
    assert all("the same training is running" in log for _, log in found)
    assert not (tmp_path / "out/pretrain").exists()


WAITING = """
import os, sys, time
from datetime import timedelta
from pathlib import Path
from accelerate import Accelerator, InitProcessGroupKwargs
from robocasa_lerobot.training.waiting import first_process_works

# On a busy machine imports differ by more than the time after which a barrier fails.
Path(sys.argv[0]).with_name("imported" + os.environ["RANK"]).touch()
while len(list(Path(sys.argv[0]).parent.glob("imported*"))) < 2:
    time.sleep(0.05)
accelerator = Accelerator(cpu=True, kwargs_handlers=[InitProcessGroupKwargs(timeout=timedelta(seconds=3))])
first_process_works(accelerator, lambda: time.sleep(6))
print("waited", first_process_works(accelerator, lambda: accelerator.process_index + 7), flush=True)

def fail():
    if sys.argv[1] == "dies":
        os._exit(9)
    raise RuntimeError("no kitchen")

try:
    first_process_works(accelerator, fail)
finally:
    accelerator.end_training()
"""


@pytest.mark.costly
@pytest.mark.parametrize("end", ["dies", pytest.param("fails", marks=pytest.mark.slow)])
def test_no_process_gives_up_while_the_first_one_evaluates(tmp_path: Path, end: str) -> None:
    """Work of twice the time after which a barrier fails; and where it fails or is killed, no process hangs."""
    (tmp_path / "waiting.py").write_text(WAITING)
    results = in_two_processes([sys.executable, str(tmp_path / "waiting.py"), end], tmp_path)
    assert ["waited 7" in log for _, log in results] == [True, True]
    assert [status for status, _ in results] == [1 if end == "fails" else 9, 1]
    words = "could not go on: no kitchen" if end == "fails" else "is not there any more"
    assert f"the first process {words}" in results[1][1]
