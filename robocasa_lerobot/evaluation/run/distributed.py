"""Shards of an evaluation on a Slurm cluster or on Ray, through datatrove, as conversions run there."""

from __future__ import annotations

import dataclasses
from functools import partial
from typing import Any

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.config.evaluation import EvaluationConfig
from robocasa_lerobot.jobs.executors import Execution, submit_to_slurm
from robocasa_lerobot.jobs.ray import run_with_ray

_FOLDER, _LOGS = ".executor", "slurm"


def run_shard(data: Any, rank: int = 0, world_size: int = 1, *, config: EvaluationConfig) -> None:
    """Evaluate one shard, in datatrove's calling convention."""
    from robocasa_lerobot.evaluation.run.engine import evaluate, prepare

    evaluate(prepare(dataclasses.replace(config, shard=f"{rank + 1}/{world_size}")))


def finish(config: EvaluationConfig) -> None:
    """Join the shards, and write the report."""
    from robocasa_lerobot.evaluation.run.engine import prepare
    from robocasa_lerobot.evaluation.run.merging import merge
    from robocasa_lerobot.evaluation.run.outputs import write_outputs

    evaluation = prepare(config, ask=False, here=False)
    merge(evaluation)
    write_outputs(evaluation)


def run_distributed(config: EvaluationConfig, shards: int, execution: Execution) -> str | None:
    """Run all shards with Ray and join them, or submit them to Slurm; a line for the user where it does not wait.

    Raises:
        UserError: the executor is not there, Slurm refuses, or what an evaluation itself raises.
    """
    from robocasa_lerobot.evaluation.run.engine import prepare

    if shards < 1:
        raise UserError(f"--shards: found {shards}, expected at least 1.")
    if config.shard is not None:
        raise UserError("--executor runs all shards: leave --shard out.")
    evaluation = prepare(config, here=False)  # mistakes come up here, not in the first job
    out, sources = evaluation.out, evaluation.sources
    # Shards run what was there when they were submitted, whatever `checkpoints/last` is by then.
    policy = dataclasses.replace(config.policy, path=[s.path for s in sources.values()], label=list(sources))
    # A node shows cores that are not the shard's.
    config = dataclasses.replace(config, policy=policy, out=str(out), workers=config.workers or execution.cpus)
    step, last_step = partial(run_shard, config=config), partial(finish, config)
    folder = out / _FOLDER / f"{evaluation.header.id}-{shards}"
    folder.mkdir(parents=True, exist_ok=True)
    # Every shard runs: its records say what is left, which retry_errors and videos decide as well.
    if execution.kind == "ray":
        run_with_ray(step, shards, folder, execution.ray, skip_complete=False)
        last_step()
        return None
    array, last = submit_to_slurm(step, last_step, shards, folder, out / _LOGS, execution.slurm, skip_complete=False)
    return f"submitted to Slurm: shards in job {array}, joined by job {last}. What they print is in {out / _LOGS}."
