"""Stand-ins for Slurm's commands, which run what is submitted at once on this machine."""

from __future__ import annotations

import os
import stat
from pathlib import Path

import pytest

# Runs each job of an array at once, on this machine, with the variables that Slurm sets; a job whose dependency failed
# is not run, as with --kill-on-invalid-dep.
SBATCH = """#!/usr/bin/env python3
import json, os, re, subprocess, sys
from pathlib import Path
place = Path(os.environ["FAKE_SLURM"])
number = len(list(place.glob("*.script"))) + 1
text = Path(sys.argv[-1]).read_text()
(place / f"{number}.script").write_text(text)
options = dict(re.findall(r"#SBATCH --([a-z-]+)(?:=(.*))?", text))
after = re.match(r"afterok:(\\d+)", options.get("dependency", ""))
failed = after and (place / f"{after.group(1)}.failed").exists()
array = re.match(r"0-(\\d+)", options.get("array", ""))
fail = os.environ.get("FAKE_SLURM_FAILS")
for index in range(int(array.group(1)) + 1) if array else [None]:
    if failed:
        break
    environment = dict(os.environ, SLURM_JOB_ID=str(number))
    if index is not None:
        environment["SLURM_ARRAY_TASK_ID"] = str(index)
        if fail == str(index):
            (place / f"{number}.failed").touch()
            continue
    log = open(options["output"].replace("%A", str(number)).replace("%a", str(index)).replace("%j", str(number)), "w")
    done = subprocess.run(["bash", sys.argv[-1]], env=environment, stdout=log, stderr=subprocess.STDOUT)
    if done.returncode:
        (place / f"{number}.failed").touch()
print(f"Submitted batch job {number}")
"""
SRUN = """#!/bin/bash
while [[ "$1" == -* ]]; do if [ "$1" = -n ]; then shift; fi; shift; done
exec "$@"
"""
SQUEUE = """#!/bin/bash
[ -f "$FAKE_SLURM/queue" ] && cat "$FAKE_SLURM/queue"
exit 0
"""


def stand_in(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with stand-ins for Slurm's commands, first in the path; scripts that were submitted are kept in it."""
    folder = tmp_path / "slurm"
    folder.mkdir()
    for name, script in (("sbatch", SBATCH), ("srun", SRUN), ("squeue", SQUEUE)):
        (folder / name).write_text(script)
        (folder / name).chmod((folder / name).stat().st_mode | stat.S_IXUSR)
    monkeypatch.setenv("PATH", f"{folder}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.setenv("FAKE_SLURM", str(folder))
    return folder


@pytest.fixture
def slurm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Stand-ins for Slurm's commands; scripts that were submitted are kept in the folder."""
    return stand_in(tmp_path, monkeypatch)
