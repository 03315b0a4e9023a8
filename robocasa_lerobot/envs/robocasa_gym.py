"""RoboCasa365's own Gymnasium interface around our kitchens, for programs that were written for it.

Keys and flags are those of robocasa 1.0.1 (docs/robocasa.md, section 10): observations and actions are dictionaries by
part, and no episode ends by itself.
"""

from __future__ import annotations

import string
from collections.abc import Mapping
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import ArrayLike, NDArray

from robocasa_lerobot import contract
from robocasa_lerobot.benchmark.tasks import task_facts
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.errors import UserError

NAMESPACE = "robocasa"
VIDEO, STATE, ACTION = "video.", "state.", "action."
_LONGEST_INSTRUCTION = 256  # characters
_CHARACTERS = string.ascii_letters + string.digits + string.punctuation + " \n"

Parts = dict[str, Any]


class RoboCasaGym(gymnasium.Wrapper[Parts, Mapping[str, ArrayLike], dict[str, Any], NDArray[np.float32]]):
    """A kitchen that is observed and driven by RoboCasa's names; `unwrapped` is the `KitchenEnv`.

    Observation: `video.<camera>` uint8 (S, S, 3), upright; `state.<part>` float32, the contract's parts of the state;
    `annotation.human.task_description`, the instruction.
    Action: `action.<part>` float32 in [-1, 1], the contract's parts of an action; `gripper_close` and `control_mode`
    count as +1 from 0.5 on, else as -1.
    Reward: 1 in a step after which the goal holds, else 0, also in `info["success"]`. `terminated` and `truncated` are
    always false: who calls ends an episode at success or after `unwrapped.horizon` steps.

    Args:
        task: name of a registered task.
        seed: of the first reset that is given none; those after it go on from there.
        enable_render: without, pictures are black.
        camera_widths: width of the pictures, pixels.
        camera_heights: height of the pictures, pixels, the same.
        kitchen: further arguments of `KitchenEnv`, such as `split`.

    Raises:
        UserError: pictures that are not square, or what `KitchenEnv` refuses.
    """

    def __init__(
        self,
        task: str,
        seed: int | None = None,
        enable_render: bool = True,
        camera_widths: int = contract.IMAGE_SIZE,
        camera_heights: int = contract.IMAGE_SIZE,
        **kitchen: Any,
    ) -> None:
        if camera_widths != camera_heights:
            found = f"camera_widths {camera_widths} and camera_heights {camera_heights}"
            raise UserError(f"pictures are square here: found {found}, expected the same number.")
        cameras = tuple(kitchen.pop("cameras", contract.CAMERAS))
        drawn = cameras if enable_render else ()
        self._kitchen = KitchenEnv(task, image_size=camera_widths, cameras=drawn, terminate_on_success=False, **kitchen)
        super().__init__(self._kitchen)
        self._seed = seed
        shape = (camera_heights, camera_widths, 3)
        self._black = {} if enable_render else {camera: np.zeros(shape, np.uint8) for camera in cameras}
        box = gymnasium.spaces.Box
        self.observation_space = gymnasium.spaces.Dict(
            {
                **{VIDEO + camera: box(0, 255, shape, np.uint8) for camera in cameras},
                **{STATE + p.name: box(-np.inf, np.inf, (p.size,), np.float32) for p in contract.STATE_PARTS},
                contract.INSTRUCTION_KEY: gymnasium.spaces.Text(_LONGEST_INSTRUCTION, charset=_CHARACTERS),
            }
        )
        self.action_space = gymnasium.spaces.Dict(
            {ACTION + p.name: box(-1.0, 1.0, (p.size,), np.float32) for p in contract.ACTION_PARTS}
        )

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Parts, dict[str, Any]]:
        """As `KitchenEnv`, with RoboCasa's observation."""
        seed, self._seed = self._seed if seed is None else seed, None
        observation, info = self._kitchen.reset(seed=seed, options=options)
        return self._parts(observation), info

    def step(self, action: Mapping[str, ArrayLike]) -> tuple[Parts, float, bool, bool, dict[str, Any]]:
        """Carry out one action for 50 ms.

        Raises:
            UserError: before the first reset.
            ContractError: a part is missing, unknown, of another size or not finite.
        """
        parts = {key.removeprefix(ACTION): value for key, value in action.items()}
        observation, reward, _, _, info = self._kitchen.step(contract.join_action(parts))
        return self._parts(observation), reward, False, False, info

    def _parts(self, observation: dict[str, Any]) -> Parts:
        pictures = self._black or observation.get("pixels", {})
        state = contract.split_state(observation["agent_pos"].astype(np.float32))
        return {
            **{VIDEO + camera: picture for camera, picture in pictures.items()},
            **{STATE + name: part for name, part in state.items()},
            contract.INSTRUCTION_KEY: self._kitchen.task_description,
        }


def register_robocasa_ids() -> None:
    """Have `gymnasium.make("robocasa/<Task>", split=..., seed=...)` make our kitchens; a second call changes nothing.

    Raises:
        UserError: robocasa's own kitchens have these names in this process.
    """
    entry_point = f"{__name__}:{RoboCasaGym.__name__}"
    for name in sorted(task_facts()):
        there = gymnasium.registry.get(f"{NAMESPACE}/{name}")
        if there is not None and there.entry_point != entry_point:
            raise UserError(
                f"{NAMESPACE}/{name} is {there.entry_point} in this process. Import either robocasa or ours, or make "
                f"ours directly: {RoboCasaGym.__name__}({name!r}, split='target')."
            )
    for name in sorted(task_facts()):
        if f"{NAMESPACE}/{name}" not in gymnasium.registry:
            gymnasium.register(f"{NAMESPACE}/{name}", entry_point=entry_point, kwargs={"task": name})
