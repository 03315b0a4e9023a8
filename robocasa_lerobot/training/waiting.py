"""Work that the first of several processes does alone while the others wait, for as long as it takes.

A barrier of the process group ends with an error after minutes, and trials of a finished phase take hours. So the
others look for a file, in the output folder that all share, and meet the first at a barrier only when it is there.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from datetime import timedelta
from pathlib import Path

from accelerate import Accelerator

from robocasa_lerobot.errors import UserError

NOTE = ".first_process_is_done"
POLL_SECONDS = 1.0
# For everything else that one process does and all wait for, such as a checkpoint or a download.
BARRIER = timedelta(hours=2)


def first_process_works(accelerator: Accelerator, folder: Path, work: Callable[[], None]) -> None:
    """Do `work` in the first process; all go on when it is done.

    Args:
        accelerator: of this process.
        folder: that all processes see.
        work: what the first one does.

    Raises:
        UserError: in the other processes, the work failed in the first one, where its own error is raised.
    """
    if accelerator.num_processes == 1:
        work()
        return
    note = folder / NOTE
    if accelerator.is_main_process:
        note.unlink(missing_ok=True)  # of a run that was killed
    accelerator.wait_for_everyone()
    if accelerator.is_main_process:
        failure = "it was ended"
        try:
            work()
            failure = ""
        except Exception as error:
            failure = str(error) or type(error).__name__
            raise
        finally:
            _write(note, failure)
    else:
        while not note.is_file():
            time.sleep(POLL_SECONDS)
        failure = note.read_text(encoding="utf-8")
        if failure:
            raise UserError(f"the first process could not go on: {failure}")
    accelerator.wait_for_everyone()
    if accelerator.is_main_process:
        note.unlink(missing_ok=True)


def _write(note: Path, text: str) -> None:
    aside = note.with_name(f"{note.name}.writing")
    aside.write_text(text, encoding="utf-8")
    aside.replace(note)
