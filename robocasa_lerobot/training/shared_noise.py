"""The same noise however many processes share a batch: each draws for all of it and takes its own rows."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import torch
from torch import Tensor
from torch.overrides import TorchFunctionMode

_SIZED = (torch.randn, torch.rand)
_LIKE = {torch.randn_like: torch.randn, torch.rand_like: torch.rand}


class SharedNoise(TorchFunctionMode):
    """Inside it, random tensors whose first size is a multiple of the process's samples are rows of a larger draw.

    The larger draw is what one process with the whole batch would make from `seed`, so that noise and diffusion times
    belong to samples and not to processes. Dropout is not covered: its masks are drawn from the process's own
    generator.
    """

    def __init__(self, samples: int, rank: int, processes: int, seed: int) -> None:
        super().__init__()
        self._samples, self._rank, self._processes, self._seed = samples, rank, processes, seed
        self._generators: dict[torch.device, torch.Generator] = {}

    def __torch_function__(
        self, func: Callable[..., Any], types: Any, args: Sequence[Any] = (), kwargs: dict[str, Any] | None = None
    ) -> Any:
        """Torch's hook around each of its functions."""
        kwargs = dict(kwargs or {})
        if func in _LIKE:
            like: Tensor = args[0]
            kwargs.pop("memory_format", None)
            kwargs = {"dtype": like.dtype, "device": like.device, **{k: v for k, v in kwargs.items() if v is not None}}
            return self._draw(_LIKE[func], (), tuple(like.shape), kwargs)
        if func in _SIZED and (args or "size" in kwargs):
            size = kwargs.pop("size", None)
            if size is None:
                size = args[0] if isinstance(args[0], Sequence) else args
            return self._draw(func, (), tuple(size), kwargs)
        if func is torch.randint or (func is torch.normal and (len(args) == 3 or "size" in kwargs)):
            first, size = (args, kwargs.pop("size")) if "size" in kwargs else (args[:-1], args[-1])
            return self._draw(func, first, tuple(size), kwargs)
        if func is torch._sample_dirichlet:  # what a Beta distribution draws from
            return self._dirichlet(args[0])
        return func(*args, **kwargs)

    def _draw(
        self, func: Callable[..., Any], first: Sequence[Any], size: tuple[int, ...], kwargs: dict[str, Any]
    ) -> Any:
        if kwargs.get("generator") is None:
            kwargs["generator"] = self._generator(torch.device(kwargs.get("device") or "cpu"))
        if not size or size[0] == 0 or size[0] % self._samples:
            return func(*first, size=size, **kwargs)
        whole = func(*first, size=(size[0] * self._processes, *size[1:]), **kwargs)
        return whole[self._rank * size[0] : (self._rank + 1) * size[0]]

    def _dirichlet(self, concentration: Tensor) -> Tensor:
        generator = self._generator(concentration.device)
        rows = concentration.shape[0] if concentration.ndim else 0
        if concentration.ndim < 2 or rows % self._samples:
            return torch._sample_dirichlet(concentration, generator)
        repeated = concentration.repeat(self._processes, *[1] * (concentration.ndim - 1))
        return torch._sample_dirichlet(repeated, generator)[self._rank * rows : (self._rank + 1) * rows]

    def _generator(self, device: torch.device) -> torch.Generator:
        if device not in self._generators:
            self._generators[device] = torch.Generator(device).manual_seed(self._seed)
        return self._generators[device]
