"""Demonstrations, conversion and evaluation on a real Slurm of one node; how the cluster treats our jobs."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import cluster_work as work
import pytest
from real_slurm import PARTITION, NoSlurmError, Slurm, running_slurm

pytestmark = [pytest.mark.slow, pytest.mark.timeout(1200)]
ASKED = ("--executor", "slurm", "--slurm.partition", PARTITION, "--slurm.time", "00:20:00")
SMALL = (*ASKED, "--slurm.cpus", "1", "--slurm.mem_per_cpu_gb", "2")  # two jobs at a time on two cores
SECONDS = 600.0


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Slurm]:
    try:
        with running_slurm(tmp_path_factory.mktemp("slurm")) as slurm:
            yield slurm
    except NoSlurmError as error:
        pytest.skip(f"no Slurm here: {error}")


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Demonstrations made on this machine without a cluster."""
    out = tmp_path_factory.mktemp("local") / "demos"
    work.command(sys.executable, [*work.DEMOS, "--workers", "1", "--out", str(out)])
    return out


def _files(folder: Path) -> str:
    return "\n".join(f"{file.name}: {file.read_text()}" for file in sorted(folder.glob("*.out")))


def test_demonstrations(cluster: Slurm, recorded: Path, tmp_path: Path) -> None:
    out = tmp_path / "demos"
    said = work.command(sys.executable, [*work.DEMOS, *SMALL, "--out", str(out)], cluster.environment)
    assert "submitted to Slurm: 2 tasks in job" in said
    cluster.wait(SECONDS)
    assert all((out / f"{task}.hdf5").is_file() for task in work.TASKS), _files(out / "slurm")
    work.same_demonstrations(recorded, out)
    print(_files(out / "slurm"))


@pytest.mark.render
def test_conversion(cluster: Slurm, recorded: Path, tmp_path: Path) -> None:
    words = ["convert", *(str(recorded / f"{task}.hdf5") for task in work.TASKS), "--image-size", "64"]
    work.command(sys.executable, [*words, "--workers", "1", "--out", str(tmp_path / "here")])
    said = work.command(sys.executable, [*words, *SMALL, "--out", str(tmp_path / "there")], cluster.environment)
    assert "submitted to Slurm: pieces in job" in said
    cluster.wait(SECONDS)
    assert (tmp_path / "there").is_dir(), _files(tmp_path / "there.slurm")
    work.same_dataset(tmp_path / "here", tmp_path / "there")
    print(work.command(sys.executable, ["verify", str(tmp_path / "there")]))


@pytest.mark.render
def test_evaluation(cluster: Slurm, tmp_path: Path) -> None:
    work.command(sys.executable, [*work.EVALUATION, f"--out={tmp_path / 'here'}"])
    words = [*work.EVALUATION, f"--out={tmp_path / 'there'}", *SMALL, "--shards", "3"]
    said = work.command(sys.executable, words, cluster.environment)
    assert "submitted to Slurm: shards in job" in said
    cluster.wait(SECONDS)
    assert (tmp_path / "there" / "report.html").is_file(), _files(tmp_path / "there" / "slurm")
    work.same_trials(tmp_path / "here", tmp_path / "there")


def test_jobs_in_the_queue_are_not_submitted_again_and_a_cancelled_piece_is(cluster: Slurm, tmp_path: Path) -> None:
    """The node is drained, so that everything waits; one shard is cancelled before it may run."""
    out = tmp_path / "out"
    words = [
        *work.EVALUATION, "--policy=zero", "--videos=0", "--report=false", f"--out={out}", *SMALL, "--shards", "2"
    ]  # fmt: skip
    cluster.ask("scontrol", "update", "nodename=localhost", "state=drain", "reason=test")
    try:
        first = work.command(sys.executable, words, cluster.environment)
        array = first.split("shards in job ")[1].split(",")[0]
        with pytest.raises(AssertionError, match="still in the queue"):
            work.command(sys.executable, words, cluster.environment)
        cluster.ask("scancel", f"{array}_1")
    finally:
        cluster.ask("scontrol", "update", "nodename=localhost", "state=resume")
    cluster.wait(SECONDS)
    assert not (out / "trials.jsonl").exists(), "the job that joins must not run without all shards"
    assert "1-of-2" in {folder.name for folder in (out / "shards").iterdir()}
    second = work.command(sys.executable, words, cluster.environment)
    assert "shards in job" in second
    cluster.wait(SECONDS)
    assert len(work.read_results(out).trials) == 4, _files(out / "slurm")
