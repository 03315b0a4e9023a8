"""The kitchens as a LeRobot env type: `lerobot-eval --env.type=robocasa_kitchen --env.task=OpenDrawer`.

The one module of `envs/` that imports LeRobot. The keys, shapes and rates are those of LeRobot's own `robocasa`
env type, so a policy trained on either runs on both without a rename map.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import gymnasium
from lerobot.configs import FeatureType, PolicyFeature
from lerobot.envs.configs import EnvConfig
from lerobot.envs.utils import _LazyAsyncVectorEnv

from robocasa_lerobot import contract
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.tasks import registry
from robocasa_lerobot.envs.vector.freeze_at_end import held
from robocasa_lerobot.envs.vector.kitchens import make_vector_env
from robocasa_lerobot.errors import UnknownNameError, UserError
from robocasa_lerobot.gl import ensure_drawing

ENV_TYPE = "robocasa_kitchen"
_PRETRAINING = re.compile(r"pretrain\d+")  # task sets that are tried in pretraining kitchens


class _ReopeningVectorEnv(gymnasium.vector.SyncVectorEnv):
    """A vector env in this process that can be used again after `close()`, and then be closed again.

    Evaluation during LeRobot's training closes its envs after each round and resets them for the next; the base
    class would count as closed for good, and its OpenGL context would be left to the interpreter's end.
    """

    def reset(self, **kwargs: Any) -> tuple[Any, dict[str, Any]]:
        self.closed = False
        return super().reset(**kwargs)


class _LazyKitchens(_LazyAsyncVectorEnv):
    """LeRobot's vector env that starts its processes on first use, with our workers, which report their failures.

    After a failure, as after `close()`, the next use starts new processes.
    """

    _env: Any

    def __init__(self, makes: list[Callable[[], KitchenEnv]], devices: list[int] | None) -> None:
        super().__init__(makes)
        self._devices = devices

    def _ensure(self) -> None:
        if self._env is not None and self._env.closed:
            self._env = None
        if self._env is None:
            # An env whose episode has ended stands still until the others' have, as in LeRobot's own.
            self._env = make_vector_env([partial(held, make) for make in self._env_fns], devices=self._devices)


@EnvConfig.register_subclass(ENV_TYPE)
@dataclass
class RobocasaKitchenEnvConfig(EnvConfig):
    """One or more kitchen tasks, each evaluated in vector envs of its own.

    `task` is a task name, a task set, or a comma-separated list of them, `image_size` the height and width in pixels,
    and `episode_length` the time limit in control steps (20 Hz), by default each task's own horizon. Where no `split`
    is given, it is that of the task set, as with LeRobot's own RoboCasa: `pretrain50` to `pretrain300` are tried in
    pretraining kitchens, the other sets in the target kitchens. Tasks by their names, and lists, are tried in the
    target kitchens too (lists of nothing but pretraining sets in theirs), where LeRobot's RoboCasa takes `all`
    kitchens: rates of both are to be compared with `split` given. `render_devices` are the EGL devices (not CUDA's
    numbers, see `gl`) that parallel kitchens are dealt out to; EGL's choice if None.
    """

    task: str = "OpenDrawer"
    fps: int = contract.CONTROL_HZ
    split: str | None = None
    render_preset: str = "fast"
    image_size: int = contract.IMAGE_SIZE
    episode_length: int | None = None
    render_devices: list[int] | None = None
    features: dict[str, PolicyFeature] = field(default_factory=dict)
    features_map: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Fill in the features, which follow from the contract and the image size.

        Raises:
            UserError: a rate other than the contract's, or several tasks in parallel threads.
        """
        if self.fps != contract.CONTROL_HZ:
            raise UserError(
                f"env.fps: found {self.fps}, but the kitchens run at {contract.CONTROL_HZ} control steps/s."
            )
        if self.max_parallel_tasks != 1:
            # LeRobot shares one policy, with its action queue, between such threads: actions get mixed up.
            raise UserError(
                f"env.max_parallel_tasks: found {self.max_parallel_tasks}, expected 1; "
                "for more speed raise --eval.batch_size instead."
            )
        shapes: dict[str, tuple[FeatureType, tuple[int, ...], str]] = {
            "action": (FeatureType.ACTION, (contract.ACTION_SIZE,), contract.ACTION_KEY),
            "agent_pos": (FeatureType.STATE, (contract.STATE_SIZE,), contract.STATE_KEY),
        }
        for camera in contract.CAMERAS:
            shape = (self.image_size, self.image_size, 3)
            shapes[f"pixels/{camera}"] = (FeatureType.VISUAL, shape, contract.image_key(camera))
        self.features = {key: PolicyFeature(type=kind, shape=shape) for key, (kind, shape, _) in shapes.items()}
        self.features_map = {key: policy_key for key, (_, _, policy_key) in shapes.items()}

    @property
    def gym_kwargs(self) -> dict[str, Any]:
        """Keyword arguments of `KitchenEnv`, less the task."""
        return {
            "split": self._split(),
            "render_preset": self.render_preset,
            "image_size": self.image_size,
            "horizon": self.episode_length,
        }

    def _split(self) -> str:
        if self.split is not None:
            return self.split
        asked = [name.strip() for name in self.task.split(",") if name.strip()]
        return "pretrain" if asked and all(_PRETRAINING.fullmatch(name) for name in asked) else "target"

    def task_names(self) -> tuple[str, ...]:
        """The tasks that `task` names, in order, with each set replaced by its members.

        Raises:
            UserError: `task` names none, or one twice.
            UnknownNameError: a name that is neither a task nor a set.
        """
        names: list[str] = []
        for name in (part.strip() for part in (self.task or "").split(",")):
            if name in registry.task_names():
                names.append(name)
            elif name in registry.task_sets():
                names += registry.task_set(name)
            elif name:
                known = (*registry.task_names(), *registry.task_sets())
                raise UnknownNameError("task or task set", name, known, "`robocasa-lerobot tasks` lists them.")
        if not names or len(set(names)) < len(names):
            raise UserError(f"env.task: found {self.task!r}, expected different task names separated by commas.")
        return tuple(names)

    def create_envs(self, n_envs: int, use_async_envs: bool = True) -> dict[str, dict[int, Any]]:
        """A vector env of `n_envs` kitchens for each task: `{task: {0: env}}`.

        More than one kitchen means one process for each, because a process owns one GL context; the processes
        start on first use, so that of many tasks only the one that is running holds memory. Sub-env i is reset with
        exactly the i-th seed that it is given.

        Raises:
            UserError: more than one env without processes; NoOpenGLError where nothing can render.
        """
        if n_envs > 1 and not use_async_envs:
            raise UserError(
                f"{n_envs} kitchens in one process would share one OpenGL context; "
                "use --eval.use_async_envs=true, or --eval.batch_size=1."
            )
        names = self.task_names()
        ensure_drawing()  # here, so that the workers inherit the choice
        return {name: {0: self._vector_env(partial(KitchenEnv, name, **self.gym_kwargs), n_envs)} for name in names}

    def _vector_env(self, make: Callable[..., KitchenEnv], n_envs: int) -> Any:
        if n_envs > 1:
            return _LazyKitchens([make] * n_envs, self.render_devices)
        if self.render_devices:
            make = partial(make, render_device=self.render_devices[0])
        return _ReopeningVectorEnv([make])
