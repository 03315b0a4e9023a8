"""Other simulators themselves, each in an environment from a lock of its own: robosuite 1.5.2, PushT by LeRobot."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import venvs

from robocasa_lerobot.evaluation.records.results import TRIALS_FILE, read_results

pytestmark = [pytest.mark.slow, pytest.mark.timeout(1800)]
ROOT = Path(__file__).parents[2]
ROBOSUITE = f"{ROOT / 'benchmarks' / 'peers' / 'robosuite_envs.py'}:make_env"


def interpreter(name: str, on_ours: bool = False) -> Path:
    try:
        return venvs.prepare_venv(name, on_ours=on_ours)
    except venvs.VenvError as error:
        pytest.skip(str(error))


def command(word: str, *words: str) -> list[str]:
    return [sys.executable, "-m", "robocasa_lerobot.cli", word, *words]


def run(line: list[str]) -> str:
    done = subprocess.run(line, cwd=ROOT, capture_output=True, text=True, timeout=1500, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.mark.render
def test_robosuite_is_recorded_killed_resumed_and_reported_beside_our_kitchens(tmp_path: Path) -> None:
    python = interpreter("robosuite152")
    words = [
        "--policy=demonstrator,random,zero", "--policy.label=reach,robosuite-random,robosuite-zero", "--trials=2",
        "--env.tasks=Lift,Stack", "--env.horizon=100", "--seed=100001", "--videos=1", "--env.image_size=96",
        f"--env.python={python}", f"--env.factory={ROBOSUITE}", "--workers=1", "--report=false",
    ]  # fmt: skip
    whole, out = tmp_path / "whole", tmp_path / "robosuite"
    run(command("eval", *words, f"--out={whole}"))
    process = subprocess.Popen(
        command("eval", *words, f"--out={out}"), cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    path, deadline = out / TRIALS_FILE, time.monotonic() + 900
    while (path.read_bytes().count(b"\n") if path.exists() else 0) < 6:
        assert process.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.02)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    first = path.read_bytes()
    assert first.count(b"\n") < 13, "it was not killed in the middle"
    print(run(command("eval", *words, f"--out={out}")))
    assert path.read_bytes().startswith(first)
    found, expected = ({r.key: r.comparable() for r in read_results(folder).trials} for folder in (out, whole))
    assert found == expected
    assert len(found) == 12
    assert all(record["error"] is None for record in found.values())
    assert all(record["success"] for (label, *_), record in found.items() if label == "reach")
    assert not any(record["success"] for (label, *_), record in found.items() if label != "reach")

    kitchens = tmp_path / "kitchens"
    own = ["--policy=demonstrator", "--policy.label=kitchens", "--trials=2", "--seed=100001", "--videos=0"]
    run(command("eval", *own, "--env.tasks=OpenDrawer", "--workers=1", "--report=false", f"--out={kitchens}"))
    report = tmp_path / "beside.html"
    print(run(command("report", str(out), str(kitchens), "--out", str(report))))
    text = report.with_suffix(".md").read_text()
    assert all(name in text for name in ("OpenDrawer", "Lift", "Stack", "reach", "kitchens", "robosuite-random"))
    assert "another simulator's own scenes" in text


@pytest.mark.parametrize("by", ["states", "actions"])
def test_human_demonstrations_of_lift(tmp_path: Path, shared: Path, by: str) -> None:
    """robosuite 1.4.0's, in 1.5.2: their states end lifted; what their actions come to is told, not asked for."""
    out = tmp_path / "out"
    demos = shared / "real" / "robosuite_lift" / "demo.hdf5"
    options = [f"--env.options.demos={demos}", f"--env.options.by={by}"]
    words = ["--policy=demonstrator", "--env.tasks=Lift", "--trials=3", "--videos=0", "--workers=1", *options]
    python = interpreter("robosuite152")
    print(
        by, run(command("eval", *words, f"--env.python={python}", f"--env.factory={ROBOSUITE}", f"--out={out}"))
    )  # fmt: skip
    records = sorted(read_results(out).trials, key=lambda record: record.trial)
    assert [record.seed for record in records] == [0, 1, 2]
    assert [record.error for record in records] == [None] * 3
    assert all(record.terms["reached"].first_step for record in records)
    if by == "states":
        assert [record.success for record in records] == [True] * 3


def test_pusht_through_lerobot(tmp_path: Path) -> None:
    out = tmp_path / "out"
    python = interpreter("pusht", on_ours=True)
    words = ["--policy=random,zero", "--env.tasks=PushT-v0", "--trials=3", "--videos=1", "--workers=1"]
    print(run(command("eval", *words, "--env.type=lerobot:pusht", f"--env.python={python}", f"--out={out}")))
    results = read_results(out)
    (header,) = results.headers.values()
    assert header.settings["simulator"]["versions"]["gym-pusht"]
    assert [record.error for record in results.trials] == [None] * 6
    assert {record.steps for record in results.trials} == {300}
    assert len({record.trajectory for record in results.trials}) == 6
    assert all((out / record.video).is_file() for record in results.trials if record.video)
    assert sum(record.video is not None for record in results.trials) == 2
