"""Shards on machines that are not this one: their devices, their cores, and the same command given again."""

from __future__ import annotations

import dataclasses
import os
import shutil
from pathlib import Path
from typing import Any

import evaluation_records
import pytest
import yaml
from ray_support import StandIn

from robocasa_lerobot.cli import main
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.config.evaluation import EvaluationConfig
from robocasa_lerobot.evaluation.config.loader import load_config
from robocasa_lerobot.evaluation.planning.sources import recorded_device
from robocasa_lerobot.evaluation.records.results import TRIALS_FILE, read_results
from robocasa_lerobot.evaluation.records.trials_file import append, differences
from robocasa_lerobot.evaluation.run import distributed, engine
from robocasa_lerobot.jobs.executors import Execution

NO_DEVICE = "--env.render_devices=977"


def arguments(out: Path, policy: Any = "random", *more: str) -> list[str]:
    fixed = ["--env.factory=evaluation_env:SlideEnv", "--env.tasks=Slide", "--trials=4", "--videos=0", "--report=false"]
    return [f"--policy={policy}", f"--out={out}", *fixed, *more]


def shard_of_a_gpu(words: list[str], shard: str) -> None:
    """What a shard leaves that ran on a machine with a GPU."""
    evaluation = engine.prepare(load_config(EvaluationConfig, [*words, f"--shard={shard}"]))
    settings = {**evaluation.header.settings, "device": "cuda", "batch_width": 8}
    header = dataclasses.replace(evaluation.header, device="cuda", settings=settings)
    evaluation.out.mkdir(parents=True)
    append(evaluation.out / TRIALS_FILE, header)
    for spec in evaluation.todo_plan:
        given = {name: getattr(spec, name) for name in ("label", "task", "trial", "seed", "policy_seed", "horizon")}
        append(evaluation.out / TRIALS_FILE, evaluation_records.record(run=header.id, **given))


def test_shards_of_a_gpu_are_joined_where_there_is_none(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    words = arguments(out, evaluation_records.make_checkpoint(tmp_path / "checkpoint"))
    for shard in ("1/2", "2/2"):
        shard_of_a_gpu(words, shard)
    for device in ("auto", "cuda"):
        assert main(["eval", *words, "--merge", f"--policy.device={device}", NO_DEVICE]) == 0, capsys.readouterr().err
        (header,) = read_results(out).headers.values()
        assert (header.device, header.settings["batch_width"], len(read_results(out).trials)) == ("cuda", 8, 4)
    assert main(["eval", *words, "--merge", "--policy.device=cpu"]) == 2
    assert "device: 'cuda' in the file, 'cpu' now" in capsys.readouterr().err


def test_joining_asks_no_cluster(tmp_path: Path, ray: StandIn, capsys: pytest.CaptureFixture[str]) -> None:
    words = arguments(tmp_path / "out", "zero", "--executor=ray", "--shards=2", "--ray.cpus=1", "--merge")
    assert main(["eval", *words]) == 2
    assert "--merge joins results and runs nothing: leave --executor ray out" in capsys.readouterr().err
    assert ray.asked == []
    assert not (tmp_path / "out").exists()


def test_servers_are_on_devices_that_the_results_name(tmp_path: Path) -> None:
    words = arguments(tmp_path / "out", evaluation_records.make_checkpoint(tmp_path / "checkpoint"))
    for devices, remedy in (("cuda:0,cuda:1", "Set policy.device to the kind"), ("cpu,cuda:0", "cuda:0")):
        config = load_config(EvaluationConfig, [*words, "--policy.device=cpu", f"--policy.devices={devices}"])
        with pytest.raises(UserError, match=remedy):
            engine.prepare(config)
    assert engine.prepare(load_config(EvaluationConfig, [*words, "--policy.device=cpu", "--policy.devices=cpu"]))


def test_devices_of_shards_are_not_looked_for_where_they_are_submitted(
    tmp_path: Path, slurm: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (slurm / "sbatch").write_text("#!/bin/bash\necho Submitted batch job 7\n")  # nothing runs
    checkpoint = evaluation_records.make_checkpoint(tmp_path / "checkpoint")
    submit = ["--executor", "slurm", "--shards", "2", "--slurm.partition", "gpu", "--slurm.time", "00:10:00"]
    for number, asked in enumerate(("--policy.device=cuda", NO_DEVICE)):
        words = ["eval", *arguments(tmp_path / str(number), checkpoint, asked)]
        assert main([*words, *submit]) == 0, capsys.readouterr().err
        assert "shards in job 7" in capsys.readouterr().out
        assert main(words) == 2, "here it is missing"


def test_a_shard_looks_for_its_devices(tmp_path: Path, ray: StandIn, capsys: pytest.CaptureFixture[str]) -> None:
    words = arguments(tmp_path / "out", "random", NO_DEVICE, "--executor=ray", "--shards=2", "--ray.gpus=1")
    ray.resources["GPU"] = 1
    assert main(["eval", *words]) == 2
    error = capsys.readouterr().err
    assert "2 of 2 pieces failed with Ray" in error
    assert "render device 977" in error
    assert ray.asked[-1]["num_gpus"] == 1


@pytest.mark.costly
def test_the_same_command_runs_what_shards_lack_now(
    tmp_path: Path, ray: StandIn, monkeypatch: pytest.MonkeyPatch
) -> None:
    out, faults = tmp_path / "out", tmp_path / "faults"
    faults.mkdir()
    monkeypatch.setenv("SLIDE_FAULTS", str(faults))
    words = [
        "eval",
        *arguments(out, "zero", "--env.tasks=Slide+crashx2", "--executor=ray", "--shards=2", "--ray.cpus=1"),
    ]
    assert main(words) == 0
    assert [record.error is None for record in read_results(out).trials].count(False) == 1
    for shard in ("1-of-2", "2-of-2"):  # a worker for each of a shard's cores, whatever its node has
        assert yaml.safe_load((out / "shards" / shard / engine.CONFIG_FILE).read_text())["workers"] == 1
    assert main([*words, "--retry_errors"]) == 0
    whole = {record.key: record.comparable() for record in read_results(out).trials}
    assert [record["error"] for record in whole.values()] == [None] * 4
    assert main([*words, "--videos=1"]) == 0
    assert any(record.video for record in read_results(out).trials)
    (out / TRIALS_FILE).unlink()
    shutil.rmtree(out / "shards" / "2-of-2")
    assert main(words) == 0
    assert {record.key: record.comparable() for record in read_results(out).trials} == whole


def test_shards_run_the_checkpoint_that_was_there_when_they_were_submitted(
    tmp_path: Path, ray: StandIn, monkeypatch: pytest.MonkeyPatch
) -> None:
    checkpoints = tmp_path / "demo/finetune/checkpoints"
    for step, weights in (("000400", b"w"), ("000800", b"x")):
        evaluation_records.make_checkpoint(checkpoints / step / "pretrained_model", weights=weights)
    last = checkpoints / "last"
    last.symlink_to("000400")
    monkeypatch.chdir(tmp_path)
    words = arguments(Path("unused"), f"{last / 'pretrained_model'},random")
    config = dataclasses.replace(load_config(EvaluationConfig, words), out=None)
    submitted = engine.prepare(config)
    found: list[engine.Evaluation] = []

    def later(step: Any, *_: Any, **__: Any) -> None:
        last.unlink()
        last.symlink_to("000800")
        found.append(engine.prepare(step.keywords["config"]))
        raise UserError("this far")

    monkeypatch.setattr(distributed, "run_with_ray", later)
    with pytest.raises(UserError, match="this far"):
        distributed.run_distributed(config, 1, Execution("ray"))
    (shard,) = found
    assert list(submitted.sources) == ["finetune-000400", "random"]
    assert (shard.sources, shard.out) == (submitted.sources, submitted.out)
    assert engine.prepare(config).sources != submitted.sources


def test_workers_are_as_many_as_the_cores_that_a_process_may_use(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: set(range(3)), raising=False)
    monkeypatch.setattr(os, "cpu_count", lambda: 96)
    config = load_config(EvaluationConfig, arguments(Path("out")))
    assert [config.worker_count(trials) for trials in (2, 100)] == [2, 3]
    assert dataclasses.replace(config, workers=5).worker_count(100) == 5


def test_a_checkpoint_is_added_to_what_computes_none(tmp_path: Path) -> None:
    """Device, batches and runtime follow from the checkpoints of a command."""
    on_gpu = {"seed": 0, "split": "target", "device": "cuda", "batch_width": 8}
    on_cpu = {"seed": 0, "split": "target", "device": "cpu", "batch_width": 1, "runtime": "onnx"}
    mine = dataclasses.replace(evaluation_records.header("mine", type="act"), settings=on_gpu, device="cuda")
    other = dataclasses.replace(evaluation_records.header("other", type="act"), settings=on_cpu)
    for reference in ({"type": "zero"}, {"type": "replay"}, {"type": "openpi", "remote": {"address": "openpi://a:1"}}):
        one = dataclasses.replace(evaluation_records.header("reference", **reference), settings=on_cpu)
        assert differences(one, mine) == differences(mine, one) == []
        assert len(differences(mine, dataclasses.replace(one, settings={**on_cpu, "seed": 1}))) == 1
        folder = tmp_path / str(reference["type"])
        folder.mkdir()
        append(folder / TRIALS_FILE, one)
        assert recorded_device(folder) is None
        append(folder / TRIALS_FILE, mine)
        assert recorded_device(folder) == "cuda"
    assert len(differences(mine, other)) == 3
