"""Demonstrations, conversion and evaluation on a real Ray of two cores on this machine, in an environment with Ray."""

from __future__ import annotations

import os
from pathlib import Path

import cluster_work as work
import pytest
import venvs

pytestmark = [pytest.mark.slow, pytest.mark.timeout(1200)]
# Ray starts on this machine, for each command anew, and sends nothing home.
ENVIRONMENT = {name: value for name, value in os.environ.items() if name != "RAY_ADDRESS"} | {
    "RAY_USAGE_STATS_ENABLED": "0"
}


@pytest.fixture(scope="module")
def python() -> Path:
    try:
        return venvs.prepare_venv("ray", on_ours=True)
    except venvs.VenvError as error:
        pytest.skip(str(error))


@pytest.fixture(scope="module")
def recorded(python: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Demonstrations made on this machine without Ray."""
    out = tmp_path_factory.mktemp("local") / "demos"
    work.command(python, [*work.DEMOS, "--workers", "1", "--out", str(out)])
    return out


@pytest.mark.parametrize("cpus", ["1", "2"])
def test_demonstrations(python: Path, recorded: Path, tmp_path: Path, cpus: str) -> None:
    """With two cores a task, what records it starts processes of its own inside Ray's."""
    ray = ("--executor", "ray", "--ray.cpus", cpus, "--ray.mem_per_cpu_gb", "1")
    print(work.command(python, [*work.DEMOS, *ray, "--out", str(tmp_path / "demos")], ENVIRONMENT))
    work.same_demonstrations(recorded, tmp_path / "demos")


RAY = ("--executor", "ray", "--ray.cpus", "1", "--ray.mem_per_cpu_gb", "1")


@pytest.mark.render
def test_conversion(python: Path, recorded: Path, tmp_path: Path) -> None:
    words = ["convert", *(str(recorded / f"{task}.hdf5") for task in work.TASKS), "--image-size", "64"]
    work.command(python, [*words, "--workers", "1", "--out", str(tmp_path / "here")])
    print(work.command(python, [*words, *RAY, "--out", str(tmp_path / "there")], ENVIRONMENT))
    work.same_dataset(tmp_path / "here", tmp_path / "there")


@pytest.mark.render
def test_evaluation(python: Path, tmp_path: Path) -> None:
    work.command(python, [*work.EVALUATION, f"--out={tmp_path / 'here'}"])
    words = [*work.EVALUATION, f"--out={tmp_path / 'there'}", *RAY, "--shards", "3"]
    print(work.command(python, words, ENVIRONMENT))
    work.same_trials(tmp_path / "here", tmp_path / "there")
    assert (tmp_path / "there" / "report.html").is_file()


def test_a_shard_that_fails_is_said_and_run_again(python: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    words = [*work.EVALUATION, "--policy=zero", "--videos=0", "--report=false", f"--out={out}", *RAY, "--shards", "2"]
    (out / "shards" / "2-of-2").mkdir(parents=True)
    (out / "shards" / "2-of-2" / "trials.jsonl").write_text("no line of results\n")
    with pytest.raises(AssertionError, match=r"1 of 2 pieces failed with Ray(.|\n)*not a JSON object"):
        work.command(python, words, ENVIRONMENT)
    assert not (out / "trials.jsonl").exists()
    assert len(work.read_results(out / "shards" / "1-of-2").trials) == 2
    (out / "shards" / "2-of-2" / "trials.jsonl").unlink()
    work.command(python, words, ENVIRONMENT)
    assert len(work.read_results(out).trials) == 4


def test_a_piece_that_no_node_has_room_for_is_refused(python: Path, tmp_path: Path) -> None:
    with pytest.raises(AssertionError, match=r"it asks for 64 cores and 64 GiB, found \d+ cores"):
        work.command(
            python,
            [*work.DEMOS, "--executor", "ray", "--ray.cpus", "64", "--ray.mem_per_cpu_gb", "1", f"--out={tmp_path}"],
            ENVIRONMENT,
        )
