"""A network as an ONNX graph, run by ONNX Runtime: for weights that stay as they are, on a CPU.

Its kernels for small matrices keep weights packed and cost little to call, which is most of what a small network at a
batch of one spends its time on. docs/decisions/0050-frozen-weights.md has the measurements.
"""

from __future__ import annotations

import io
import warnings
from collections.abc import Callable, Sequence
from unittest.mock import patch

import torch
from torch import Tensor, nn

LARGEST_BYTES = 256 * 2**20  # of weights: a session holds a copy of them, and large products gain nothing
TOLERANCE = 1e-4  # of the largest value: other summation orders give 1e-6, another formula far more
_OPSET = 20
_TYPES = frozenset({torch.float32, torch.int64, torch.bool})


def onnx_session(module: nn.Module, inputs: tuple[Tensor, ...]) -> Callable[..., Tensor] | None:
    """The module as a function of inputs of these shapes and types; None where ONNX cannot express it, or differs.

    Args:
        module: in evaluation mode, on the CPU; its weights are copied.
        inputs: tensors on the CPU, for which it gives one tensor.
    """
    weights = [*module.parameters(), *module.buffers()]
    if sum(weight.nbytes for weight in weights) > LARGEST_BYTES or any(x.dtype not in _TYPES for x in inputs):
        return None
    with torch.inference_mode(False), torch.no_grad():
        given = tuple(x.clone() for x in inputs)  # what inference mode has made cannot be recorded outside it
        expected = module(*given)
        try:
            names = [f"input_{number}" for number in range(len(given))]
            ask = _session(_exported(module, given, names), names)
            answer = ask(*given)
        except Exception:  # whatever the exporter or the runtime cannot do, or one of them is not there
            return None
    if answer.shape != expected.shape or answer.dtype != expected.dtype:
        return None
    largest = expected.abs().max().clamp(min=torch.finfo(expected.dtype).tiny)
    return ask if bool((answer - expected).abs().max() <= TOLERANCE * largest) else None


def _exported(module: nn.Module, inputs: tuple[Tensor, ...], names: Sequence[str]) -> bytes:
    """The graph. PyTorch's newer exporter takes ten times as long, and another package, for the same one."""
    out = io.BytesIO()
    fast_path = torch.backends.mha.get_fastpath_enabled()
    torch.backends.mha.set_fastpath_enabled(False)  # it is one kernel, which no graph can express
    try:
        # Shapes are constants here, this exporter has a successor, and it prints a network that it cannot express.
        with warnings.catch_warnings(), patch.object(torch._C, "_jit_onnx_log", lambda *_: None, create=True):
            warnings.simplefilter("ignore")
            torch.onnx.export(
                module, inputs, out, input_names=list(names), output_names=["out"], opset_version=_OPSET, dynamo=False
            )
    finally:
        torch.backends.mha.set_fastpath_enabled(fast_path)
    return out.getvalue()


def _session(graph: bytes, names: Sequence[str]) -> Callable[..., Tensor]:
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = torch.get_num_threads()
    options.inter_op_num_threads = 1
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")  # the simulator wants the cores as well
    options.log_severity_level = 3  # errors; warnings are of its own optimizer
    session = onnxruntime.InferenceSession(graph, options, providers=["CPUExecutionProvider"])
    there = {found.name for found in session.get_inputs()}  # what the network does not use is left out
    asked = [(number, name) for number, name in enumerate(names) if name in there]

    def ask(*inputs: Tensor) -> Tensor:
        return torch.from_numpy(session.run(None, {name: inputs[number].numpy() for number, name in asked})[0])

    return ask
