"""One attempt at a demonstration: run the demonstrator in a fresh scene and keep what RoboCasa's files keep."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot import contract
from robocasa_lerobot.demos.demonstrator import SkillError, demonstrate
from robocasa_lerobot.demos.motion_style import PLAIN, MotionStyle
from robocasa_lerobot.demos.stages import HELD_STEPS, StageLog
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.tasks.stage_text import stage_text

Array = NDArray[np.float64]

SUCCESS_HOLD_STEPS = HELD_STEPS
# What acts in an episode, with its style, and tells the log which stage is on.
Actor = Callable[[KitchenEnv, MotionStyle, StageLog], Iterator[Array]]
# Keys of the generators of action noise and of the motion style, apart from those of the scene and the arm.
_NOISE_STREAM, _STYLE_STREAM = 2, 6


@dataclass
class Recording:
    """A recorded episode of T steps; entry t is the state before action t, and that action.

    Attributes:
        seed: of the scene.
        success: whether the goal held at the end.
        reason: why not, if not.
        false_terms: names of the goal's terms that did not hold at the end.
        states: (T, 1 + nq + nv) time, positions, velocities.
        actions: (T, 12) in HDF5 order, as executed.
        observations: robosuite-named proprioception, each (T, k); pictures (T, S, S, 3) uint8 if asked for.
        rewards: (T,) 1 where the goal held in states[t].
        stages: (T,) index of the stage that actions[t] belongs to.
        success_terms: (T, n) whether each of the goal's terms held in states[t]; `term_names` are theirs.
        model_file: MJCF.
        assets: files of textures and objects that the MJCF names.
        ep_meta: description of the scene.
        per_step: further values of each step, (T, k), which are written beside the actions.
    """

    seed: int
    success: bool
    reason: str
    false_terms: tuple[str, ...]
    states: Array
    actions: Array
    observations: dict[str, NDArray[Any]]
    rewards: Array
    stages: NDArray[np.int32]
    success_terms: NDArray[np.bool_]
    term_names: tuple[str, ...]
    model_file: str
    assets: dict[str, bytes]
    ep_meta: dict[str, Any]
    per_step: dict[str, NDArray[Any]] = field(default_factory=dict)


@dataclass
class EpisodeBuffer:
    """What an episode has come to so far; entry t is the state before action t, and that action."""

    states: list[Array] = field(default_factory=list)
    actions: list[Array] = field(default_factory=list)
    rewards: list[float] = field(default_factory=list)
    stages: list[int] = field(default_factory=list)
    terms: list[dict[str, bool]] = field(default_factory=list)
    observations: dict[str, list[NDArray[Any]]] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.actions)

    def add(self, env: KitchenEnv, action: Array, info: dict[str, Any], stage: int, *, images: bool = False) -> None:
        """Note the present state and the action (12,), stored order and binarized, that is about to be carried out."""
        data = env.data
        self.stages.append(stage)
        self.terms.append(info["success_terms"])
        self.states.append(np.concatenate([[data.time], data.qpos, data.qvel]))
        self.actions.append(contract.stored_to_hdf5(action))
        self.rewards.append(float(info["success"]))
        for key, value in env.robot.read_observations(env.model, data).items():
            self.observations.setdefault(key, []).append(np.array(value, dtype=np.float64))
        if images:
            for camera in env.cameras:
                self.observations.setdefault(f"{camera}_image", []).append(env.render_camera(camera))

    def drop_from(self, step: int) -> None:
        """Forget step `step` and all after it."""
        lists: list[list[Any]] = [self.states, self.actions, self.rewards, self.stages, self.terms]
        for values in (*lists, *self.observations.values()):
            del values[step:]

    def recording(
        self,
        env: KitchenEnv,
        info: dict[str, Any],
        ep_meta: dict[str, Any],
        *,
        success: bool,
        reason: str = "",
        model_file: str = "",
    ) -> Recording:
        """The episode as it is kept.

        Args:
            env: in the episode's scene.
            info: of the last step.
            ep_meta: beyond what the scene says of itself.
            success: whether the goal held at the end.
            reason: why not, if not.
            model_file: the scene's MJCF, where it has been written already.
        """
        return Recording(
            seed=env.scene.seed,
            success=success,
            reason=reason,
            false_terms=tuple(name for name, held in info["success_terms"].items() if not held),
            states=np.array(self.states),
            actions=np.array(self.actions),
            observations={key: np.array(values) for key, values in self.observations.items()},
            rewards=np.array(self.rewards),
            stages=np.array(self.stages, dtype=np.int32),
            success_terms=np.array([list(terms.values()) for terms in self.terms], dtype=bool),
            term_names=tuple(info["success_terms"]),
            model_file=model_file or env.scene.spec.to_xml(),
            assets={
                name: data for name, data in env.scene.spec.assets.items() if name.startswith(("textures/", "objects/"))
            },
            ep_meta={**env.scene.ep_meta(), **_kitchens(env), **ep_meta},
        )


def record_episode(
    env: KitchenEnv,
    seed: int,
    *,
    action_noise: float = 0.0,
    images: bool = False,
    varied: bool = False,
    actor: Actor = demonstrate,
    noise_seed: int | None = None,
) -> Recording:
    """Attempt a demonstration of the env's task in the scene of `seed`.

    Args:
        env: made with `terminate_on_success=False`.
        seed: of the scene, the arm's initial noise and the action noise.
        action_noise: standard deviation of Gaussian noise on the six commanded arm components (unit: full command);
            it is part of the action that is executed and recorded.
        images: also keep the camera pictures.
        varied: draw how the demonstration is carried out (`MotionStyle`) from the seed; else as the skills have it.
        actor: what acts; it is asked for an action at a time, each of which is carried out before the next.
        noise_seed: of the action noise, where the same scene is recorded several times.
    """
    assert not env.terminate_on_success, "the recorder decides when an episode ends"
    env.render_observations = False
    rng = np.random.default_rng([seed if noise_seed is None else noise_seed, _NOISE_STREAM])
    style = MotionStyle.draw(np.random.default_rng([seed, _STYLE_STREAM])) if varied else PLAIN
    _, info = env.reset(seed=seed)
    model_file = env.scene.spec.to_xml()
    buffer = EpisodeBuffer()
    held, reason, log = 0, "", StageLog()
    try:
        for wanted in actor(env, style, log):
            # Everything is carried out in single precision, as a policy's action is, and recorded as carried out.
            action = _with_noise(rng, wanted, action_noise).astype(np.float32).astype(np.float64)
            buffer.add(env, contract.binarize(action), info, log.current, images=images)
            _, _, _, truncated, info = env.step(action.astype(np.float32))
            held = held + 1 if info["success"] else 0
            if held >= SUCCESS_HOLD_STEPS:
                break
            if truncated:
                late = f"; the goal holds, but for {held} steps only" if held else ""
                reason = f"not done within the horizon of {env.horizon} steps{late}"
                break
    except SkillError as error:
        reason = str(error)
    log.close(env)
    return buffer.recording(
        env,
        info,
        {"action_noise": action_noise, "motion_style": asdict(style), "stages": stage_rows(env, log)},
        success=held >= SUCCESS_HOLD_STEPS,
        reason=reason,
        model_file=model_file,
    )


def stage_rows(env: KitchenEnv, log: StageLog) -> list[dict[str, Any]]:
    """What `ep_meta` says of the stages of the running episode."""
    stages = env.declaration.stages
    return [{"text": stage_text(stage, env.scene), **row} for stage, row in zip(stages, log.table(stages), strict=True)]


def _kitchens(env: KitchenEnv) -> dict[str, Any]:
    """What the env was restricted to, and how the robot's start was spread: with the seed, it decides the scene."""
    asked = {"layouts": env.layouts, "styles": env.styles}
    noise = {} if env.initial_noise is None else {"initial_noise": asdict(env.initial_noise)}
    return {key: list(ids) for key, ids in asked.items() if ids is not None} | noise


def _with_noise(rng: np.random.Generator, action: Array, noise: float) -> Array:
    out = action.copy()
    if noise > 0:
        for part in ("end_effector_position", "end_effector_rotation"):
            where = contract.ACTION_SLICES[part]
            out[where] += rng.normal(0.0, noise, size=out[where].shape)
    return np.clip(out, -1.0, 1.0)
