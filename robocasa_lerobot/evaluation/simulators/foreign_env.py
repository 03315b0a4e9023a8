"""An env of another interpreter as a Gymnasium env of this one: what an evaluation's worker steps."""

from __future__ import annotations

from typing import Any, ClassVar

import gymnasium
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.simulators.fit import Needs, UnfitPolicyError
from robocasa_lerobot.evaluation.simulators.process import Arrays, EnvRaisedError, ForeignProcess, SimulatorError
from robocasa_lerobot.evaluation.simulators.simulator import Simulator

_PICTURES = "pixels"


class ForeignEnv(gymnasium.Env[Any, Any]):
    """A foreign env, in a process of its own that ends with this one.

    Observations are nested as the env gives them, pictures uint8 (H, W, 3) under `pixels`; where `render_observations`
    is false, those of the last step stay. `horizon` is in control steps at `fps` Hz; both are None where the env does
    not say.

    Args:
        simulator: interpreter, factory and its options.
        task: the env's own name of it.
        arguments: for the factory, beside the options.

    Raises:
        UserError: the factory raised; it would for every other trial.
        SimulatorError: the process died.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": []}

    def __init__(self, simulator: Simulator, task: str, **arguments: Any) -> None:
        self.task, self.task_description = task, ""
        self.render_observations = True
        self.rendering_seconds = 0.0
        self.needs: Needs | None = None  # of the policy that comes next
        self._pictures: dict[str, Any] = {}
        self._process = ForeignProcess(simulator.python)
        try:
            asked = {name: value for name, value in arguments.items() if value is not None}
            given = {**simulator.options, **asked}
            said, arrays = self._process.ask("make", factory=simulator.factory, task=task, arguments=given)
            low, high = (np.asarray(arrays[name], np.float64) for name in ("low", "high"))
            self.horizon: int | None = said["horizon"]
            self.fps: float | None = said["fps"]
            self.has_expert = bool(said["expert"])
        except EnvRaisedError as error:
            self._process.close()
            raise UserError(f"task {task}: env.factory {simulator.factory} cannot make its env:\n{error}") from error
        except KeyError as error:
            self._process.kill()
            raise SimulatorError(f"the simulator's process made an env without {error}") from error
        except BaseException:
            self._process.kill()
            raise
        if low.ndim != 1 or low.shape != high.shape:
            self._process.kill()
            raise UnfitPolicyError(f"task {task}: actions of shape {low.shape}, expected vectors (n,).")
        self.action_space = gymnasium.spaces.Box(low.astype(np.float32), high.astype(np.float32), dtype=np.float32)

    @property
    def pid(self) -> int:
        """Of the foreign process."""
        return self._process.pid

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[dict[str, Any], Any]:
        """Begin an episode; pictures of the last one are forgotten.

        Raises:
            UnfitPolicyError: the observation lacks what the next policy `needs`.
        """
        self._pictures = {}
        said, arrays = self._process.ask("reset", seed=seed, pictures=self.render_observations)
        observation = self._observed(arrays)
        if self.needs is not None:
            self.needs.check(observation)
        return observation, self._info(said)

    def step(self, action: Any) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        """One control step.

        Raises:
            UnfitPolicyError: an action of another size than the env's.
        """
        given = np.asarray(action, np.float32)
        if given.shape != self.action_space.shape:
            raise UnfitPolicyError(
                f"task {self.task}: the policy gives actions of shape {given.shape}, the env takes "
                f"{self.action_space.shape}: it was trained for another robot."
            )
        said, arrays = self._process.ask("step", {"action": given}, pictures=self.render_observations)
        try:
            ends = bool(said["terminated"]), bool(said["truncated"])
            return self._observed(arrays), float(said["reward"]), *ends, self._info(said)
        except KeyError as error:
            raise SimulatorError(f"the simulator's process answered a step without {error}") from error

    def expert_action(self) -> NDArray[np.float32]:
        """The action of the env's own expert.

        Raises:
            UnfitPolicyError: it has none.
        """
        if not self.has_expert:
            raise UnfitPolicyError(
                f"task {self.task}: its env has no expert (a method `expert_action`), so that --policy=demonstrator "
                "has nothing to show."
            )
        return np.asarray(self._process.ask("expert")[1]["action"], np.float32)

    def close(self) -> None:
        """End the env and its process."""
        self._process.close()

    def _observed(self, arrays: Arrays) -> dict[str, Any]:
        out: dict[str, Any] = {}
        seen = {name: value for name, value in arrays.items() if name.split("/")[0] == _PICTURES}
        for name, value in seen.items():
            if value.dtype != np.uint8 or value.ndim != 3 or value.shape[-1] != 3:
                raise SimulatorError(
                    f"picture {name!r} is {value.dtype} of shape {value.shape}, expected uint8 (height, width, 3)."
                )
        self._pictures = seen or self._pictures
        for name, value in {**arrays, **self._pictures}.items():
            *folders, last = name.split("/")
            here = out
            for folder in folders:
                here = here.setdefault(folder, {})
            here[last] = value
        return out

    def _info(self, said: dict[str, Any]) -> dict[str, Any]:
        try:
            self.task_description = str(said["instruction"]) or self.task_description
            success, terms = bool(said["is_success"]), dict(said["terms"])
        except (KeyError, TypeError, ValueError) as error:
            raise SimulatorError(f"the simulator's process answered without what is needed: {error!r}") from error
        return {"is_success": success, "success_terms": terms, "instruction": self.task_description}


def make_env(simulator: dict[str, Any], task: str, **arguments: Any) -> ForeignEnv:
    """A foreign env from a simulator's fields: the worker's factory."""
    return ForeignEnv(Simulator(**simulator), task, **arguments)
