"""The kitchen as a Gymnasium env: a robot, one task, three cameras, 20 control steps per second."""

from __future__ import annotations

import copy
import time
from collections.abc import Sequence
from typing import Any

import gymnasium
import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot import contract, gl
from robocasa_lerobot.envs.kitchens.splits import expand, scene_ids, without
from robocasa_lerobot.envs.physics.whole_state import read_physics
from robocasa_lerobot.envs.pictures import Pictures, picture_spaces, segmentation_names, take_pictures
from robocasa_lerobot.envs.rendering import SceneRenderer
from robocasa_lerobot.envs.robots.camera_noise import CameraNoise, choose_noise
from robocasa_lerobot.envs.robots.cameras import check_camera_names
from robocasa_lerobot.envs.robots.control_step import control_step
from robocasa_lerobot.envs.robots.panda_omron.robot import PANDA_OMRON
from robocasa_lerobot.envs.robots.robot import Controller, Robot
from robocasa_lerobot.envs.scene.build import RENDER_PRESETS, build_scene
from robocasa_lerobot.envs.scene.reset_noise import InitialNoise, add_initial_noise
from robocasa_lerobot.envs.scene.scene import Scene
from robocasa_lerobot.envs.seeds import checked_count, checked_seed
from robocasa_lerobot.envs.state import KitchenState, check_fits, check_kind, restore
from robocasa_lerobot.envs.tasks.registry import get_task
from robocasa_lerobot.envs.tasks.task import BoundTask, Task
from robocasa_lerobot.errors import UnknownNameError, UserError

Observation = dict[str, Any]
# Key of the generator that noise on the initial arm pose comes from, apart from the one that makes the scene.
_ARM_NOISE_STREAM = 1
_WORDING_STREAM = 4  # of the choice among a task's paraphrases
_SEED_LIMIT = 2**31  # of seeds that the env draws for itself


class KitchenEnv(gymnasium.Env[Observation, NDArray[np.float32]]):
    """One task in kitchens of a split; every reset makes a new scene from its seed.

    A reset with the seed of the running scene returns to its beginning without building it again. `get_state` and
    `set_state` carry a running episode to another time or env.

    Observation: `pixels` {camera: uint8 (S, S, 3), upright} and `agent_pos` float64 (16,), the contract's state; on
    request `depth` {camera: float32 (S, S, 1), metres along the optical axis} and `segmentation` {camera: int32
    (S, S, 1), geom ids, -1 for nothing}, see `segmentation_names`. Without cameras `agent_pos` alone.
    Action: float32 (12,) in [-1, 1] in the contract's stored order; binary parts count as +1 from 0.5 on.
    Reward: 1 in a step after which the goal holds, else 0. `terminated` at success, `truncated` at the horizon.
    Info, at reset and every step: `success`, `is_success`, `success_terms`, `instruction`, `task`, `scene`, `seed`.

    Args:
        task: name of a registered task, or a declaration that is in the making.
        split: "target" or "pretrain"; or of the latter "pretrain_val", fifty kitchens, or "pretrain_train", the others.
        render_preset: "fast" (no shadows) or "quality".
        image_size: height and width of the pictures, pixels.
        cameras: names of the cameras that are observed, of the robot's `camera_sets`.
        horizon: control steps until truncation; the task's own if None.
        terminate_on_success: end the episode at the first success.
        render_mode: "rgb_array" or None.
        render_device: EGL device that this process draws on (see `gl`); EGL's choice if None. One process draws on
            one device: for several, see `vector.kitchens.make_vector_env`.
        camera_set: "default", or "cotraining" for the real robot's poses and wrist lens.
        camera_noise: True for RoboCasa's noise on camera poses, or noise of one's own; it follows from the episode's
            seed and changes nothing but pictures.
        novel_language: give one of the task's other wordings as instruction, chosen by the episode's seed.
        initial_noise: on the robot's start, in place of RoboCasa's 0.02 rad on the arm's joints.
        depth: observe depth.
        segmentation: observe which geom each pixel shows.
        layouts: ids of layouts, or of groups of them (negative, see `kitchens.splits`), instead of the split's own.
        styles: the same for styles. States and seeds go with them: the same seed elsewhere is another scene.
        robot: that acts in it.

    Raises:
        UnknownNameError: no such task, split, preset, render mode, camera, camera set, layout or style.
        UserError: an image size or horizon that is no such number, a camera twice, or a noise that is none.
        RenderDeviceError: no such render device.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": contract.CONTROL_HZ}  # noqa: RUF012 (Gymnasium's name)

    def __init__(
        self,
        task: str | Task,
        split: str = "target",
        render_preset: str = "fast",
        image_size: int = contract.IMAGE_SIZE,
        cameras: tuple[str, ...] = contract.CAMERAS,
        horizon: int | None = None,
        terminate_on_success: bool = True,
        render_mode: str | None = "rgb_array",
        render_device: int | None = None,
        camera_set: str = "default",
        camera_noise: bool | CameraNoise = False,
        initial_noise: InitialNoise | None = None,
        novel_language: bool = False,
        depth: bool = False,
        segmentation: bool = False,
        layouts: Sequence[int] | None = None,
        styles: Sequence[int] | None = None,
        robot: Robot = PANDA_OMRON,
    ) -> None:
        self._declared, self.robot = task if isinstance(task, Task) else get_task(task), robot
        chosen = scene_ids(split, layouts=layouts, styles=styles)  # fails here, not at the first reset
        without(chosen, self._declared.needs, self._declared.exclude_styles)
        self.layouts = None if layouts is None else list(expand(layouts, "layout"))
        self.styles = None if styles is None else list(expand(styles, "style"))
        self._kitchens = None if layouts is None and styles is None else chosen
        if render_preset not in RENDER_PRESETS:
            raise UnknownNameError("render preset", render_preset, RENDER_PRESETS)
        if render_mode not in (None, "rgb_array"):
            raise UnknownNameError("render mode", str(render_mode), ["rgb_array"])
        if not isinstance(initial_noise, InitialNoise | None):
            raise UserError(f"initial_noise: found {initial_noise!r}, expected an InitialNoise(...) or None.")
        if render_device is not None:
            gl.check_device(render_device)
        self.task = self._declared.name
        self.split = split
        self.render_preset = render_preset
        self.image_size = checked_count("image_size", image_size, contract.LARGEST_IMAGE_SIZE)
        self.cameras = check_camera_names(cameras, robot.cameras(camera_set))
        self.camera_set = camera_set
        if novel_language and not self._declared.paraphrases:
            raise UserError(f"novel_language: task {task} declares no paraphrases.")
        self.novel_language = novel_language
        self.initial_noise = initial_noise
        self.camera_noise = choose_noise(camera_noise, robot.camera_noise.get(camera_set))
        self._kinds = {"depth": depth, "segmentation": segmentation}
        self.horizon = self._declared.horizon if horizon is None else checked_count("horizon", horizon)
        self._max_episode_steps = self.horizon  # where LeRobot looks
        self.terminate_on_success = terminate_on_success
        self.render_mode = render_mode
        self.render_device = render_device
        self.render_observations = True
        self.rendering_seconds = 0.0  # wall time in which observations' pictures were made, since the env was made
        self.task_description = ""
        # Gymnasium's checker takes no empty dictionary for a space.
        pictures = picture_spaces(self.cameras, image_size, **self._kinds) if self.cameras else {}
        self.observation_space = gymnasium.spaces.Dict(
            {
                **pictures,
                "agent_pos": gymnasium.spaces.Box(-np.inf, np.inf, (contract.STATE_SIZE,), np.float64),
            }
        )
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (contract.ACTION_SIZE,), np.float32)
        self._scene: Scene | None = None
        self._bound: BoundTask | None = None
        self._data: mujoco.MjData | None = None
        self._controller: Controller | None = None
        self._renderer: SceneRenderer | None = None
        self._pictures: Pictures = {}
        self._steps = 0
        self._initial: KitchenState | None = None  # of the running scene, right after its reset

    @property
    def declaration(self) -> BoundTask:
        """The task of the running episode, with goal and stages of what was drawn."""
        if self._bound is None:
            raise UserError("the env has no scene yet, and so no task in it: call reset() first.")
        return self._bound

    @property
    def scene(self) -> Scene:
        """The scene of the running episode."""
        if self._scene is None:
            raise UserError("the env has no scene yet: call reset() first.")
        return self._scene

    @property
    def model(self) -> mujoco.MjModel:
        """The compiled model of the running episode."""
        return self.scene.model

    @property
    def data(self) -> mujoco.MjData:
        """The simulation state of the running episode."""
        assert self.scene is not None
        assert self._data is not None
        return self._data

    @property
    def controller(self) -> Controller:
        """What drives the robot in the running episode."""
        if self._controller is None:
            raise UserError("the env has no scene yet, and so no controller in it: call reset() first.")
        return self._controller

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Make the scene of `seed` (without one: of the next number of the env's generator) and settle it.

        Raises:
            UserError: it is no seed, or no arrangement was found.
        """
        seed = None if seed is None else checked_seed(seed)
        super().reset(seed=seed)
        episode_seed = seed if seed is not None else int(self.np_random.integers(_SEED_LIMIT))
        if self._initial is not None and self._initial.seed == episode_seed:
            self._restore(self._initial)
        else:
            self._begin(*self._made(episode_seed))
        return self._observe(), self._info()

    def next_seed(self) -> int:
        """The seed that the next reset without one will take; asking changes nothing."""
        return int(copy.deepcopy(self.np_random).integers(_SEED_LIMIT))

    @property
    def steps(self) -> int:
        """Control steps of the running episode so far."""
        return self._steps

    def get_state(self) -> KitchenState:
        """The state of the running episode.

        Raises:
            UserError: before the first reset.
        """
        controller = self.controller
        physics, asleep = read_physics(self.model, self.data)
        return KitchenState(
            task=self.task,
            split=self.split,
            seed=self.scene.seed,
            layout_id=self.scene.layout_id,
            style_id=self.scene.style_id,
            steps=self._steps,
            physics=physics,
            asleep=asleep,
            controller=controller.get_state(),
            mujoco_version=mujoco.mj_versionString(),
        )

    def set_state(self, state: KitchenState) -> tuple[Observation, dict[str, Any]]:
        """Go on from `state`, in its scene; returns the observation and info of that moment.

        Raises:
            UserError: the state is none, or of another task, split, kitchen, MuJoCo version or version of the kitchens.
        """
        check_kind(state)
        for what, found, expected in (
            ("task", state.task, self.task),
            ("split", state.split, self.split),
            ("MuJoCo version", state.mujoco_version, mujoco.mj_versionString()),
        ):
            if found != expected:
                raise UserError(f"kitchen state: found {what} {found!r}, but this env has {expected!r}.")
        runs = self._initial is not None and self._initial.seed == state.seed
        made = None if runs else self._made(state.seed)
        scene = self.scene if made is None else made[0]
        for what, number, ours in (
            ("layout", state.layout_id, scene.layout_id),
            ("style", state.style_id, scene.style_id),
        ):
            if number not in (None, ours):
                raise UserError(
                    f"kitchen state: found {what} {number}, but seed {state.seed} gives {what} {ours} in this env. "
                    "Make it with the same `layouts` and `styles`."
                )
        check_fits(scene.model, state)
        if made is not None:
            self._begin(*made)
        self._restore(state)
        return self._observe(), self._info()

    def step(self, action: NDArray[np.float32]) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Carry out one action for 50 ms.

        Raises:
            UserError: before the first reset.
            ContractError: the action has a wrong shape or is not finite.
        """
        data, controller = self.data, self._controller
        assert controller is not None
        wanted = np.asarray(action, dtype=np.float64)
        if not np.isfinite(wanted).all():  # made binary, NaN would be -1
            raise contract.ContractError(f"action: found {wanted}, expected finite numbers.")
        control_step(self.model, data, controller, contract.stored_to_hdf5(contract.binarize(wanted)))
        self.scene.after_control_step(data)
        self._steps += 1
        info = self._info()
        terminated = self.terminate_on_success and info["success"]
        truncated = self._steps >= self.horizon and not terminated
        return self._observe(), float(info["success"]), terminated, truncated, info

    def observe(self) -> Observation:
        """The observation of the present state; with pictures of before where `render_observations` is off.

        Raises:
            UserError: before the first reset.
        """
        assert self.scene is not None
        return self._observe()

    def render(self) -> NDArray[np.uint8]:
        """The picture of the first camera, (S, S, 3) uint8; of the contract's first, where none is observed."""
        return self.render_camera((*self.cameras, *contract.CAMERAS)[0])

    def render_camera(self, camera: str | mujoco.MjvCamera) -> NDArray[np.uint8]:
        """A picture (S, S, 3) uint8 of the present state from any camera of the model, or a free one."""
        return self._open_renderer().render(self.data, camera)

    def renderer_of_size(self, height: int, width: int) -> SceneRenderer:
        """A renderer of the episode's scene for pictures of another size, in pixels; close it when the episode ends."""
        return self._open_renderer().resized(height, width)

    @property
    def segmentation_names(self) -> tuple[str, ...]:
        """What each id of the episode's segmentation is: a fixture, an object, or a body of the robot.

        One entry for each geom and a last one, "background", for id -1: `np.array(names)[segmentation]`. Ids change
        with the scene, names do not.
        """
        return segmentation_names(self.model, self.robot.names.base)

    def close(self) -> None:
        """Free the OpenGL context."""
        self._close_renderer()

    def _made(self, seed: int) -> tuple[Scene, BoundTask, mujoco.MjData, Controller]:
        """The beginning of the episode of a seed; the running one does not notice."""
        scene = build_scene(
            self._declared,
            self.split,
            seed,
            self.render_preset,
            self.camera_set,
            self.camera_noise,
            self._kitchens,
            self.robot,
        )
        bound = self._declared.bound(scene)
        if self.initial_noise is not None:
            add_initial_noise(scene, self.initial_noise, self._declared)
        if self.novel_language:
            wordings = scene.paraphrases
            choice = np.random.default_rng([seed, _WORDING_STREAM]).integers(len(wordings))
            scene.instruction = wordings[int(choice)]
        noise = np.random.default_rng([seed, _ARM_NOISE_STREAM])
        return scene, bound, *scene.initial_data(noise)

    def _begin(self, scene: Scene, bound: BoundTask, data: mujoco.MjData, controller: Controller) -> None:
        self._close_renderer()
        # Together and last: a reset that fails or is interrupted leaves the episode before it whole.
        self._initial = None
        self._scene, self._bound, self._data, self._controller = scene, bound, data, controller
        self._steps = 0
        self._pictures = {}
        self.task_description = scene.instruction
        self._initial = self.get_state()

    def _restore(self, state: KitchenState) -> None:
        assert self._controller is not None
        restore(self.model, self.data, self._controller, state)
        self._steps = state.steps
        self._pictures = {}

    def _open_renderer(self) -> SceneRenderer:
        if self._renderer is None:
            opengl = None
            if self.render_device is not None:
                gl.ensure_gl(self.render_device)
                opengl = True
            shadows = self.render_preset == "quality"
            self._renderer = SceneRenderer(self.model, self.image_size, self.image_size, shadows=shadows, opengl=opengl)
        return self._renderer

    def _close_renderer(self) -> None:
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def _observe(self) -> Observation:
        pictures: Pictures = {}
        if self.cameras:
            if self.render_observations or not self._pictures:
                started = time.perf_counter()
                self._pictures = take_pictures(self._open_renderer(), self.data, self.cameras, **self._kinds)
                self.rendering_seconds += time.perf_counter() - started
            # Those that are shown again are not the caller's to change.
            given: Any = dict if self.render_observations else copy.deepcopy
            pictures = {key: given(by_camera) for key, by_camera in self._pictures.items()}
        return {**pictures, "agent_pos": self.robot.read_state(self.model, self.data)}

    def _info(self) -> dict[str, Any]:
        terms: dict[str, bool] = {}
        success = bool(self.declaration.goal.evaluate(self.scene, self.data, terms))
        return {
            "success": success,
            "is_success": success,
            "success_terms": terms,
            "instruction": self.scene.instruction,
            "task": self.task,
            "scene": {"layout_id": self.scene.layout_id, "style_id": self.scene.style_id},
            "seed": self.scene.seed,
        }
