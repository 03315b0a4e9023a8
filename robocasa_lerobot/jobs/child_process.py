"""A further Python process that serves this one, and ends when this one's end of its pipe is closed."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

# Not `-m`: the module would be there twice, and so would the classes of its messages.
_PROGRAM = "import sys; from {module} import serve; serve(*map(int, sys.argv[1:]))"


def start_serving(module: str, descriptors: Sequence[int], **environment: str) -> subprocess.Popen[bytes]:
    """Start a process that calls a module's `serve` with file descriptors, which it inherits.

    `environment` is added to this process's. Python's modules are found where this one finds them.
    """
    return subprocess.Popen(
        [sys.executable, "-c", _PROGRAM.format(module=module), *map(str, descriptors)],
        pass_fds=descriptors,
        stdin=subprocess.DEVNULL,
        env=environment_of_python() | environment,
    )


def environment_of_python() -> dict[str, str]:
    """This process's environment, in which a further Python finds this package."""
    places = [str(Path(__file__).parents[2]), *filter(None, [os.environ.get("PYTHONPATH")])]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(places)}
