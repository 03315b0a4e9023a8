"""The same seed and actions give the same bits, alone and over workers, asleep or not; nothing grows with time."""

from __future__ import annotations

import ast
import hashlib
import re
import subprocess
import sys
from contextlib import closing

import mujoco
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray
from source_tree import PACKAGE
from task_selection import demonstrated, sample

from robocasa_lerobot.demos.demonstrator import demonstrate
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.state import KitchenState
from robocasa_lerobot.envs.vector.kitchens import make_vector_env

EPISODE_STEPS = 15


def command(seed: int, step: int) -> NDArray[np.float32]:
    """A wandering action that depends on the episode alone."""
    direction = np.random.default_rng(seed).uniform(-1, 1, 12)
    wander = np.random.default_rng([seed, step]).normal(size=12)
    return np.clip(direction + 0.3 * wander, -1, 1).astype(np.float32)


def digest(state: KitchenState, observations: list[NDArray[np.float64]]) -> str:
    parts = [state.physics, state.asleep, state.controller, *observations]
    return hashlib.sha256(b"".join(part.tobytes() for part in parts)).hexdigest()


def alone(task: str, seeds: list[int]) -> list[str]:
    env = KitchenEnv(task, cameras=(), terminate_on_success=False)
    digests = []
    for seed in seeds:
        env.reset(seed=seed)
        observed = [env.step(command(seed, step))[0]["agent_pos"] for step in range(EPISODE_STEPS)]
        digests.append(digest(env.get_state(), observed))
    return digests


def over_workers(task: str, seeds: list[int], workers: int) -> list[str]:
    digests: list[str] = []
    envs = make_vector_env(task, workers, cameras=(), terminate_on_success=False, autoreset=AutoresetMode.DISABLED)
    with closing(envs):
        for start in range(0, len(seeds), workers):
            batch = seeds[start : start + workers]
            padded = [*batch, *([0] * (workers - len(batch)))]
            envs.reset(seed=padded)
            observed: list[NDArray[np.float64]] = []
            for step in range(EPISODE_STEPS):
                observations, *_ = envs.step(np.stack([command(seed, step) for seed in padded]))
                observed.append(observations["agent_pos"])
            states = envs.call("get_state")
            digests += [digest(states[i], [row[i] for row in observed]) for i in range(len(batch))]
    return digests


@pytest.mark.parametrize("task", demonstrated())
def test_a_few_episodes_are_the_same_alone_and_over_workers(task: str) -> None:
    seeds = [4, 9, 1]
    expected = alone(task, seeds)
    assert len(set(expected)) == len(seeds)
    assert over_workers(task, seeds, 2) == expected


@pytest.mark.slow
def test_two_hundred_episodes_are_the_same_over_one_and_two_workers() -> None:
    tasks = sample()
    for index, task in enumerate(tasks):
        seeds = list(range(index, 200, len(tasks)))
        one = over_workers(task, seeds, 1)
        assert over_workers(task, seeds, 2) == one
        assert len(set(one)) == len(seeds)


def terms_at_the_end(env: KitchenEnv) -> dict[str, bool]:
    """The success terms at the end of a demonstration."""
    for action in demonstrate(env):
        _, _, terminated, truncated, info = env.step(action.astype(np.float32))
        if terminated or truncated:
            break
    return dict(info["success_terms"])


@pytest.mark.slow
@pytest.mark.parametrize("task", demonstrated())
def test_sleep_changes_no_outcome(task: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A demonstrator that sees the state meets the same success terms with MuJoCo's sleep and without."""
    outcomes: dict[bool, list[dict[str, bool]]] = {}
    for sleep in (True, False):
        env = KitchenEnv(task, cameras=())
        outcomes[sleep] = []
        for seed in range(5):
            env.reset(seed=seed)
            if not sleep:
                env.model.opt.enableflags &= ~int(mujoco.mjtEnableBit.mjENBL_SLEEP)
            outcomes[sleep].append(terms_at_the_end(env))
    assert outcomes[True] == outcomes[False]
    assert any(all(terms.values()) for terms in outcomes[True])


_SOAK = """
import numpy as np, psutil
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
env = KitchenEnv("PickPlaceCounterToSink", image_size=32)
process = psutil.Process()
action = np.zeros(12, np.float32)
action[5] = 0.3
resident = []
for episode in range(1000):
    env.reset(seed=episode)
    env.render_observations = False
    for _ in range(20):
        env.step(action)
    env.render_observations = True
    if episode % 100 == 99:
        resident.append(process.memory_info().rss / 2**20)
print(*resident)
"""


@pytest.mark.slow
@pytest.mark.render
@pytest.mark.timeout(1200)
def test_a_thousand_resets_and_twenty_thousand_steps_leave_memory_flat() -> None:
    """Every reset makes a new scene, with its OpenGL context and pictures; MiB after each hundred episodes."""
    done = subprocess.run([sys.executable, "-c", _SOAK], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    resident = [float(word) for word in done.stdout.split()]
    assert len(resident) == 10
    # The first hundred fill caches; from then on the second half may not lie above the first.
    growth = np.mean(resident[-3:]) - np.mean(resident[1:4])
    assert growth < 20, f"grew by {growth:.0f} MiB: {resident}"


def test_no_two_streams_of_a_seed_are_the_same() -> None:
    """What is drawn for one purpose says nothing of what is drawn for another: each has a number of its own."""
    found: list[tuple[int, str, str]] = []
    apart = PACKAGE / "evaluation/planning/trials.py"  # whose seeds are an evaluation's
    for path in sorted(set(PACKAGE.rglob("*.py")) - {apart}):
        for line in re.findall(r"^\w*_STREAM\b.*=.*$", path.read_text(encoding="utf-8"), re.MULTILINE):
            names, _, values = line.partition("=")
            numbers = ast.literal_eval(values.partition("#")[0].strip())
            numbers = numbers if isinstance(numbers, tuple) else (numbers,)
            found += [(number, name.strip(), path.name) for number, name in zip(numbers, names.split(","), strict=True)]
    assert {"_CAMERA_NOISE_STREAM", "_NOISE_STREAM", "_ARM_NOISE_STREAM"} <= {name for _, name, _ in found}
    shared = [one for one in found if sum(one[0] == other[0] for other in found) > 1]
    assert not shared, "take the next free number"
