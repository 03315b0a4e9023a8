"""Driving by hand: how long a control step takes with its pictures, and whether simulated time keeps up with a client.

    python benchmarks/teleop_step.py            # a minute for each number of pictures
    python benchmarks/teleop_step.py --quick    # ten seconds for each

The command runs as a user's does, in a full kitchen; a client in this process, over the socket, drives arm, base and
gripper all the time and acknowledges every picture. No peer: the aims are a step of 30 ms and 0.95 of real time on two
quiet cores without a GPU. Run it with nothing else on the machine.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import re
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import common
from commands import CLI

from robocasa_lerobot import contract
from robocasa_lerobot.teleop.client import TeleopClient

OUTPUT = common.RESULTS / "teleop_step.json"
TASK, SPLIT, SEED = "PickPlaceCounterToSink", "pretrain", 100_003
AIM_STEP_MS, AIM_REAL_TIME = 30.0, 0.95
PICTURES = {"three_pictures": list(contract.CAMERAS), "four_pictures": [*contract.CAMERAS, "free"]}
_WARM_UP_S, _START_S, _SEND_S = 3.0, 300.0, 0.04


def parse(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """The command's arguments."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="ten seconds instead of a minute")
    parser.add_argument("--seconds", type=float, help="for each number of pictures, instead")
    parser.add_argument("--out", type=Path, default=OUTPUT, help="where the result goes")
    return parser.parse_args(arguments)


@contextlib.contextmanager
def session(out: Path) -> Iterator[str]:
    """The address of a session in a process of its own."""
    command = [sys.executable, *CLI, "teleop", "--task", TASK, "--split", SPLIT, "--seed", str(SEED)]
    command += ["--out", str(out), "--port", "0"]
    environment = {**os.environ, "PYTHONPATH": str(common.REPOSITORY), "OMP_NUM_THREADS": "1"}
    process = subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        found = re.search(r"http\S+", process.stdout.readline())
        if found is None:
            raise SystemExit("the session did not start")
        yield found[0]
    finally:
        process.terminate()
        process.wait(_START_S)


def commands(now: float) -> dict[str, Any]:
    """What is held at a time: the arm and the base to and fro, the gripper too."""
    sign = 1.0 if int(now) % 2 == 0 else -1.0
    gripper = "closed" if int(now / 2) % 2 else "open"
    return {
        "arm": [0.5 * sign, 0.5 * sign, 0, 0, 0, 0.3 * sign],
        "base": [0.2 * sign, 0, 0.2 * sign],
        "gripper": gripper,
    }


def drive(client: TeleopClient, seconds: float) -> dict[str, Any]:
    """Drive for a while: medians of the steps' times, ages of pictures, simulated seconds per second."""
    started = sent = time.monotonic()
    first = client.frame["step"]
    steps_ms, ages_ms, sizes = list[float](), list[float](), list[int]()
    while (now := time.monotonic()) - started < seconds:
        if now - sent >= _SEND_S:
            client.send("input", device="benchmark", **commands(now))
            sent = now
        if client.receive(30) != "frame":
            continue
        if client.frame["phase"] == "paused":
            client.send("resume")
        elif client.frame["phase"] == "review":
            raise SystemExit("the episode has ended: choose another seed")
        steps_ms.append(client.frame["step_ms"])
        ages_ms.append(client.frame["age_ms"])
        sizes.append(sum(len(picture) for picture in client.pictures))
    wall = time.monotonic() - started
    return {
        "step_ms": common.spread([round(value, 2) for value in statistics.quantiles(steps_ms, n=10)]),
        "age_ms": common.spread([round(value, 1) for value in statistics.quantiles(ages_ms, n=10)]),
        "real_time": round((client.frame["step"] - first) / contract.CONTROL_HZ / wall, 4),
        "pictures_per_second": round(len(steps_ms) / wall, 2),
        "bytes_per_step": round(statistics.mean(sizes)),
        "seconds": round(wall, 1),
    }


def main() -> None:
    """Measure, print, write."""
    arguments = parse()
    seconds = arguments.seconds or (10.0 if arguments.quick else 60.0)
    measured: dict[str, Any] = {}
    others = common.busy_share()
    with tempfile.TemporaryDirectory() as folder, session(Path(folder)) as address, TeleopClient(address) as client:
        client.until_phase("ready", seconds=_START_S)
        client.send("set", mode="both", speed=0.5)
        client.send("input", device="benchmark", **commands(time.monotonic()))
        client.until_phase("running")
        for name, cameras in PICTURES.items():
            client.send("set", cameras=cameras)
            drive(client, _WARM_UP_S)
            measured[name] = drive(client, seconds)
    ratios = {f"real_time_{name}": row["real_time"] for name, row in measured.items()}
    ratios |= {
        f"step_to_aim_{name}": round(row["step_ms"]["median"] / AIM_STEP_MS, 4) for name, row in measured.items()
    }
    body = {
        "machine": common.machine(),
        "versions": common.versions("mujoco", "numpy", "aiohttp", "opencv-python-headless"),
        "others_busy_share": others,
        "task": {"name": TASK, "split": SPLIT, "seed": SEED},
        "aims": {"step_ms_three_pictures": AIM_STEP_MS, "real_time": AIM_REAL_TIME},
        **measured,
        "ratios": ratios,
    }
    common.write_result(arguments.out, "teleop_step", body)
    rows = [
        [name, f"{row['step_ms']['median']:.1f}", f"{row['age_ms']['median']:.0f}", f"{row['real_time']:.3f}"]
        for name, row in measured.items()
    ]
    print(common.table(["", "step, ms", "age of pictures, ms", "real time"], rows))


if __name__ == "__main__":
    main()
