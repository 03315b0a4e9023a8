"""Conversions on a cluster: the scripts that Slurm gets, run by a stand-in for it, and what is said without one."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from convert_support import leftovers, tree_hashes, write_demos

from robocasa_lerobot import cli
from robocasa_lerobot.convert.pipeline import convert
from robocasa_lerobot.convert.record_files import META_FOLDER
from robocasa_lerobot.convert.settings import ConversionSettings
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.jobs.executors import Execution, RaySettings, SlurmSettings


def _command(source: Path, out: Path, *more: str) -> list[str]:
    options = ["--executor", "slurm", "--slurm.partition", "cpu", "--slurm.time", "00:10:00", *more]
    return ["convert", str(source), "--out", str(out), *options]


@pytest.mark.slow
def test_slurm_pieces_are_run_resumed_and_joined(
    slurm: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    source = write_demos(tmp_path / "a.hdf5", (501, 501), images=16)
    out = tmp_path / "out"
    monkeypatch.setenv("FAKE_SLURM_FAILS", "1")
    assert cli.main(_command(source, out, "--slurm.account", "robots")) == 0
    assert "pieces in job 1, joined by job 2" in capsys.readouterr().out
    assert not out.exists()
    script = (slurm / "1.script").read_text()
    for line in ("--array=0-1", "--partition=cpu", "--time=00:10:00", "--account=robots", "--cpus-per-task=2"):
        assert f"#SBATCH {line}" in script
    assert "--dependency=afterok:1" in (slurm / "2.script").read_text()

    assert cli.main(["convert", str(source), "--out", str(out), "--merge"]) == 2
    assert "1 of 2 pieces are not complete" in capsys.readouterr().err

    (slurm / "queue").write_text("  1_1  cpu  robocasa-lerobot  R\n")
    assert cli.main(_command(source, out)) == 2
    assert "still in the queue: 1, 2" in capsys.readouterr().err
    (slurm / "queue").unlink()

    monkeypatch.delenv("FAKE_SLURM_FAILS")
    assert cli.main(_command(source, out)) == 0
    assert "#SBATCH --array=0-0" in (slurm / "3.script").read_text()  # the piece that is lacking alone
    assert out.is_dir(), "".join(file.read_text() for file in (tmp_path / "out.slurm").iterdir())
    assert leftovers(out) == ["out", "out.slurm"]
    convert([source], tmp_path / "local", ConversionSettings(), workers=1)
    cluster, local = tree_hashes(out), tree_hashes(tmp_path / "local")
    record = f"{META_FOLDER}/conversion.json"
    assert json.loads((out / record).read_text())["settings"]
    assert {k: v for k, v in cluster.items() if k != record} == {k: v for k, v in local.items() if k != record}


@pytest.mark.slow
def test_complete_pieces_are_joined_by_hand(
    slurm: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    source = write_demos(tmp_path / "a.hdf5", (5,), images=16)
    out = tmp_path / "out"
    sbatch = (slurm / "sbatch").read_text()
    (slurm / "sbatch").write_text(sbatch.replace("if failed:", "if failed or after:"))  # the last job was cancelled
    assert cli.main(_command(source, out)) == 0
    assert not out.exists()
    assert cli.main(["convert", str(source), "--out", str(out), "--merge"]) == 0
    assert "1 episodes, 5 frames" in capsys.readouterr().out
    assert leftovers(out) == ["out", "out.slurm"]


def test_slurm_that_refuses_is_reported(slurm: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = write_demos(tmp_path / "a.hdf5", (5,), images=16)
    (slurm / "sbatch").write_text("#!/bin/bash\necho 'invalid partition' >&2; exit 1\n")
    assert cli.main(_command(source, tmp_path / "out")) == 2
    assert "Slurm did not take the jobs" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_what_an_executor_lacks_is_said(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"--slurm.partition and --slurm.time"):
        Execution("slurm")
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(UserError, match="login node"):
        Execution("slurm", slurm=SlurmSettings(partition="cpu", time="1:00"))
    with pytest.raises(UserError, match=r"--slurm.jobs"):
        Execution("slurm", workers=2, slurm=SlurmSettings(partition="cpu", time="1:00"))


def test_ray_is_asked_for_only_where_it_is_installed(tmp_path: Path) -> None:
    try:
        import ray  # noqa: F401
    except ImportError:
        with pytest.raises(UserError, match="pip install ray"):
            Execution("ray")
    else:
        source = write_demos(tmp_path / "a.hdf5", (5,), images=16)
        execution = Execution("ray", ray=RaySettings(cpus=1, mem_per_cpu_gb=1))
        convert([source], tmp_path / "out", ConversionSettings(), execution=execution)
        assert leftovers(tmp_path / "out") == ["out"]


def test_misspelt_options_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["convert", "a.hdf5", "--out", str(tmp_path / "out"), "--slurm.partitoin", "cpu"]) == 2
    assert "Did you mean '--slurm.partition'" in capsys.readouterr().err
