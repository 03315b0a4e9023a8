"""The trainings that `training_speed.py` compares: how each is started, and what it says of its speed.

Each is a process of its own, started as a user would start it. Both write a line for every `window` steps; the first
one is not looked at, since workers, decoders and the processor's memory are cold until then.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml
from training_report import CACHED, DECODING, LEROBOT, SAME_LOADER

from robocasa_lerobot.errors import UserError

BENCHMARKS = Path(__file__).parent
CONFIGS = BENCHMARKS.parent / "configs"
# A line of LeRobot's log: seconds of an update and of getting its batch, means over the window.
_LOG_LINE = re.compile(r"loss:([\d.]+|nan).*updt_s:([\d.]+) data_s:([\d.]+)")


@dataclass(frozen=True)
class Side:
    """One of the trainings that are compared: whose loop on whose loader, with how many loader processes."""

    kind: str
    workers: int

    @property
    def key(self) -> str:
        """Its name in the result."""
        return f"{self.kind}_{self.workers}"


@dataclass(frozen=True)
class Job:
    """What all sides train: the policy's settings, the dataset, and for how long."""

    policy: dict[str, Any]
    dataset: Path
    device: str
    batch_size: int
    window: int
    windows: int
    folder: Path

    @property
    def steps(self) -> int:
        """With the window that is not looked at."""
        return self.window * (1 + self.windows)


def sides(worker_counts: Sequence[int], cached_counts: Sequence[int]) -> list[Side]:
    """All of them. Cached frames need no processes to decode, so those may be tried with fewer counts."""
    found = [Side(kind, count) for kind in (LEROBOT, SAME_LOADER, DECODING) for count in worker_counts]
    return [*found, *(Side(CACHED, count) for count in cached_counts)]


def policy_settings(name: str) -> dict[str, Any]:
    """A preset of `diffusion_transformer`, with a text encoder that needs no download.

    Raises:
        UserError: there is no such preset.
    """
    path = CONFIGS / "policies" / f"diffusion_transformer_{name}.yaml"
    if not path.is_file():
        known = sorted(p.stem.removeprefix("diffusion_transformer_") for p in path.parent.glob("diffusion_tr*_*.yaml"))
        raise UserError(f"no preset {name!r}: there is no {path.name}. Presets: {', '.join(known)}.")
    settings: dict[str, Any] = yaml.safe_load(path.read_text(encoding="utf-8"))
    if settings.get("text_encoder") == "clip":  # of the same size; CLIP itself is frozen and runs once an instruction
        settings |= {"text_encoder": "token", "language_dim": 768}
    return settings


def run(side: Side, job: Job) -> dict[str, float]:
    """Train; the samples per second, the share of the time spent waiting for data, and the last window's loss.

    Raises:
        UserError: the training failed; the message ends with what it said last.
    """
    output = job.folder / "run"
    shutil.rmtree(output, ignore_errors=True)
    job.folder.mkdir(parents=True, exist_ok=True)
    config = job.folder / "config.yaml"
    if side.kind == LEROBOT:
        config.write_text(yaml.safe_dump(lerobot_settings(side, job, output)))
        command = [str(Path(sys.executable).with_name("lerobot-train")), f"--config_path={config}"]
        return _read_log(_lines(command), job)
    config.write_text(yaml.safe_dump(our_settings(side, job, output)))
    command = [sys.executable, str(BENCHMARKS / "training_ours.py"), str(config)]
    for _ in _lines(command + ["--lerobot-loader"] * (side.kind == SAME_LOADER)):
        pass
    return read_metrics(output / "train" / "metrics.jsonl")


def lerobot_settings(side: Side, job: Job, output: Path) -> dict[str, Any]:
    """The settings file of `lerobot-train`; what is not in it has LeRobot's defaults."""
    return {
        "dataset": {"repo_id": job.dataset.name, "root": str(job.dataset)},
        "policy": {**job.policy, "device": job.device, "push_to_hub": False},
        "output_dir": str(output),
        "batch_size": job.batch_size,
        "steps": job.steps,
        "num_workers": side.workers,
        "log_freq": job.window,
        "save_checkpoint": False,
        "seed": 0,
    }


def our_settings(side: Side, job: Job, output: Path) -> dict[str, Any]:
    """An experiment of one phase. LeRobot has no moving average of the weights, so there is none here either."""
    return {
        "name": "training_speed",
        "output_dir": str(output),
        "policy": dict(job.policy),
        "device": job.device,
        "loader": {
            "workers": side.workers,
            "cache_frames": side.kind == CACHED,
            "cache_dir": str(job.folder.parent / "frame_cache"),
        },
        "phases": [
            {
                "name": "train",
                "mixture": {"members": [{"root": str(job.dataset)}]},
                "steps": job.steps,
                "batch_size": job.batch_size,
                "log_every": job.window,
                "ema": {"enabled": False},
            }
        ],
    }


def read_metrics(path: Path) -> dict[str, float]:
    """What our loop wrote, without the first window."""
    lines = [json.loads(line) for line in path.read_text().splitlines()][1:]
    seconds = sum(line["seconds_per_step"] for line in lines)
    samples = sum(line["samples_per_second"] * line["seconds_per_step"] for line in lines)
    waited = sum(line["data_seconds_per_step"] for line in lines)
    return {"samples_per_second": samples / seconds, "data_share": waited / seconds, "loss": lines[-1]["loss"]}


def _read_log(lines: Iterable[tuple[float, str]], job: Job) -> dict[str, float]:
    """LeRobot's log by the times at which its lines came; its own figures have three digits after the point."""
    found = [(at, match) for at, line in lines if (match := _LOG_LINE.search(line))]
    if len(found) != 1 + job.windows:
        raise UserError(f"lerobot-train wrote {len(found)} lines of figures, expected {1 + job.windows}.")
    taken = found[-1][0] - found[0][0]
    updating, waiting = (sum(float(match[i]) for _, match in found[1:]) for i in (2, 3))
    return {
        "samples_per_second": job.windows * job.window * job.batch_size / taken,
        "data_share": waiting / (updating + waiting),
        "loss": float(found[-1][1][1]),
    }


def _lines(command: Sequence[str]) -> Iterable[tuple[float, str]]:
    """Lines of a command's output, each with the time at which it came; raises UserError where it fails."""
    environment = {**os.environ, "PYTHONUNBUFFERED": "1", "HF_HUB_OFFLINE": "1"}
    said: list[str] = []
    with subprocess.Popen(
        command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    ) as process:
        assert process.stdout is not None
        try:
            for line in process.stdout:
                said.append(line.rstrip())
                yield time.perf_counter(), line
        except BaseException:
            process.kill()
            raise
    if process.returncode != 0:
        raise UserError(f"{Path(command[0]).name} ended with {process.returncode}:\n" + "\n".join(said[-8:]))
