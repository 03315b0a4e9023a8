"""Which policies are computed by policy servers, and on which devices."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager

from robocasa_lerobot.errors import UnknownNameError, UserError
from robocasa_lerobot.evaluation.actors.checkpoint import PolicySource
from robocasa_lerobot.evaluation.actors.chunk_policy import STATELESS_TYPES
from robocasa_lerobot.evaluation.config.evaluation import EvaluationConfig, PolicySettings
from robocasa_lerobot.evaluation.run.messages import ServerSettings, WorkerSettings
from robocasa_lerobot.evaluation.run.policy_servers import ServerPool


def served_labels(sources: Mapping[str, PolicySource], settings: PolicySettings, device: str) -> frozenset[str]:
    """The policies that policy servers compute: on a GPU those that can be batched, elsewhere none.

    Raises:
        UserError: servers were asked for, for a policy that keeps observations in queues of its own.
    """
    from robocasa_lerobot.policies.registry import POLICY_TYPES

    checkpoints = {label: source for label, source in sources.items() if source.is_checkpoint}
    able = {
        label
        for label, source in checkpoints.items()
        if source.type in POLICY_TYPES or (source.type in STATELESS_TYPES and not source.queues)
    }
    if settings.placement == "workers" or (settings.placement == "auto" and device == "cpu"):
        return frozenset()
    if settings.placement == "servers" and set(checkpoints) - able:
        label = sorted(set(checkpoints) - able)[0]
        raise UserError(
            f"policy.placement=servers: policy {label!r} of type {sources[label].type!r} keeps observations in queues "
            "of its own, so that it runs in the workers: use auto or workers."
        )
    return frozenset(able)


def check_devices(devices: Sequence[str], device: str, here: bool) -> None:
    """Check that policy servers are on devices of the kind that the results name.

    Args:
        devices: of the servers, as given.
        device: that the policies compute on.
        here: whether this machine has them.

    Raises:
        UserError: they are not.
    """
    for name in devices:
        if name.partition(":")[0] != device:
            raise UserError(
                f"policy.devices has {name!r}, and policy.device is {device!r}, which the results name: outcomes "
                "depend on it. Set policy.device to the kind of all policy.devices, such as cuda for cuda:0."
            )
    if here and device == "cuda":
        import torch

        there = [f"cuda:{index}" for index in range(torch.cuda.device_count())]
        for name in devices:
            if name not in (*there, "cuda"):
                raise UnknownNameError("device", name, there, "(in policy.devices)")


@contextmanager
def open_servers(settings: WorkerSettings, config: EvaluationConfig) -> Iterator[ServerPool | None]:
    """The policy servers of a run, one for each device; None where nothing is served."""
    if not settings.served:
        yield None
        return
    server = ServerSettings(
        sources={label: settings.sources[label] for label in settings.served},
        device=settings.device,
        threads=settings.threads,
        width=settings.width,
        executed_steps=settings.executed_steps,
        runtime=settings.runtime,
        address="",
    )
    pool = ServerPool(server, config.policy.devices or _devices(settings.device), config.stall_seconds)
    try:
        yield pool
    finally:
        pool.close()


def _devices(device: str) -> list[str]:
    """All devices of a kind that this process sees."""
    if device != "cuda":
        return [device]
    import torch

    return [f"cuda:{index}" for index in range(torch.cuda.device_count())]
