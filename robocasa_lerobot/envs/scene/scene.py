"""A built scene: the compiled model and what stands where. A pure function of (task, split, seed)."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Protocol, overload

import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.contract import ACTION_SIZE
from robocasa_lerobot.envs.kitchens.appliances.acting import ActingAppliances
from robocasa_lerobot.envs.kitchens.appliances.kinds.blender import Blender
from robocasa_lerobot.envs.kitchens.fixtures.base import Fixture, Region, of_kind
from robocasa_lerobot.envs.kitchens.fixtures.regions import region_names, regions_of
from robocasa_lerobot.envs.kitchens.layout import Layout
from robocasa_lerobot.envs.kitchens.splits import benchmark_split
from robocasa_lerobot.envs.robots.cameras import camera_configs
from robocasa_lerobot.envs.robots.control_step import control_step
from robocasa_lerobot.envs.robots.robot import Controller, Robot
from robocasa_lerobot.envs.scene.bodies import subtree
from robocasa_lerobot.envs.scene.drawn import Drawn
from robocasa_lerobot.envs.scene.memory import Memory
from robocasa_lerobot.envs.scene.robot_poses import RobotPose, nearest_free, standing_pose
from robocasa_lerobot.envs.scene.words import Words

SETTLE_STEPS = 10  # control steps without a command after placing everything (docs/robocasa.md, section 1)
_NOISE_TRIES = 10  # of the arm's start, until it touches nothing


class FirstState(Protocol):
    """Something of a task that writes a part of the first state; `envs/scene/initial_states.py` has them all."""

    def apply(self, scene: Scene, data: mujoco.MjData, drawn: float) -> None:
        """Write it, with the number drawn for it."""


class Remembering(Protocol):
    """Part of a goal that depends on earlier states; `envs/predicates/memory.py` has them all."""

    @property
    def name(self) -> str:
        """Name of the memory."""

    @property
    def numbers(self) -> tuple[str, ...]:
        """Names of the numbers that it keeps."""

    def begin(self, scene: Scene, data: mujoco.MjData) -> NDArray[np.float64]:
        """Its numbers at the start of an episode."""

    def after_step(self, scene: Scene, data: mujoco.MjData) -> NDArray[np.float64]:
        """Its numbers after a control step; those before it are in `scene.memory`."""


@dataclass(kw_only=True)
class Scene(Drawn):
    """A kitchen made for an episode.

    Attributes:
        split, seed: what it was made from, with the task.
        layout_id, style_id: of the kitchen.
        spec: the MjSpec; its XML names assets by portable paths.
        model: compiled.
        layout: where its fixtures stand.
        openness: initial share of full travel by fixture name and part, an empty one for all of it.
        robot: that is in it.
        robot_pose: where its base starts.
        instruction: what the robot is told.
        paraphrases: the same in other words.
        words: for fixtures (by role), objects, choices, and lists of objects.
        initial: what the task has written into the first state, each with the number drawn for it, in that order.
        lid_spots: where the lid of a blender may lie, by role.
        arm_noise_rad: standard deviation of the noise on the initial arm pose.
        remembering: the parts of the task's goal and of its stages' conditions that have memory, the inner first.
        memory: where their numbers are.
    """

    split: str
    seed: int
    layout_id: int
    style_id: int
    spec: mujoco.MjSpec
    model: mujoco.MjModel
    layout: Layout
    openness: dict[tuple[str, str], float]
    robot: Robot
    robot_pose: RobotPose
    instruction: str
    paraphrases: tuple[str, ...] = ()
    words: Words = field(default_factory=Words)
    initial: tuple[tuple[FirstState, float], ...] = ()
    lid_spots: dict[str, NDArray[np.float64]] = field(default_factory=dict)
    arm_noise_rad: float = 0.02
    remembering: tuple[Remembering, ...] = ()
    memory: Memory = field(default_factory=Memory)
    _subtrees: dict[tuple[str, ...], NDArray[np.bool_]] = field(default_factory=dict, init=False, repr=False)
    _regions: dict[tuple[str, str], tuple[Region, ...]] = field(default_factory=dict, init=False, repr=False)
    _places: dict[str, RobotPose] = field(default_factory=dict, init=False, repr=False)
    _acting: ActingAppliances | None = field(default=None, init=False, repr=False)

    @property
    def fixtures(self) -> dict[str, Fixture]:
        """Fixtures by name."""
        return self.layout.fixtures

    @overload
    def fixture(self, role: str) -> Fixture: ...

    @overload
    def fixture[F: Fixture](self, role: str, kind: type[F]) -> F: ...

    def fixture(self, role: str, kind: type[Fixture] = Fixture) -> Fixture:
        """The fixture of a role, as what it must be: `scene.fixture("sink", Sink)`.

        Raises:
            UserError: it is something else.
        """
        return of_kind(self.fixtures[self.roles[self.fill(role)]], kind)

    def part(self, role: str, text: str) -> str:
        """A part that a declaration names at a fixture, choices filled in, a shelf by its level as its own name."""
        text = self.fill(text)
        names = region_names(self.fixture(role), text)
        return names[0] if len(names) == 1 else text.partition(":")[0]

    def regions(self, role: str, text: str) -> tuple[Region, ...]:
        """The regions that a declaration names at a fixture, all if by nothing, choices filled in; kept."""
        key = (role, text)
        if key not in self._regions:
            fixture = self.fixture(role)
            wanted = region_names(fixture, self.fill(text))
            self._regions[key] = tuple(region for name, region in regions_of(fixture) if name.startswith(wanted))
        return self._regions[key]

    def subtree(self, *bodies: str) -> NDArray[np.bool_]:
        """For each body of the model whether it is one of the named ones or hangs on one, (nbody,); kept."""
        if bodies not in self._subtrees:
            self._subtrees[bodies] = subtree(self.model, *bodies)
        return self._subtrees[bodies]

    def robot_touches(self, data: mujoco.MjData) -> list[str]:
        """Names of the bodies, but for the floor, that the robot is in contact with in a state."""
        robot = self.subtree(self.robot.names.base)
        sides = self.model.geom_bodyid[data.contact.geom].reshape(-1, 2)
        others = sides[robot[sides].sum(axis=1) == 1]
        return sorted({self.model.body(side).name for side in others[~robot[others]]} - {"floor"})

    def fingers(self) -> tuple[NDArray[np.bool_], ...]:
        """For each finger of the gripper, which bodies of the model belong to it, (nbody,) each."""
        names = (self.model.body(self.model.joint(joint).bodyid[0]).name for joint in self.robot.names.finger_joints)
        return tuple(self.subtree(name) for name in names)

    def standing_pose(self, role: str) -> RobotPose:
        """Where a robot stands that is to use the fixture of a role, without deviation."""
        return standing_pose(self.layout, self.fixture(role), self.robot.shape)

    def place_before(self, role: str) -> RobotPose:
        """The standing pose, or the nearest where a robot can stand: before what is in a corner, beside it; kept."""
        if role not in self._places:
            self._places[role] = nearest_free(self.standing_pose(role), self.layout, self.robot.shape)
        return self._places[role]

    def lay_lid(self, role: str, data: mujoco.MjData, turn: float, *, gone: bool) -> None:
        """Lay the lid of a blender on the counter, turned by a share of a full turn; not if it is `gone`."""
        blender = self.fixture(role, Blender)
        if not gone:
            blender.set_lid(data, self.lid_spots[role], 2 * np.pi * turn)

    def placed_data(self, rng: np.random.Generator | None = None) -> mujoco.MjData:
        """Everything where it was put, before it settles; without `rng` the arm has no noise."""
        data = mujoco.MjData(self.model)
        pose = self.robot_pose
        self.robot.place_base(self.model, data, pose.x, pose.y, pose.yaw)
        self.robot.set_home(self.model, data, rng, self.arm_noise_rad)
        for (name, part), openness in self.openness.items():
            self.fixtures[name].set_openness(data, openness, part)
        for entry, drawn in self.initial:
            entry.apply(self, data, drawn)
        for placed in self.objects.values():
            data.joint(f"{placed.name}_joint0").qpos[:] = [*placed.pos, *placed.quat]
        return data

    def evaluated_start(self) -> mujoco.MjData:
        """Everything where it was put, with its poses and contacts; the arm without noise.

        No plan of footprints shows all of these: handles, open doors, objects.
        """
        data = self.placed_data()
        mujoco.mj_fwdPosition(self.model, data)
        return data

    def initial_data(self, rng: np.random.Generator) -> tuple[mujoco.MjData, Controller]:
        """State at the start of an episode: everything placed, then settled without commands.

        Noise that would lead the arm into something, as the handle before which it stands, is drawn again.
        """
        for _ in range(_NOISE_TRIES):
            data = self.placed_data(rng)
            mujoco.mj_forward(self.model, data)
            if not self.robot_touches(data):
                break
        controller = self.robot.controller(self.model, data)
        controller.reset()
        hold = np.zeros(ACTION_SIZE)
        for _ in range(SETTLE_STEPS):
            control_step(self.model, data, controller, hold)
            self.update_appliances(data)
        for remembered in self.remembering:
            self.memory.write(data, remembered.name, remembered.begin(self, data))
        data.time = 0.0
        return data, controller

    def after_control_step(self, data: mujoco.MjData) -> None:
        """What happens by itself, once after each control step of an episode: appliances act, then goals remember."""
        self.update_appliances(data)
        for part in self.remembering:
            self.memory.write(data, part.name, part.after_step(self, data))

    def update_appliances(self, data: mujoco.MjData) -> None:
        """Let appliances latch, time and light up, once after each control step."""
        if self._acting is None:
            self._acting = ActingAppliances(self.fixtures.values(), self.model)
        self._acting.act(data, self.subtree(self.robot.names.gripper))

    def ep_meta(self) -> dict[str, Any]:
        """Description of the episode in RoboCasa's keys (JSON-able)."""
        return {
            "layout_id": self.layout_id,
            "style_id": self.style_id,
            "split": self.split,
            "seed": self.seed,
            "lang": self.instruction,
            "object_cfgs": [
                {
                    "name": placed.name,
                    "type": "object",
                    "info": {
                        "cat": placed.item.category.name,
                        "model": placed.item.model,
                        "split": benchmark_split(self.split),
                        "groups": list(placed.item.category.groups),
                    },
                    "placement": {"pos": list(placed.pos), "yaw": placed.yaw},
                }
                for placed in self.objects.values()
            ],
            "fixtures": {
                name: {"cls": type(fixture).__name__, "type": self.layout.types[name]}
                for name, fixture in self.fixtures.items()
            },
            "fixture_refs": dict(self.roles),
            "choices": {name: value for name, value in self.choices.items() if name not in self.roles},
            "cam_configs": camera_configs(self.model, (camera.name for camera in self.robot.cameras("default"))),
            "init_robot_base_pos": [self.robot_pose.x, self.robot_pose.y, 0.0],
            "init_robot_base_ori": [0.0, 0.0, self.robot_pose.yaw],
        }
