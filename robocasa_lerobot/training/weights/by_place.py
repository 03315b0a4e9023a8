"""A list of tensors as a checkpoint's file holds it: by the place of each parameter among those that are trained."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import torch
from torch import Tensor


def by_place(tensors: Sequence[Tensor]) -> dict[str, Tensor]:
    """The tensors themselves, named by their place in six digits."""
    return {f"{place:06d}": tensor.detach() for place, tensor in enumerate(tensors)}


@torch.no_grad()
def take_over(tensors: Sequence[Tensor], state: Mapping[str, Tensor], name: str) -> None:
    """Copy into the tensors what `by_place` gave of such ones; `name` says in an error what they are.

    Raises:
        RuntimeError: they are of other parameters.
    """
    if len(state) != len(tensors):
        raise RuntimeError(f"{len(state)} {name} for {len(tensors)} parameters")
    for place, tensor in enumerate(tensors):
        tensor.copy_(state[f"{place:06d}"])
