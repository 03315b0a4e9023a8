"""A built scene: the compiled model and what stands where. A pure function of (task, split, seed)."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Protocol

import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.contract import ACTION_SIZE
from robocasa_lerobot.envs.kitchens.appliances.base import Appliance, update_all
from robocasa_lerobot.envs.kitchens.appliances.kinds.blender import Blender
from robocasa_lerobot.envs.kitchens.appliances.kinds.sink import Sink
from robocasa_lerobot.envs.kitchens.appliances.kinds.stove import Hob
from robocasa_lerobot.envs.kitchens.fixtures.base import Fixture, yaw_quat
from robocasa_lerobot.envs.kitchens.fixtures.cabinets import Drawer, HingeCabinet
from robocasa_lerobot.envs.kitchens.footprints import Footprint
from robocasa_lerobot.envs.kitchens.layout import Layout
from robocasa_lerobot.envs.objects.catalogue import Instance
from robocasa_lerobot.envs.robots.cameras import camera_configs
from robocasa_lerobot.envs.robots.control_step import control_step
from robocasa_lerobot.envs.robots.robot import Controller, Robot
from robocasa_lerobot.envs.scene.bodies import subtree
from robocasa_lerobot.envs.scene.robot_poses import RobotPose, standing_pose
from robocasa_lerobot.envs.scene.words import Words, numbered

SETTLE_STEPS = 10  # control steps without a command after placing everything (docs/robocasa.md, section 1)


@dataclass(frozen=True)
class PlacedObject:
    """An object of a scene: its model, and where it starts (centre in metres, yaw in radians)."""

    name: str
    item: Instance
    pos: tuple[float, float, float]
    yaw: float

    @property
    def footprint(self) -> Footprint:
        """Its bounding box on the floor plan."""
        width, depth, _ = self.item.size
        return Footprint(self.pos[0], self.pos[1], self.yaw, (width / 2, depth / 2))


class FirstState(Protocol):
    """Something of a task that writes a part of the first state; `envs/scene/initial_states.py` has them all."""

    def apply(self, scene: Scene, data: mujoco.MjData, drawn: float) -> None:
        """Write it, with the number drawn for it."""


@dataclass
class Scene:
    """A kitchen made for an episode.

    Attributes:
        split, seed: what it was made from, with the task.
        layout_id, style_id: of the kitchen.
        spec: the MjSpec; its XML names assets by portable paths.
        model: compiled.
        layout: where its fixtures stand.
        roles: fixture name of each role of the task.
        objects: by name.
        openness: initial share of full travel by fixture name.
        robot: that is in it.
        robot_pose: where its base starts.
        instruction: what the robot is told.
        paraphrases: the same in other words.
        choices: what was drawn for the task's choices, and the roles' fixtures, by name.
        words: what is said of fixtures (by role), objects, choices, and lists of objects.
        initial: what the task has written into the first state, each with the number drawn for it, in that order.
        lid_spots: where the lid of a blender may lie, by role.
        arm_noise_rad: standard deviation of the noise on the initial arm pose.
    """

    split: str
    seed: int
    layout_id: int
    style_id: int
    spec: mujoco.MjSpec
    model: mujoco.MjModel
    layout: Layout
    roles: dict[str, str]
    objects: dict[str, PlacedObject]
    openness: dict[str, float]
    robot: Robot
    robot_pose: RobotPose
    instruction: str
    paraphrases: tuple[str, ...] = ()
    choices: dict[str, str] = field(default_factory=dict)
    words: Words = field(default_factory=Words)
    initial: tuple[tuple[FirstState, float], ...] = ()
    lid_spots: dict[str, NDArray[np.float64]] = field(default_factory=dict)
    arm_noise_rad: float = 0.02
    _subtrees: dict[tuple[str, ...], NDArray[np.bool_]] = field(default_factory=dict, init=False, repr=False)

    @property
    def fixtures(self) -> dict[str, Fixture]:
        """Fixtures by name."""
        return self.layout.fixtures

    def fixture(self, role: str) -> Fixture:
        """The fixture of a role."""
        return self.fixtures[self.roles[self.fill(role)]]

    def named(self, name: str) -> tuple[str, ...]:
        """The objects of a declaration's name: one, or as many as were drawn, `<name>_0` first."""
        return numbered(self.fill(name), self.objects)

    def drawer(self, role: str) -> Drawer:
        """The drawer of a role."""
        fixture = self.fixture(role)
        assert isinstance(fixture, Drawer), f"{role} is no drawer"
        return fixture

    def sink(self, role: str) -> Sink:
        """The sink of a role."""
        fixture = self.fixture(role)
        assert isinstance(fixture, Sink), f"{role} is no sink"
        return fixture

    def appliance(self, role: str) -> Appliance:
        """The appliance of a role."""
        fixture = self.fixture(role)
        assert isinstance(fixture, Appliance), f"{role} is no appliance"
        return fixture

    def hob(self, role: str) -> Hob:
        """The stove or stovetop of a role."""
        fixture = self.fixture(role)
        assert isinstance(fixture, Hob), f"{role} is no hob"
        return fixture

    def fill(self, text: str) -> str:
        """A name of a declaration with its choices and roles filled in, e.g. "knob_{knob}"."""
        return text.format(**self.choices) if "{" in text else text

    def subtree(self, *bodies: str) -> NDArray[np.bool_]:
        """For each body of the model whether it is one of the named ones or hangs on one, (nbody,); kept."""
        if bodies not in self._subtrees:
            self._subtrees[bodies] = subtree(self.model, *bodies)
        return self._subtrees[bodies]

    def standing_pose(self, role: str) -> RobotPose:
        """Where a robot stands that is to use the fixture of a role, without deviation."""
        return standing_pose(self.layout, self.fixture(role), self.robot.shape)

    def lay_lid(self, role: str, data: mujoco.MjData, turn: float, *, gone: bool) -> None:
        """Lay the lid of a blender on the counter, turned by a share of a full turn, or out of the way if `gone`."""
        blender = self.fixture(role)
        assert isinstance(blender, Blender)
        if not gone:
            blender.set_lid(data, self.lid_spots[role], 2 * np.pi * turn)

    def initial_data(self, rng: np.random.Generator) -> tuple[mujoco.MjData, Controller]:
        """State at the start of an episode: everything placed, then settled without commands."""
        data = mujoco.MjData(self.model)
        pose = self.robot_pose
        self.robot.place_base(self.model, data, pose.x, pose.y, pose.yaw)
        self.robot.set_home(self.model, data, rng, self.arm_noise_rad)
        for name, openness in self.openness.items():
            fixture = self.fixtures[name]
            set_openness(fixture, data, openness)
        for entry, drawn in self.initial:
            entry.apply(self, data, drawn)
        for placed in self.objects.values():
            data.joint(f"{placed.name}_joint0").qpos[:] = [*placed.pos, *yaw_quat(placed.yaw)]
        mujoco.mj_forward(self.model, data)
        controller = self.robot.controller(self.model, data)
        controller.reset()
        hold = np.zeros(ACTION_SIZE)
        for _ in range(SETTLE_STEPS):
            control_step(self.model, data, controller, hold)
            self.update_appliances(data)
        data.time = 0.0
        return data, controller

    def update_appliances(self, data: mujoco.MjData) -> None:
        """Let appliances latch, time and light up, once after each control step."""
        appliances = [fixture for fixture in self.fixtures.values() if isinstance(fixture, Appliance)]
        if appliances:
            update_all(appliances, self.model, data, self.subtree(self.robot.names.gripper))

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
                        "split": self.split,
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


def set_openness(fixture: Fixture, data: mujoco.MjData, openness: float) -> None:
    """Open a drawer or the doors of a cabinet or appliance by a share of their full travel; for initial states."""
    if isinstance(fixture, Drawer | HingeCabinet):
        fixture.set_openness(data, openness)
    elif isinstance(fixture, Appliance):
        fixture.set_door(data, openness)
    else:
        raise AssertionError(f"{fixture.name} cannot be opened")
