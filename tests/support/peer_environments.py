"""Programs that ask and serve policies as others do, in environments made from the benchmarks' lock files."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).parents[2]
SUPPORT = REPOSITORY / "tests" / "support"


def prepared(name: str, on_ours: bool = False) -> Path:
    """The Python of `benchmarks/requirements/<name>.lock`; skips the test where it cannot be installed."""
    sys.path.insert(0, str(REPOSITORY / "benchmarks"))
    try:
        import venvs
    finally:
        sys.path.pop(0)
    try:
        return Path(venvs.prepare_venv(name, on_ours=on_ours))
    except venvs.VenvError as error:
        pytest.skip(f"the environment of {name} cannot be made: {error}")


@contextmanager
def peer(python: Path, kind: str) -> Iterator[int]:
    """A server of another project's code; gives its port."""
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    command = [str(python), str(SUPPORT / "peer_servers.py"), kind]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment)
    try:
        assert process.stdout is not None
        yield int(process.stdout.readline())
    finally:
        process.kill()
        process.communicate()
