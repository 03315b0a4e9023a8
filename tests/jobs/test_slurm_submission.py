"""What is noted of jobs that Slurm has taken, also where it refuses the next; with a stand-in that runs nothing."""

from __future__ import annotations

import argparse
import dataclasses
import json
import os
import pickle
import re
import subprocess
import sys
from functools import partial
from pathlib import Path

import pytest

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.jobs.executors import JOBS_FILE, SlurmSettings, add_options, execution_of, submit_to_slurm

TAKES = """#!/bin/bash
cp "${{@: -1}}" {script}
number=$(($(cat {count} 2>/dev/null || echo 0) + 1))
[ $number -gt {most} ] && {{ echo "no more" >&2; exit 1; }}
echo $number > {count}
echo "Submitted batch job $number"
"""


def takes(folder: Path, most: int) -> None:
    """Let sbatch take so many jobs, numbered from 1."""
    (folder / "count").unlink(missing_ok=True)
    (folder / "sbatch").write_text(TAKES.format(count=folder / "count", most=most, script=folder / "script"))
    (folder / "sbatch").chmod(0o755)


def submit(folder: Path, arrays: int) -> tuple[str | None, str]:
    settings = SlurmSettings(partition="cpu", time="1:00", max_array_size=1)
    return submit_to_slurm(print, os.getpid, arrays, folder / "work", folder / "logs", settings)


def test_each_array_that_was_taken_is_noted_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", f"{tmp_path}{os.pathsep}{os.environ['PATH']}")
    (tmp_path / "squeue").write_text("#!/bin/bash\necho waiting\n")
    (tmp_path / "squeue").chmod(0o755)
    record = tmp_path / "logs" / JOBS_FILE
    for taken in (1, 2):  # of two arrays and the job that comes after them
        takes(tmp_path, taken)
        with pytest.raises(UserError, match="Slurm did not take the jobs"):
            submit(tmp_path, 2)
        noted = [str(number) for number in range(1, taken + 1)]
        assert json.loads(record.read_text()) == noted
        with pytest.raises(UserError, match=f"still in the queue: {', '.join(noted)}"):
            submit(tmp_path, 2)
        record.unlink()
    takes(tmp_path, 3)
    assert submit(tmp_path, 2) == ("1,2", "3")
    assert json.loads(record.read_text()) == ["1", "2", "3"]
    script = (tmp_path / "script").read_text()  # of the last one, which waits for all arrays
    assert "--dependency=afterok:1:2\n" in script
    assert "srun --cpus-per-task=2 " in (tmp_path / "work" / "launch_script.slurm").read_text()


def test_each_option_is_in_what_slurm_is_asked_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", f"{tmp_path}{os.pathsep}{os.environ['PATH']}")
    takes(tmp_path, 9)
    asked = {
        "partition": "gpu", "time": "2:00", "jobs": 3, "cpus": 5, "mem_per_cpu_gb": 7, "gpus": 2, "account": "kitchens",
        "qos": "long", "env_command": "module load mesa", "max_array_size": 9,
    }  # fmt: skip
    parser = argparse.ArgumentParser()
    add_options(parser)
    words = ["--executor=slurm", *(f"--slurm.{name}={value}" for name, value in asked.items())]
    execution = execution_of(parser.parse_args(words, argparse.Namespace(workers=None)))
    assert execution.slurm == SlurmSettings(**asked)
    assert {field.name for field in dataclasses.fields(SlurmSettings)} == asked.keys()
    submit_to_slurm(print, os.getpid, 4, tmp_path / "work", tmp_path / "logs", execution.slurm)
    array = (tmp_path / "work" / "launch_script.slurm").read_text()
    last = (tmp_path / "script").read_text()
    for line in (
        "#SBATCH --partition=gpu", "#SBATCH --time=2:00", "#SBATCH --cpus-per-task=5", "#SBATCH --mem-per-cpu=7G",
        "#SBATCH --account=kitchens", "#SBATCH --qos=long", "module load mesa",
    ):  # fmt: skip
        assert f"{line}\n" in array
        assert f"{line}\n" in last
    assert "#SBATCH --array=0-3%3\n" in array
    assert re.findall(r"#SBATCH --gpus\S*=(\d+)", array) == ["2"]
    assert "--gpus" not in last  # it only joins
    assert "export PATH=" not in array


@pytest.mark.parametrize("name", ["a&b", "a b", "100%", "it's", "$HOME"])
def test_paths_that_a_shell_would_read_otherwise_are_refused(name: str, tmp_path: Path) -> None:
    with pytest.raises(UserError, match="job files do not quote paths"):
        submit(tmp_path / name, 1)


def test_a_record_that_is_lost_or_cannot_be_written_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", f"{tmp_path}{os.pathsep}{os.environ['PATH']}")
    takes(tmp_path, 9)
    (tmp_path / "logs").mkdir()
    (tmp_path / "logs" / JOBS_FILE).write_text("")
    with pytest.raises(UserError, match="found no list of jobs"):
        submit(tmp_path, 1)
    (tmp_path / "logs" / JOBS_FILE).unlink()

    def full(path: Path, text: str) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("robocasa_lerobot.jobs.slurm.write_text", full)
    with pytest.raises(UserError, match=r"took job 1, but .*No space left.*scancel 1"):
        submit(tmp_path, 1)


@pytest.mark.parametrize(("result", "status"), [(0, 0), (1, 1), (None, 0)])
def test_the_last_jobs_status_is_what_its_function_returns(result: int | None, status: int, tmp_path: Path) -> None:
    pickled = tmp_path / "finish.pickle"
    pickled.write_bytes(pickle.dumps(partial(dict[str, int | None]({"status": result}).get, "status")))
    command = [sys.executable, "-m", "robocasa_lerobot.jobs.slurm", str(pickled)]
    assert subprocess.run(command, check=False).returncode == status


def test_only_jobs_that_slurm_has_forgotten_are_over(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", f"{tmp_path}{os.pathsep}{os.environ['PATH']}")
    takes(tmp_path, 9)
    squeue = tmp_path / "squeue"
    squeue.write_text("#!/bin/bash\necho 'slurm_load_jobs error: Invalid job id specified' >&2\nexit 1\n")
    squeue.chmod(0o755)
    assert submit(tmp_path, 1) == ("1", "2")
    squeue.write_text("#!/bin/bash\necho 'Unable to contact slurm controller' >&2\nexit 1\n")
    with pytest.raises(
        UserError, match=r"squeue does not say .*Unable to contact.*remove .*jobs\.json if none of 1, 2"
    ):
        submit(tmp_path, 1)
    squeue.write_text("#!/bin/bash\necho 'Invalid job id specified' >&2\nexit 1\n")
    assert submit(tmp_path, 1) == ("3", "4")
