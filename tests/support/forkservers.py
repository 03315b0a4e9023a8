"""The processes that workers are forked from: started anew with what a folder's tests import.

Python keeps one for as long as a program runs, with the imports that its first user asked for. Commands ask once;
in a run of tests every later worker would import LeRobot for itself, ten seconds each.
"""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from types import ModuleType


def start_anew(processes: ModuleType, modules: Sequence[str]) -> None:
    """Start the server of `multiprocessing`, or of `multiprocess`, with these modules loaded."""
    running = importlib.import_module(f"{processes.__name__}.forkserver")._forkserver
    running._stop()
    running.set_forkserver_preload(list(modules))
    running.ensure_running()
