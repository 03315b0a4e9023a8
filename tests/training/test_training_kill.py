"""Training that is killed at any moment: the same command ends with the numbers of a run in peace, bit for bit."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
import yaml
from safetensors import SafetensorError
from safetensors.torch import load_file, save_file
from training_support import ROOT, experiment_file

from robocasa_lerobot.data.fake import write_fake_dataset
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.training.config.experiment import EmaConfig
from robocasa_lerobot.training.weights.checkpoint import (
    TrainingState,
    checkpoint_step,
    last_checkpoint,
    prune,
    restore,
    save_checkpoint,
    tidy,
)
from robocasa_lerobot.training.weights.ema import Ema
from robocasa_lerobot.training.weights.master_weights import MasterWeights

KILLS = 10
STEPS = 24  # of each of the two phases
LOG_EVERY = 2
LINES = 2 * STEPS // LOG_EVERY  # of metrics in both phases together
TIMES = {"seconds_per_step", "data_seconds_per_step", "data_share", "samples_per_second"}
PHASES = ("pretrain", "finetune")
SECONDS = 300  # of waiting, for anything


def write_experiment(folder: Path, data: Path) -> Path:
    """Two phases with all that a checkpoint has to keep: averages, low-rank changes, half a window of metrics."""
    path = experiment_file(
        folder,
        data,
        loader={"cache_dir": str(folder / "frames")},  # of its own: a kill may also come while it is made
        defaults={
            "steps": STEPS,
            "log_every": LOG_EVERY,
            "save_every": 3,
            "keep_last": 3,
            "held_out": {"share": 0.25, "every": 8, "samples": 4},
            "augment": {"crop": 0.9, "brightness": 0.2},
        },
    )
    content = yaml.safe_load(path.read_text())
    content["phases"][1] |= {"statistics": "pool", "replay": {"share": 0.25}, "lora": {"rank": 2, "dropout": 0.1}}
    path.write_text(yaml.safe_dump(content))
    return path


class Run:
    """The command of an experiment, in processes of their own."""

    def __init__(self, folder: Path, data: Path) -> None:
        self.out = folder / "out"
        self.log = folder / "log"
        path = write_experiment(folder, data)
        self._command = [sys.executable, str(ROOT / "train.py"), "--config_path", str(path)]

    def start(self) -> subprocess.Popen[bytes]:
        with self.log.open("w") as log:
            environment = {**os.environ, "OMP_NUM_THREADS": "1"}
            return subprocess.Popen(self._command, env=environment, stdout=log, stderr=subprocess.STDOUT)

    def finish(self) -> None:
        process = self.start()
        try:
            assert process.wait(timeout=SECONDS) == 0, self.log.read_text()[-3000:]
        finally:
            process.kill()

    def kill_at(self, lines: int, seconds: float) -> None:
        """Start it, and kill it so many seconds after it has written so many lines of metrics in all."""
        process = self.start()
        until = time.monotonic() + SECONDS
        try:
            while self.lines() < lines:
                assert process.poll() is None, self.log.read_text()[-3000:]
                assert time.monotonic() < until, self.log.read_text()[-3000:]
                time.sleep(0.002)
            time.sleep(seconds)
            assert process.poll() is None, f"it ended before the kill: {self.log.read_text()[-3000:]}"
        finally:
            process.send_signal(signal.SIGKILL)
            process.wait()

    def lines(self) -> int:
        """Complete lines of metrics so far."""
        return sum(len(self._lines(phase, "metrics")) for phase in PHASES)

    def _lines(self, phase: str, kind: str) -> list[str]:
        path = self.out / phase / f"{kind}.jsonl"
        try:
            return [line for line in path.read_text().splitlines(keepends=True) if line.endswith("}\n")]
        except FileNotFoundError:
            return []

    def numbers(self, phase: str, kind: str) -> list[dict[str, Any]]:
        """The lines without times."""
        rows = [json.loads(line) for line in self._lines(phase, kind)]
        return [{key: value for key, value in row.items() if key not in TIMES} for row in rows]

    def state(self) -> str:
        """What lies there, for `pytest -s`."""
        found = []
        for phase in PHASES:
            names = sorted(path.name for path in (self.out / phase / "checkpoints").glob("*"))
            found.append(f"{phase} {len(self._lines(phase, 'metrics'))} lines, {' '.join(names) or 'no checkpoints'}")
        return "; ".join(found)

    def tensors(self, phase: str) -> dict[str, torch.Tensor]:
        """Every tensor of every checkpoint: weights, their average, statistics, the optimiser's moments."""
        files = sorted((self.out / phase / "checkpoints").glob("[0-9]*/*/*.safetensors"))
        return {
            f"{path.relative_to(self.out).as_posix()}:{key}": value
            for path in files
            if path.name != "rng_state.safetensors"  # of no meaning: every step seeds itself
            for key, value in load_file(path).items()
        }


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    torch.set_num_threads(1)
    return write_fake_dataset(tmp_path_factory.mktemp("data") / "fake", episodes=8, length=12, image_size=32)


def check_same(killed: Run, whole: Run) -> None:
    for phase in PHASES:
        for kind in ("metrics", "held_out"):
            expected = whole.numbers(phase, kind)
            assert expected[-1]["step"] == STEPS
            assert killed.numbers(phase, kind) == expected
        ours, theirs = killed.tensors(phase), whole.tensors(phase)
        assert ours.keys() == theirs.keys()
        files = {Path(name.split(":")[0]).name for name in theirs}
        assert {"model.safetensors", "raw_model.safetensors", "optimizer_state.safetensors"} <= files
        different = [name for name, value in theirs.items() if not torch.equal(ours[name], value)]
        assert different == []
        names = sorted(path.name for path in (killed.out / phase / "checkpoints").iterdir())
        assert names == sorted(path.name for path in (whole.out / phase / "checkpoints").iterdir())
    assert not [path for path in killed.out.rglob("*") if path.name.endswith(".partial")]


@pytest.mark.slow
@pytest.mark.timeout(SECONDS * 4)
def test_ten_kills_end_with_the_numbers_of_a_run_in_peace(tmp_path: Path, data: Path) -> None:
    whole, killed = Run(tmp_path / "whole", data), Run(tmp_path / "killed", data)
    began = time.monotonic()
    whole.finish()
    print(f"\nin peace: {time.monotonic() - began:.1f} s")
    files = [whole.out / phase / "metrics.jsonl" for phase in PHASES]
    stamps = [path.stat().st_mtime for path in files]
    assert whole.lines() == LINES
    seconds_per_line = _seconds_per_line(whole)
    rng = np.random.default_rng(0)
    # One moment in each tenth of the run; the first may come before the first step.
    for number, offset in enumerate(rng.uniform(0, 1, KILLS)):
        place = (number + offset) / KILLS * LINES
        killed.kill_at(int(place), (place - int(place)) * seconds_per_line)
        print(f"kill {number + 1} at line {place:.2f}: {killed.state()}")
    killed.finish()
    assert stamps == [path.stat().st_mtime for path in files]
    check_same(killed, whole)
    print(f"compared {sum(len(whole.tensors(phase)) for phase in PHASES)} tensors; {time.monotonic() - began:.1f} s")


def _seconds_per_line(run: Run) -> float:
    """Wall-clock seconds of a line of metrics in the run, with what checkpoints take."""
    phase = run.out / PHASES[0]
    first, last = (phase / "phase.json").stat().st_mtime, (phase / "metrics.jsonl").stat().st_mtime
    return (last - first) / (STEPS // LOG_EVERY)


class Killed(BaseException):
    """Stands for a kill: nothing handles it, and nothing is cleaned up on its way."""


class KillSwitch:
    """Stops Python before its n-th change of the file system, wherever it comes from."""

    changes = ("os.rename", "os.mkdir", "os.remove", "os.rmdir", "os.symlink", "shutil.rmtree")

    def __init__(self) -> None:
        self._left: int | None = None
        sys.addaudithook(self._hook)  # for ever: hooks cannot be taken away

    def _hook(self, event: str, args: tuple[Any, ...]) -> None:
        if self._left is None:
            return
        if event in self.changes or (event == "open" and isinstance(args[1], str) and set(args[1]) & set("wax+")):
            self._left -= 1
            if self._left < 0:
                raise Killed

    def fires(self, after: int, action: Callable[[], object]) -> bool:
        """Whether the action was stopped before change number `after`, counted from 0; otherwise it has ended."""
        self._left = after
        try:
            action()
        except Killed:
            return True
        finally:
            self._left = None
        return False


class Layer(torch.nn.Linear):
    """As much of a policy as a checkpoint needs."""

    name = "layer"

    def save_pretrained(self, folder: Path, state_dict: dict[str, torch.Tensor] | None = None) -> None:
        folder.mkdir(parents=True)
        save_file(state_dict or self.state_dict(), folder / "model.safetensors")
        (folder / "config.json").write_text("{}")


class Written:
    """A part of a checkpoint that is one file."""

    def __init__(self, name: str) -> None:
        self.name = name

    def save_pretrained(self, folder: Path) -> None:
        (folder / self.name).write_text("whole")


def state_at(step: int) -> TrainingState:
    policy: Any = Layer(2, 2)
    policy.weight.data.fill_(float(step))
    optimizer = torch.optim.SGD(policy.parameters(), lr=0.1)
    ema = Ema(policy, EmaConfig())
    parts = (policy, Written("pre.json"), Written("post.json"), optimizer, None, ema, MasterWeights(policy))
    return TrainingState(*parts, step=step)


def test_a_schedule_that_goes_from_rate_to_rate_goes_on(tmp_path: Path) -> None:
    """LeRobot's own are functions of the step; a package's may not be."""
    state, again = state_at(0), state_at(0)
    for each in (state, again):
        each.scheduler = torch.optim.lr_scheduler.ExponentialLR(each.optimizer, gamma=0.5)
    for _ in range(3):
        state.optimizer.step()
        state.scheduler.step()
    state.step = 3
    restore(save_checkpoint(tmp_path / "example", state, Written("train_config.json")), again)
    assert again.step == 3
    assert again.optimizer.param_groups[0]["lr"] == 0.1 / 8
    again.optimizer.step()
    again.scheduler.step()
    assert again.optimizer.param_groups[0]["lr"] == 0.1 / 16


def files_of(checkpoint: Path) -> list[str]:
    return sorted(path.relative_to(checkpoint).as_posix() for path in checkpoint.rglob("*") if path.is_file())


def test_a_kill_at_any_change_of_files_leaves_whole_checkpoints(tmp_path: Path) -> None:
    """Saving and pruning are stopped before each of their changes, and what starts then finds a sound checkpoint."""
    switch = KillSwitch()
    save_checkpoint(tmp_path / "example", state_at(3), Written("train_config.json"))
    complete = files_of(tmp_path / "example/checkpoints/000003")
    assert "training_state/raw_model.safetensors" in complete
    newest: list[int] = []
    for after in range(1000):
        phase = tmp_path / f"{after}"
        for step in (3, 6):
            save_checkpoint(phase, state_at(step), Written("train_config.json"))

        def save_and_prune(phase: Path = phase) -> None:
            save_checkpoint(phase, state_at(9), Written("train_config.json"))
            save_checkpoint(phase, state_at(9), Written("train_config.json"))  # again, as after an initial checkpoint
            prune(phase, keep_last=1, keep_every=0)

        stopped = switch.fires(after, save_and_prune)
        last = last_checkpoint(phase)
        assert last is not None
        newest.append(checkpoint_step(last))
        tidy(phase)
        assert last_checkpoint(phase) == last
        assert (phase / "checkpoints/last").readlink() == Path(last.name)
        for checkpoint in (phase / "checkpoints").iterdir():
            assert checkpoint.name in ("000003", "000006", "000009", "last")
            assert files_of(checkpoint) == complete
            weights = load_file(checkpoint / "training_state/raw_model.safetensors")["weight"]
            assert weights.unique().tolist() == [checkpoint_step(checkpoint.resolve())]
        if not stopped:
            break
    assert len(newest) > 30  # kills
    assert set(newest) == {6, 9}
    assert files_of(phase / "checkpoints") == [f"000009/{file}" for file in complete]
    print(f"{len(newest) - 1} kills")


@pytest.mark.parametrize("full", [OSError(28, "No space left on device"), SafetensorError("No space left on device")])
def test_a_full_disk_is_told_and_takes_nothing_of_what_is_saved(tmp_path: Path, full: Exception) -> None:
    class Disk(Written):
        def save_pretrained(self, folder: Path) -> None:
            raise full

    again = {"example": "begins the phase anew", "later": "goes on from step 3"}
    save_checkpoint(tmp_path / "later", state_at(3), Written("train_config.json"))
    for phase, goes_on in again.items():
        with pytest.raises(UserError, match=rf"step 6 cannot be written .*No space left.*`keep_last`.*{goes_on}"):
            save_checkpoint(tmp_path / phase, state_at(6), Disk("train_config.json"))
    assert not list((tmp_path / "example/checkpoints").iterdir())
    assert sorted(path.name for path in (tmp_path / "later/checkpoints").iterdir()) == ["000003", "last"]
