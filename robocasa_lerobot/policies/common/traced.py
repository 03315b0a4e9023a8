"""A network's kernels recorded once and run without the Python between them, for sampling on a CPU.

Small networks at a batch of one spend most of their time in PyTorch's modules, not in its kernels.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import torch
from torch import Tensor, nn

from robocasa_lerobot.policies.common.onnx_session import onnx_session

_MOST_SHAPES = 8  # recordings of one network; batches of evaluation have one shape, training none
_CHECKED_RUNS = 3  # TorchScript looks at the first runs and may change a recording after them

type _Key = tuple[tuple[torch.Size, torch.dtype], ...]


class Traced:
    """A module as a function of tensors: the same bits as the module's, sooner.

    On a CPU, without gradients and outside training, its kernels are recorded by TorchScript for each shape of its
    inputs; anywhere else, under autocast, and where the module has hooks, it is called. Of modules inside it, hooks
    count that are there at the first call. Recordings use the module's own parameters, so that they follow whatever
    changes these in place. A recording that does not give what the module gives, to the bit, is not used: so do
    modules whose course depends on values, if those of the first call show it. Copies and pickles hold none.

    Frozen, it is run by ONNX Runtime where that can be, from then on: sooner still, with other last bits, and with the
    weights of the first call.

    Args:
        module: what it is of.
        method: of the module; takes tensors and gives one tensor. Only calls of the module itself have its hooks.
    """

    def __init__(self, module: nn.Module, method: str = "__call__") -> None:
        self._module, self._method = module, method
        self._recorded: dict[_Key, Callable[..., Tensor]] = {}
        self._frozen = False

    def freeze(self) -> None:
        """Take the weights for final: whoever changes them later gets what they gave before."""
        self._frozen = True
        self._recorded.clear()

    def __call__(self, *inputs: Tensor) -> Tensor:
        """What the module gives for these inputs."""
        out: Tensor
        changes = torch.is_grad_enabled() or self._module.training or _has_hooks(self._module)
        # A recording has the types of its first call, whether autocast chose them or not.
        if changes or torch.is_autocast_enabled("cpu") or any(x.device.type != "cpu" for x in inputs):
            out = self._call(*inputs)
            return out
        key = tuple((x.shape, x.dtype) for x in inputs)
        if key not in self._recorded:
            if len(self._recorded) == _MOST_SHAPES:
                self._recorded.pop(next(iter(self._recorded)))
            self._recorded[key] = self._record(inputs)
        out = self._recorded[key](*inputs)
        return out

    def _call(self, *inputs: Tensor) -> Any:
        return getattr(self._module, self._method)(*inputs)

    def _record(self, inputs: tuple[Tensor, ...]) -> Callable[..., Tensor]:
        if any(_has_hooks(module) for module in self._module.modules()):
            return self._call
        module = _Method(self._module, self._method)
        if self._frozen:
            session = onnx_session(module, inputs)
            if session is not None:
                return session
        expected = self._call(*inputs)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # shapes are constants here, and TorchScript has successors elsewhere
                recorded: Callable[..., Tensor] = torch.jit.trace(module, inputs, check_trace=False)
        except Exception:  # whatever TorchScript cannot record; and it may be gone one day
            return self._call
        alike = all(torch.equal(recorded(*inputs), expected) for _ in range(_CHECKED_RUNS))
        return recorded if alike else self._call

    def __getstate__(self) -> dict[str, Any]:
        return {"_module": self._module, "_method": self._method, "_recorded": {}, "_frozen": self._frozen}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)


class _Method(nn.Module):
    """A method of a module as a module, for recording."""

    def __init__(self, module: nn.Module, method: str) -> None:
        super().__init__()
        self.module, self._method = module, method
        self.training = module.training

    def forward(self, *inputs: Tensor) -> Any:
        return getattr(self.module, self._method)(*inputs)


def freeze(policy: nn.Module) -> None:
    """Take the weights of all networks that a policy calls through `Traced` for final: for whoever only samples."""
    for module in policy.modules():
        for value in vars(module).values():
            for one in value.values() if isinstance(value, dict) else (value,):
                if isinstance(one, Traced):
                    one.freeze()


def _has_hooks(module: nn.Module) -> bool:
    return bool(module._forward_hooks or module._forward_pre_hooks)
