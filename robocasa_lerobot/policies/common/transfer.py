"""What a batch costs beside its networks: numbers on their way to a policy's device, and what it repeats."""

from __future__ import annotations

from collections.abc import Hashable, Iterable

import torch
from torch import Tensor


def to_device(drawn: Tensor, device: torch.device) -> Tensor:
    """The numbers on `device`, without waiting for what a GPU is still computing.

    CUDA copies from ordinary memory only after all that was launched before, and until then nothing else is launched.
    """
    if device.type != "cuda" or torch.compiler.is_compiling():
        return drawn.to(device)
    return drawn.pin_memory().to(device, non_blocking=True)


def is_plain_cpu(device: torch.device) -> bool:
    """Whether PyTorch runs here as it is written, where shapes may follow from values.

    On a GPU each such shape is waited for, and code that `torch.compile` translates is translated anew for it.
    """
    return device.type == "cpu" and not torch.compiler.is_compiling()


def without_weights() -> bool:
    """Whether modules are made that only tell their shapes (`torch.device("meta")`), into which nothing is loaded."""
    return torch.get_default_device().type == "meta"


def each_once[Item: Hashable](items: Iterable[Item]) -> tuple[list[Item], Tensor]:
    """The items without repetitions, in the order of their first places, and which of them each one is (N,)."""
    place: dict[Item, int] = {}
    where = [place.setdefault(item, len(place)) for item in items]
    return list(place), torch.tensor(where, dtype=torch.int64)
