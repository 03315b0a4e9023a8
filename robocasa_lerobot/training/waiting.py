"""Work that the first of several processes does alone while the others wait, for as long as it takes.

A barrier of the process group ends with an error after minutes, and trials of a finished phase take hours. So the
others wait in a group of their own, without a limit that matters; it ends all the same when the first process does,
because its connections close.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import timedelta
from typing import Any

import torch.distributed
from accelerate import Accelerator

from robocasa_lerobot.errors import UserError

# For everything else that one process does and all wait for, such as a checkpoint or a download.
BARRIER = timedelta(hours=2)
_LONGEST = timedelta(days=30)


def first_process_works[T](accelerator: Accelerator, work: Callable[[], T]) -> T:
    """What `work` returns, which the first process alone does; all go on when it is done.

    Raises:
        UserError: in the other processes, the work failed in the first one, where its own error is raised; or a
            process that this one waits for has ended.
    """
    if accelerator.num_processes == 1:
        return work()
    said: list[Any] = ["it was ended", None]  # why it failed, or None, and what it returned
    with _named_when_gone(accelerator):
        group = torch.distributed.new_group(backend="gloo", timeout=_LONGEST)
    try:
        if accelerator.is_main_process:
            try:
                said = [None, work()]
            except Exception as error:
                said[0] = str(error) or type(error).__name__
                raise
            finally:
                torch.distributed.broadcast_object_list(said, src=0, group=group)
        else:
            with _named_when_gone(accelerator):
                torch.distributed.broadcast_object_list(said, src=0, group=group)
    finally:
        torch.distributed.destroy_process_group(group)
    if said[0] is not None:
        raise UserError(f"the first process could not go on: {said[0]}")
    found: T = said[1]
    return found


@contextmanager
def _named_when_gone(accelerator: Accelerator) -> Iterator[None]:
    """What torch says of a lost connection, in words: which process has ended.

    Where the first process ends between two works, the others meet it already when they make their group, because
    it keeps the store in which groups are made.
    """
    try:
        yield
    except RuntimeError as error:
        gone = "another process" if accelerator.is_main_process else "the first process"
        raise UserError(f"{gone} is not there any more: {error}") from error
