"""Virtual environments for programs that cannot share ours: one for each lock file in `requirements/`."""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

from robocasa_lerobot.errors import UserError

BENCHMARKS = Path(__file__).parent
STAMP = ".lock-sha256"  # of the lock file that an environment was made from; written last


class VenvError(UserError):
    """A benchmark's virtual environment could not be made."""


def venv_folder(name: str) -> Path:
    """Where the environment of `requirements/<name>.lock` lies."""
    return BENCHMARKS / ".venvs" / name


def prepare_venv(name: str, *, on_ours: bool = False) -> Path:
    """The Python of the environment of `requirements/<name>.lock`, made first if it is missing or of another lock.

    With `on_ours` it also sees the packages of the environment that runs this, after its own.

    Raises:
        VenvError: uv is missing, or the packages could not be installed (no network, most often).
    """
    lock = BENCHMARKS / "requirements" / f"{name}.lock"
    folder = venv_folder(name)
    digest = hashlib.sha256(lock.read_bytes()).hexdigest()
    python = folder / "bin" / "python"
    stamp = folder / STAMP
    if stamp.exists() and stamp.read_text().strip() == digest and python.exists():
        return python
    uv = _find_uv()
    print(f"preparing {folder.relative_to(BENCHMARKS.parent)} (once) ...", file=sys.stderr, flush=True)
    shutil.rmtree(folder, ignore_errors=True)
    _run([uv, "venv", "--quiet", "--python", sys.executable, str(folder)], name)
    arguments = ["--python", str(python), "--require-hashes", "--compile-bytecode", str(lock)]
    _run([uv, "pip", "sync", "--quiet", *arguments], name)
    if on_ours:
        inside = next(folder.glob("lib/python*/site-packages"))
        (inside / "ours.pth").write_text(sysconfig.get_path("purelib") + "\n")
    stamp.write_text(digest + "\n")
    return python


def _find_uv() -> str:
    beside = Path(sys.executable).with_name("uv")
    found = str(beside) if beside.exists() else shutil.which("uv")
    if found is None:
        raise VenvError("uv is not installed beside this Python: run `make setup`, then use .venv/bin/python.")
    return found


def _run(command: list[str], name: str) -> None:
    # An active environment would be taken for the one that is meant.
    environment = {k: v for k, v in os.environ.items() if k not in ("VIRTUAL_ENV", "PYTHONPATH")}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        said = "\n".join(f"  {line}" for line in done.stderr.strip().splitlines()[-6:])
        raise VenvError(
            f"the environment for {name} could not be made; uv said:\n{said}\n"
            f"It needs the network once (about 200 MB). Without it, leave {name} out with --without-peer; "
            f"benchmarks/.venvs/{name} can also be copied from a machine with the same Python."
        )
