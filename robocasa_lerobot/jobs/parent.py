"""A worker or a command ends with the process that started it, which may have been killed."""

from __future__ import annotations

import argparse
import os
import threading
from typing import Any


def end_with(parent: Any) -> None:
    """End this process, in the middle of whatever is being done, when the one that started it (`parent`) has ended."""

    def wait() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=wait, daemon=True).start()


END_WITH_INPUT = "--end-with-input"


def add_end_with_input(parser: argparse.ArgumentParser) -> None:
    """Add the option of a command that ends with its caller, which starts it with a pipe as its standard input."""
    parser.add_argument(
        END_WITH_INPUT, action="store_true", help="end when standard input closes, as when the caller is killed"
    )


def end_with_input() -> None:
    """End this process, in the middle of whatever is being done, when its standard input closes.

    Its own workers end when their pipes close.
    """

    def wait() -> None:
        while os.read(0, 4096):
            pass
        os._exit(1)

    threading.Thread(target=wait, daemon=True).start()
