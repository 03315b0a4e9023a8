"""Evaluations of a policy behind a socket, as a user runs them: a small policy, the command, its records."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from evaluation_env import SlideEnv

from robocasa_lerobot.cli import main
from robocasa_lerobot.evaluation.records.results import Results, read_results

FORWARD = 7  # of the base, in HDF5 order: what moves the slider
PI0 = "--policy.keys=robocasa365_pi0"


class OtherEnv(SlideEnv):
    """An env that is no kitchen: a camera less, and two numbers of proprioception."""

    def _observe(self) -> Any:
        seen = super()._observe()
        return {"pixels": {"front": seen["pixels"]["robot0_agentview_left"]}, "agent_pos": seen["agent_pos"][:2]}


def push(request: Any) -> dict[str, Any]:
    """A policy that depends on what it sees: it pushes the block, backwards where it is far."""
    state, actions = np.asarray(request["observation/state"]), np.zeros((50, 12), np.float32)
    assert request["observation/image"].shape == (224, 224, 3)
    assert state.shape == (16,)
    actions[:, FORWARD] = 0.15 + 0.25 * state[7]  # base_x, where the slider is
    return {"actions": actions, "server_timing": {"infer_ms": 0.1}}


def command(url: str, out: Path, *more: str, keys: str = PI0) -> list[str]:
    fixed = ["--seed=1", "--env.factory=evaluation_env:SlideEnv", "--env.image_size=32", "--videos=0", "--workers=1"]
    label = "--policy.label=theirs"
    patience = ["--remote.connect_seconds=30", "--remote.answer_seconds=20"]
    tasks = ["--env.tasks=Slide", "--trials=4"]
    return [
        "eval",
        f"--policy={url}",
        *([keys] if keys else []),
        label,
        f"--out={out}",
        *fixed,
        *patience,
        *tasks,
        *more,
    ]


def evaluate(url: str, out: Path, *more: str, keys: str = PI0) -> Results:
    assert main(command(url, out, *more, keys=keys)) == 0
    return read_results(out)


def comparable(results: Results) -> list[dict[str, Any]]:
    return [record.comparable() for record in sorted(results.trials, key=lambda record: record.key)]
