"""Any env that LeRobot 0.6 knows, as an adapter for `foreign_worker.py`: run by its path in an interpreter that has it.

`--env.type=lerobot:NAME` with `--env.options.FIELD=VALUE` for the fields of LeRobot's own settings of that env. A task
is LeRobot's: `PushT-v0`, `CloseFridge`; of a suite `libero_10/3`, its fourth. What LeRobot does to observations after
the env (LIBERO's turned pictures and joined state) is done here.
"""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np

PACKAGES = ("lerobot", "gym-pusht", "gym-aloha", "hf-libero", "metaworld", "robocasa", "robosuite")


def make_env(
    task: str, type: str, horizon: int | None = None, image_size: int | None = None, **fields: Any
) -> LeRobotEnv:
    """One env of a registered type.

    Args:
        task: see above.
        type: LeRobot's name of the env, such as pusht.
        horizon: control steps; sets `episode_length`.
        image_size: pixels; sets height and width of observations where the env's settings have them.
        fields: further settings of LeRobot's own.
    """
    from lerobot.envs.configs import EnvConfig

    kind = EnvConfig.get_choice_class(type)
    suite, slash, number = task.partition("/")
    given = dict(fields, task=suite)
    if slash:
        given["task_ids"] = [int(number)]
    if horizon is not None:
        given["episode_length"] = horizon
    if image_size is not None:
        given.update(observation_height=image_size, observation_width=image_size)
    known = {field.name for field in dataclasses.fields(kind)}
    for name in given:
        if name not in known:
            raise ValueError(f"LeRobot's settings of {type!r} have no {name!r}; they have {', '.join(sorted(known))}")
    config = kind(**given)
    made = config.create_envs(n_envs=1, use_async_envs=False)
    (by_number,) = made.values()
    (vector,) = by_number.values()
    return LeRobotEnv(config, vector)


class LeRobotEnv:
    """The one env of a vector of one, without the vector's automatic resets."""

    def __init__(self, config: Any, vector: Any) -> None:
        self._vector = vector
        self._env = vector.envs[0]
        self._base = self._env.unwrapped
        self.action_space = self._env.action_space
        self.fps = config.fps
        self.horizon = getattr(self._base, "_max_episode_steps", None) or getattr(config, "episode_length", None)
        self._after = _processors(config)

    @property
    def task_description(self) -> str:
        """What the env tells a policy, as LeRobot asks for it; empty where it tells nothing."""
        for name in ("task_description", "task"):
            with contextlib.suppress(AttributeError):
                text = self._env.get_wrapper_attr(name)
                if isinstance(text, str):
                    return text
        return ""

    def reset(self, seed: int | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin an episode."""
        if hasattr(self._base, "init_state_id"):  # LIBERO's would count resets, whatever the seed
            self._base.init_state_id = seed
        observation, info = self._env.reset(seed=seed)
        return self._after(observation), info

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Carry out one action."""
        observation, reward, terminated, truncated, info = self._env.step(action)
        if "is_success" not in info:
            info = dict(info, is_success=bool(info.get("success", False)))
        return self._after(observation), reward, terminated, truncated, info

    def close(self) -> None:
        """End the env."""
        self._vector.close()


def _processors(config: Any) -> Callable[[Any], Any]:
    """What LeRobot's settings of an env do to an observation, from numbers to numbers."""
    before, after = config.get_env_processors()
    if after.steps:
        raise ValueError("LeRobot changes the actions of this env on their way to it, which is not supported here")
    if not before.steps:
        return lambda observation: observation
    import torch
    from lerobot.envs.utils import preprocess_observation

    def apply(observation: Any) -> dict[str, Any]:
        batch = before(preprocess_observation(_batched(observation)))
        out: dict[str, Any] = {}
        pixels: dict[str, Any] = {}
        for name, value in batch.items():
            if not isinstance(value, torch.Tensor):
                continue
            array = value[0].cpu().numpy()
            if name.startswith("observation.images."):
                pixels[name.rpartition(".")[2]] = np.rint(array.transpose(1, 2, 0) * 255).astype(np.uint8)
            elif name == "observation.state":
                out["agent_pos"] = array
        return dict(out, pixels=pixels)

    return apply


def _batched(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _batched(inner) for name, inner in value.items()}
    return np.asarray(value)[None]
