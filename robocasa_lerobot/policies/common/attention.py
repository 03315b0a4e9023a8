"""Which of PyTorch's kernels computes attention over short sequences."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext

import torch
from torch.nn.attention import SDPBackend, sdpa_kernel


def short_attention(device: torch.device) -> AbstractContextManager[None]:
    """Plain matrix products on CPUs while a loss is computed; PyTorch's own choice elsewhere.

    Its fused kernel for CPUs is made for long sequences: the backward pass over the ten steps of an action chunk takes
    a quarter of a training step. Measured on two cores with the policy of the demo, in turns: 0.146 and 0.157 s a step
    with the fused kernel, 0.111 and 0.105 s without. Sampling keeps the fused one: what it gives for a sample does not
    depend on the batch that the sample is in.
    """
    return sdpa_kernel(SDPBackend.MATH) if device.type == "cpu" else nullcontext()
