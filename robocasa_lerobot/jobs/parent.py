"""A worker ends with the process that started it, which may have been killed."""

from __future__ import annotations

import os
import threading
from typing import Any


def end_with(parent: Any) -> None:
    """End this process, in the middle of whatever is being done, when the one that started it (`parent`) has ended."""

    def wait() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=wait, daemon=True).start()
