r"""robosuite's envs for evaluations of ours, in robosuite's own interpreter (docs/simulators.md).

    python eval.py --policy=demonstrator --env.tasks=Lift,Stack --env.python=benchmarks/.venvs/robosuite152/bin/python \
        --env.factory=benchmarks/peers/robosuite_envs.py:make_env

With the PandaOmron, observation and action are those of our kitchens, in their order, so that the same policies run.
Cameras have robosuite's own names. Any other robot takes robosuite's actions as they are. The expert reaches for the
object by its pose in the simulator, lifts it and, in Stack, puts it down; with `demos`, a file of human demonstrations,
it repeats them: `by=actions` carries out the recorded actions, `by=states` shows the recorded states one by one.
"""

from __future__ import annotations

import contextlib
import re
from collections.abc import Iterator
from typing import Any

import h5py
import numpy as np
import robosuite
from robosuite.controllers import load_composite_controller_config

PACKAGES = ("robosuite", "mujoco", "numba")
OBJECTS = {"Lift": "cube", "Stack": "cubeA"}  # what the expert reaches for
INSTRUCTIONS = {"Lift": "lift the cube", "Stack": "put the red cube on the green cube"}
CONTROL_HZ, HORIZON = 20, 200
# Our kitchens' order of the 12 numbers: base 3, torso, mode, arm 6, gripper.
OURS = {"base": slice(0, 3), "torso": slice(3, 4), "right": slice(5, 11), "right_gripper": slice(11, 12)}
MODE = 4
REACHED_M = 0.03
OPEN, CLOSED = -1.0, 1.0


class Space:
    """What the evaluation asks of an action space."""

    def __init__(self, size: int) -> None:
        self.shape = (size,)
        self.low, self.high = -np.ones(size), np.ones(size)


def TASKS(options: dict[str, Any]) -> list[str]:  # noqa: N802 (the protocol's name)
    """The tasks that an expert can show."""
    return ["Lift"] if "demos" in options else list(OBJECTS)


def STARTS(options: dict[str, Any]) -> dict[str, int]:  # noqa: N802
    """Each demonstration is a start."""
    return {"Lift": len(_demos(options["demos"]))} if "demos" in options else {}


def make_env(
    task: str,
    robot: str = "PandaOmron",
    horizon: int | None = None,
    image_size: int | None = None,
    cameras: str = "agentview,robot0_eye_in_hand",
    demos: str | None = None,
    by: str = "actions",
    terminate_on_success: bool = True,
) -> RobosuiteEnv:
    """An env of robosuite; with `demos` that of its human demonstrations, whose robot is the Panda."""
    names = cameras.split(",")
    if demos is not None:
        env: RobosuiteEnv = RecordedEnv(task, "Panda", horizon, image_size or 256, names, demos, by)
    else:
        env = RobosuiteEnv(task, robot, horizon or HORIZON, image_size or 256, names)
    env.terminate_on_success = terminate_on_success
    return env


class RobosuiteEnv:
    """One env; each episode is made anew from its seed, so that it depends on no other.

    Args:
        task: robosuite's name of it.
        robot: robosuite's name of it.
        horizon: control steps.
        size: pixels.
        cameras: robosuite's names of those to be seen.
    """

    metadata = {"render_fps": CONTROL_HZ}  # noqa: RUF012

    def __init__(self, task: str, robot: str, horizon: int, size: int, cameras: list[str]) -> None:
        self.task, self.horizon = task, horizon
        self.render_observations = self.terminate_on_success = True
        self.task_description = INSTRUCTIONS[task]
        self._robot, self._size, self._cameras = robot, size, cameras
        self._env: Any = None
        self._make(seed=0)
        self._ours = robot == "PandaOmron"
        self._order = _action_order(self._env) if self._ours else np.arange(self._env.action_dim)
        self.action_space = Space(self._env.action_dim)

    def _ends(self, info: dict[str, Any]) -> bool:
        return bool(info["is_success"]) and self.terminate_on_success

    def reset(self, seed: int) -> tuple[dict[str, Any], dict[str, Any]]:
        self._make(seed)
        seen = self._env.reset()
        self._steps, self._script = 0, self._pick_and_place()
        return self._observe(seen), self._info(seen)

    def step(self, action: Any) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        seen, reward, _, _ = self._env.step(np.asarray(action, np.float64)[self._order])
        self._steps += 1
        info = self._info(seen)
        return self._observe(seen), float(reward), self._ends(info), self._steps >= self.horizon, info

    def expert_action(self) -> Any:
        """The scripted reach's next action."""
        return next(self._script)

    def close(self) -> None:
        self._env.close()

    def _make(self, seed: int) -> None:
        if self._env is not None:
            self._env.close()
        self._env = robosuite.make(
            self.task,
            robots=self._robot,
            controller_configs=load_composite_controller_config(robot=self._robot),
            has_renderer=False,
            has_offscreen_renderer=True,
            use_camera_obs=False,
            control_freq=CONTROL_HZ,
            horizon=10**9,
            ignore_done=True,
            seed=seed,
        )

    def _info(self, seen: dict[str, Any]) -> dict[str, Any]:
        success = bool(self._env._check_success())
        gap = float(np.linalg.norm(seen["robot0_eef_pos"] - self._object(seen)))
        return {"is_success": success, "success_terms": {"reached": gap < REACHED_M, "solved": success}}

    def _object(self, seen: dict[str, Any]) -> Any:
        return np.asarray(seen[f"{OBJECTS[self.task]}_pos"])

    def _observe(self, seen: dict[str, Any]) -> dict[str, Any]:
        keys = ["robot0_base_pos", "robot0_base_quat", "robot0_base_to_eef_pos", "robot0_base_to_eef_quat"]
        if not self._ours:
            keys = ["robot0_eef_pos", "robot0_eef_quat"]
        out = {"agent_pos": np.concatenate([seen[key] for key in (*keys, "robot0_gripper_qpos")])}
        if self.render_observations:
            draw = self._env.sim.render
            pictures = {name: draw(self._size, self._size, camera_name=name)[::-1] for name in self._cameras}
            out["pixels"] = pictures
        self._last = seen
        return out

    def _pick_and_place(self) -> Iterator[Any]:
        """Over the object, down, close, up; then over the place where it belongs, down, open, up."""
        start = self._object(self._last).copy()
        yield from self._go(start + _up(0.10), OPEN)
        yield from self._go(start, OPEN)
        yield from self._wait(10, CLOSED)
        yield from self._go(start + _up(0.12), CLOSED)
        if self.task == "Stack":
            there = self._last["cubeB_pos"] + _up(0.12)
            yield from self._go(there, CLOSED)
            yield from self._go(there - _up(0.07), CLOSED)
            yield from self._wait(10, OPEN)
            yield from self._go(there, OPEN)
        while True:
            yield from self._wait(1, CLOSED)

    def _go(self, target: Any, grip: float) -> Iterator[Any]:
        for _ in range(80):
            gap = np.asarray(target) - self._last["robot0_eef_pos"]
            if np.linalg.norm(gap) < 0.008:
                return
            base = self._env.sim.data.get_body_xmat(self._env.robots[0].robot_model.base.correct_naming("base"))
            # The controller takes shares of 5 cm in the frame of the robot's base.
            yield self._action(np.clip(base.T @ gap / 0.05 * 0.8, -1, 1), grip)

    def _wait(self, steps: int, grip: float) -> Iterator[Any]:
        for _ in range(steps):
            yield self._action(np.zeros(3), grip)

    def _action(self, move: Any, grip: float) -> Any:
        action = np.zeros(self.action_space.shape, np.float32)
        arm, gripper = (OURS["right"].start, OURS["right_gripper"].start) if self._ours else (0, 6)
        action[arm : arm + 3] = move
        action[gripper] = grip
        if self._ours:
            action[MODE] = -1.0
        return action


class RecordedEnv(RobosuiteEnv):
    """Human demonstrations of robosuite 1.4.0: seed k begins where the k-th did.

    The scene is this version's, with the recorded size of the cube: the recorded model names its parts otherwise.
    """

    def __init__(
        self, task: str, robot: str, horizon: int | None, size: int, cameras: list[str], demos: str, by: str
    ) -> None:
        if by not in ("actions", "states"):
            raise ValueError(f"by: found {by!r}, expected actions or states")
        self._demos, self._by = _demos(demos), by
        longest = max(len(actions) for _, actions, _ in self._demos)
        super().__init__(task, robot, horizon or longest, size, cameras)

    def reset(self, seed: int) -> tuple[dict[str, Any], dict[str, Any]]:
        super().reset(seed)
        self._states, self._actions, cube = self._demos[seed]
        model = self._env.sim.model
        for name in ("cube_g0", "cube_g0_vis"):
            with contextlib.suppress(ValueError):
                model.geom_size[model.geom_name2id(name)] = cube
        seen = self._show(0)
        return self._observe(seen), self._info(seen)

    def step(self, action: Any) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        if self._by == "actions":
            return super().step(action)
        self._steps += 1
        seen = self._show(min(self._steps, len(self._states) - 1))
        info = self._info(seen)
        return self._observe(seen), 0.0, info["is_success"], self._steps >= self.horizon, info

    def expert_action(self) -> Any:
        """The recorded action of this step, the last one after the end."""
        return self._actions[min(self._steps, len(self._actions) - 1)]

    def _show(self, step: int) -> dict[str, Any]:
        self._env.sim.set_state_from_flattened(self._states[step])
        self._env.sim.forward()
        return dict(self._env._get_observations(force_update=True))


def _up(metres: float) -> Any:
    return np.array([0.0, 0.0, metres])


def _demos(path: str) -> list[tuple[Any, Any, Any]]:
    """States, actions and the cube's half sizes (m) of each demonstration."""
    out = []
    with h5py.File(path) as file:
        for name in sorted(file["data"], key=lambda key: int(key.rpartition("_")[2])):
            demo = file["data"][name]
            size = re.search(r'<geom[^>]*name="cube_g0"[^>]*?\bsize="([^"]+)"', str(demo.attrs["model_file"]))
            cube = np.array(size.group(1).split(), float) if size else None
            out.append((demo["states"][()], demo["actions"][()], cube))
    return out


def _action_order(env: Any) -> Any:
    """Where each number of robosuite's action stands in ours; the last one is the base's mode."""
    order = np.full(env.action_dim, MODE)
    for part, (start, end) in env.robots[0].composite_controller._action_split_indexes.items():
        order[start:end] = np.arange(OURS[part].start, OURS[part].stop)
    return order
