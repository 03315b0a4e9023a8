"""Small numbers on their way from the CPU, where they are drawn, to the device of a policy."""

from __future__ import annotations

import torch
from torch import Tensor


def to_device(drawn: Tensor, device: torch.device) -> Tensor:
    """The numbers on `device`, without waiting for what a GPU is still computing.

    CUDA copies from ordinary memory only after all that was launched before, and until then nothing else is launched.
    """
    if device.type != "cuda" or torch.compiler.is_compiling():
        return drawn.to(device)
    return drawn.pin_memory().to(device, non_blocking=True)
