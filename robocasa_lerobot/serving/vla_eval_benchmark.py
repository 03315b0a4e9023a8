"""Our kitchens as a benchmark of vla-eval: `benchmark: robocasa_lerobot.serving.vla_eval_benchmark:KitchenBenchmark`.

`vla-eval run --no-docker --config FILE` runs it, from an environment that has vla-eval beside this package. The class
is made when it is asked for, so that this module imports without vla-eval.
Source of the conventions: vla-eval 0.8.0's base classes and its RoboCasa365 benchmark.
"""

from __future__ import annotations

import functools
import importlib
import inspect
from typing import Any

from robocasa_lerobot.errors import UserError

NAME = "KitchenBenchmark"


def __getattr__(name: str) -> Any:
    if name == NAME:
        return _benchmark_class()
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


@functools.cache
def _benchmark_class() -> type:
    """The class; its docstring is that of `Kitchens`.

    Raises:
        UserError: vla-eval is not installed.
    """
    try:
        base = importlib.import_module("vla_eval.benchmarks.base")
        specs = importlib.import_module("vla_eval.specs")
    except ImportError as error:
        raise UserError(
            f"{NAME} needs vla-eval in the environment that runs this ({error}): install vla-eval==0.8.0 beside "
            "robocasa_lerobot, in an environment of its own (docs/serving.md)."
        ) from error
    from robocasa_lerobot.serving.kitchens import Kitchens, Step

    class KitchenBenchmark(base.StepBenchmark):  # type: ignore[name-defined]
        render_backends = frozenset({"gpu", "cpu"})
        _ALL_RECORD_FIELDS = frozenset({"reward", "done", "success"})

        @classmethod
        def configure_render(cls, mode: str) -> dict[str, str]:
            render = importlib.import_module("vla_eval.render")
            # On a GPU the kitchens choose EGL themselves.
            return dict(render.configure_mujoco_render(mode)) if mode == "cpu" else {}

        def __init__(self, **settings: Any) -> None:
            super().__init__()
            self._kitchens = Kitchens(**settings)

        def cleanup(self) -> None:
            self._kitchens.close()

        def get_tasks(self) -> list[dict[str, Any]]:
            return self._kitchens.tasks()

        def reset(self, task: dict[str, Any]) -> Any:
            trial = int(task.get("episode_idx", 0))
            # The runner sends the task's numbers to the policy's server with the episode's start: a server that knows
            # `policy_seed` draws the noise of our own evaluation.
            task.update(self._kitchens.seeds(task["name"], trial))
            observation = self._kitchens.reset(task["name"], trial)
            self._record(observation)
            return observation

        def step(self, action: dict[str, Any]) -> Any:
            step: Step = self._kitchens.step(action)
            self._record(step.observation)
            self._recorder.record_step(reward=step.reward, done=step.done, success=step.success)
            return base.StepResult(step.observation, step.reward, step.done, {"success": step.success})

        def _record(self, observation: dict[str, Any]) -> None:
            self._recorder.record_video(next(iter(observation["images"].values())))

        def make_obs(self, raw_obs: Any, task: dict[str, Any]) -> dict[str, Any]:
            return dict(raw_obs)

        def get_step_result(self, step_result: Any) -> dict[str, Any]:
            return {"success": bool(step_result.info.get("success", False))}

        def get_metadata(self) -> dict[str, Any]:
            return {"max_steps": self._kitchens.longest, "seed": self._kitchens.seed}

        def get_hold_action(self, last_action: dict[str, Any] | None) -> dict[str, Any]:
            return {"actions": self._kitchens.held(None if last_action is None else last_action.get("actions"))}

        def get_action_spec(self) -> dict[str, Any]:
            return {
                "position": specs.POSITION_DELTA,
                "rotation": specs.ROTATION_AA,
                "gripper": specs.GRIPPER_CLOSE_01,
                "base_motion": specs.BASE_MOTION,
                "control_mode": specs.CONTROL_MODE_01,
            }

        def get_observation_spec(self) -> dict[str, Any]:
            return {"image": specs.IMAGE_RGB, "state": specs.RAW, "language": specs.LANGUAGE}

        def render(self) -> Any:
            return self._kitchens.render()

    # What the runner reads: which settings there are, and what they mean.
    KitchenBenchmark.__init__.__signature__ = inspect.signature(Kitchens.__init__)  # type: ignore[attr-defined]
    KitchenBenchmark.__doc__ = Kitchens.__doc__
    return KitchenBenchmark
