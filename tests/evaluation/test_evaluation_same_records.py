"""The same plan gives the same trial records, times aside, however it is run: that is what makes them comparable."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import broken_gpu
import pytest
import yaml
from tiny_checkpoint import SIZE
from trial_faults import REASONS, assert_faults_cost_only_their_trials

from robocasa_lerobot.cli import main
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.actors.checkpoint import PolicySource
from robocasa_lerobot.evaluation.config.evaluation import EvaluationConfig
from robocasa_lerobot.evaluation.config.loader import load_config
from robocasa_lerobot.evaluation.records.results import TRIALS_FILE, TrialRecord, read_results
from robocasa_lerobot.evaluation.report.gather import gather
from robocasa_lerobot.evaluation.run import engine, policy_servers
from robocasa_lerobot.evaluation.run.merging import merge

ROOT = Path(__file__).parents[2]
TESTS = str(ROOT / "tests" / "support")


def arguments(out: Path, **changes: Any) -> list[str]:
    values = {
        "env.factory": "evaluation_env:SlideEnv",
        "env.tasks": "Slide,Push",
        "env.image_size": SIZE,
        "policy": "random,zero",
        "trials": 5,
        "videos": 0,
        "workers": 1,
        "report": "false",
        **changes,
    }
    return [f"--out={out}", *(f"--{name}={value}" for name, value in values.items())]


def evaluate(out: Path, **changes: Any) -> list[TrialRecord]:
    return engine.evaluate(engine.prepare(load_config(EvaluationConfig, arguments(out, **changes))))


def comparable(records: Sequence[TrialRecord]) -> list[dict[str, Any]]:
    return [record.comparable() for record in sorted(records, key=lambda record: record.key)]


@pytest.fixture
def plain(tmp_path: Path) -> list[dict[str, Any]]:
    return comparable(evaluate(tmp_path / "plain"))


def test_shards_joined_are_the_whole(
    tmp_path: Path, plain: list[dict[str, Any]], capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert main(["eval", *arguments(out), "--shard=2/3", "--videos=1"]) == 0
    capsys.readouterr()
    assert main(["report", str(out)]) == 2
    assert "no such file; expected the trials.jsonl of an evaluation. Its shards are not" in capsys.readouterr().err
    whole = engine.prepare(load_config(EvaluationConfig, arguments(out)))
    with engine.only_writer(out), pytest.raises(UserError, match="another evaluation is writing here"):
        merge(whole)
    with pytest.raises(UserError, match=r"13 of 20 trials are recorded in no shard .* run the shards again"):
        merge(whole)
    for shard in (1, 3):
        assert main(["eval", *arguments(out), f"--shard={shard}/3"]) == 0
    assert main(["eval", *arguments(out), "--merge"]) == 0
    merged = read_results(out)
    assert comparable(merged.trials) == plain
    films = [record.video for record in merged.trials if record.video]
    assert films
    assert all((out / film).is_file() for film in films)
    info = json.loads((out / "eval_info_random.json").read_text())
    assert info["overall"]["n_episodes"] == 10
    successes = {(r.task, r.trial): r.success for r in merged.trials if r.label == "random"}
    assert {g["task_group"]: g["metrics"]["successes"] for g in info["per_task"]} == {
        task: [successes[task, trial] for trial in range(5)] for task in ("Slide", "Push")
    }
    # Joined once more it keeps films of trials whose shard has none.
    kept = {(r.task, r.trial, r.label) for r in merged.trials if r.video}
    shard = next(
        file for file in out.glob(f"shards/*/{TRIALS_FILE}") if '"video":"' in file.read_text().replace(" ", "")
    )
    lines = [json.loads(line) for line in shard.read_text().splitlines()]
    lines = [line | ({"video": None} if line["kind"] == "trial" else {}) for line in lines]
    shard.write_text("".join(json.dumps(line) + "\n" for line in lines))
    assert main(["eval", *arguments(out), "--merge"]) == 0
    assert {(r.task, r.trial, r.label) for r in read_results(out).trials if r.video} == kept
    # A shard of other settings is refused, with what differs.
    (out / TRIALS_FILE).unlink()
    other = engine.prepare(load_config(EvaluationConfig, arguments(out, seed=4)))
    with pytest.raises(UserError, match="seed: 0 in the file, 4 now"):
        merge(other)


def test_labels_of_before_count_again_in_shards(tmp_path: Path) -> None:
    for data in ("none", "all", "none"):
        words = [*arguments(tmp_path, **{"policy": "zero", "policy.training_data": data})]
        for shard in ("1/2", "2/2"):
            assert main(["eval", *words, f"--shard={shard}"]) == 0
        assert main(["eval", *words, "--merge"]) == 0
        (policy,) = gather([tmp_path]).policies
        assert policy.info.training_data == data


def test_of_trials_that_do_not_repeat_the_first_one_counts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """As where a policy behind a socket is asked again, since there are other numbers of shards now."""
    out = tmp_path / "out"
    for shard in ("1/1", "1/2", "2/2"):
        assert main(["eval", *arguments(out), f"--shard={shard}"]) == 0
    first, later = out / "shards/1-of-1" / TRIALS_FILE, out / "shards/1-of-2" / TRIALS_FILE
    stored = [json.loads(line) for line in later.read_text().splitlines()]

    def change(**changes: object) -> None:
        lines = [line | (changes if line["kind"] == "trial" else {}) for line in stored]
        later.write_text("".join(json.dumps(line) + "\n" for line in lines))

    whole = engine.prepare(load_config(EvaluationConfig, arguments(out)))
    # Other last bits and the same outcome, as on another machine: nothing that is reported depends on the choice.
    change(trajectory="another")
    merge(whole)
    assert f"{later}: 10 trials ended as in {first}, but on another course" in capsys.readouterr().err
    assert comparable(read_results(out).trials) == comparable(read_results(first.parent).trials)
    (out / TRIALS_FILE).unlink()
    change(trajectory="another", steps=1)
    with pytest.raises(UserError, match=rf"{later}: .* ended otherwise than in {first}: .* Move one of the two away"):
        merge(whole)
    monkeypatch.setattr(PolicySource, "repeats", False)
    merge(whole)
    assert comparable(read_results(out).trials) == comparable(read_results(first.parent).trials)


def kill_and_rerun(out: Path, kills: int) -> list[TrialRecord]:
    """Evaluate in a process that is killed each time it has recorded some more trials, until it gets through."""
    command = [
        sys.executable,
        str(ROOT / "eval.py"),
        *arguments(out, workers=2, **{"env.tasks": "Slide+slow"}, trials=12),
    ]
    environment = {**os.environ, "PYTHONPATH": TESTS}
    path = out / TRIALS_FILE
    for _ in range(kills):
        before = path.read_bytes().count(b"\n") if path.exists() else 0
        process = subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        deadline = time.monotonic() + 120
        while process.poll() is None and (path.read_bytes().count(b"\n") if path.exists() else 0) <= before + 1:
            assert time.monotonic() < deadline
            time.sleep(0.005)
        process.send_signal(signal.SIGKILL)
        process.wait()
    subprocess.run(command, env=environment, capture_output=True, timeout=300, check=True)
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    keys = [(line["label"], line["task"], line["trial"]) for line in lines if line["kind"] == "trial"]
    assert len(keys) == len(set(keys)) == 24, "a recorded trial ran again"
    return read_results(out).trials


@pytest.mark.slow
@pytest.mark.parametrize("kills", [1, 10])
def test_killed_and_given_again(tmp_path: Path, kills: int) -> None:
    whole = evaluate(tmp_path / "whole", **{"env.tasks": "Slide+slow"}, trials=12)
    assert comparable(kill_and_rerun(tmp_path / "out", kills)) == comparable(whole)


@pytest.mark.parametrize("devices", ["cpu", pytest.param("cpu,cpu", marks=pytest.mark.slow)])
def test_workers_policy_servers_and_their_number_change_nothing(
    tmp_path: Path,
    checkpoint: Path,
    devices: str,
) -> None:
    own: dict[str, Any] = {
        "policy": checkpoint,
        "policy.label": "tiny",
        "env.tasks": "Slide",
        "trials": 4,
    }
    in_workers = evaluate(tmp_path / "a", **own)
    in_servers = evaluate(
        tmp_path / "b", **{**own, "workers": 2}, **{"policy.placement": "servers", "policy.devices": devices}
    )
    assert [r.error for r in in_workers + in_servers] == [None] * 8
    assert comparable(in_workers) == comparable(in_servers)
    assert len({r.trajectory for r in in_workers}) == 4
    assert all(r.seconds.policy > 0 for r in in_workers + in_servers)
    assert all(r.seconds.waiting > 0 for r in in_servers)
    # Executed steps are a setting of the outcome: another number is another evaluation.
    with pytest.raises(UserError, match="executed_steps: None in the file, 4 now"):
        evaluate(tmp_path / "b", **own, executed_steps=4)


@pytest.mark.slow
def test_a_gpu_that_is_of_no_use_any_more_costs_its_process_and_an_attempt(
    tmp_path: Path, checkpoint: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    processes = tmp_path / "processes"
    processes.mkdir()
    monkeypatch.setenv(broken_gpu.FOLDER, str(processes))
    monkeypatch.setattr(policy_servers, "POLICY_SERVER", (broken_gpu.__name__, "server_main"))
    servers = {"policy.placement": "servers", "policy.devices": "cuda:0"}
    records = evaluate(tmp_path / "out", policy=checkpoint, trials=3, **{"env.tasks": "Slide", **servers})
    assert [record.error for record in records] == [None] * 3
    assert sorted(record.attempts for record in records) == [1, 1, 2]
    assert len(list(processes.iterdir())) == 2


@pytest.mark.slow
def test_slurm_runs_the_shards_and_joins_them(
    tmp_path: Path,
    slurm: Path,
    plain: list[dict[str, Any]],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    out = tmp_path / "out"
    monkeypatch.setenv("PYTHONPATH", TESTS)
    asked = ["--executor", "slurm", "--slurm.partition", "cpu", "--slurm.time", "00:10:00", "--slurm.cpus", "1"]
    command = ["eval", *arguments(out, workers=0), *asked]
    assert main([*command, "--shards", "2"]) == 0
    assert comparable(read_results(out).trials) == plain
    assert "array=0-1" in (slurm / "1.script").read_text()
    assert yaml.safe_load((out / "shards/1-of-2" / engine.CONFIG_FILE).read_text())["workers"] == 1
    # Given again, every shard is submitted: what is left is in its records, not in a marker.
    (slurm / "sbatch").write_text((slurm / "sbatch").read_text().replace("if failed:", "if True:"))  # nothing runs
    assert main([*command, "--shards", "2"]) == 0
    assert "array=0-1" in (slurm / "3.script").read_text()
    assert main(command) == 2, "the number of shards is needed"


@pytest.mark.costly
def test_faulty_trials_cost_only_themselves(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    own: dict[str, Any] = {"policy": "zero", "env.tasks": "Slide", "trials": 40, "workers": 2, "stall_seconds": 3}
    assert_faults_cost_only_their_trials(evaluate, own, REASONS, tmp_path, monkeypatch)
