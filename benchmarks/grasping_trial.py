"""One instance on a table, the Panda gripper alone on three slides above it, and trials of grasp poses."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from robocasa_lerobot.demos.planning.grasps import GraspPose, grasp_poses_as_it_lies
from robocasa_lerobot.envs.kitchens.materials import MaterialPalette, load_style, style_ids
from robocasa_lerobot.envs.objects import catalogue
from robocasa_lerobot.envs.objects.shapes import add_object
from robocasa_lerobot.envs.physics.options import apply_simulation_options
from robocasa_lerobot.envs.robots.panda_omron import names
from robocasa_lerobot.envs.robots.panda_omron.bodies import BODIES
from robocasa_lerobot.envs.robots.panda_omron.model import _add_meshes
from robocasa_lerobot.envs.robots.panda_omron.robot import PANDA_OMRON
from robocasa_lerobot.envs.robots.panda_omron.shapes import _HAND_MESH_QUAT, _MATERIALS, _fingers, _mesh

SLIDES = ("slide_x", "slide_y", "slide_z")
LIFT_M, HOVER_M = 0.10, 0.06
APPROACH_S, CLOSE_S, LIFT_S, HOLD_S = 0.4, 0.35, 0.5, 2.0
GRIP_ABOVE_GRIPPER_M = 0.097  # from the gripper's body to its grip site
POSES = 16
_SLIDE_KP, _SLIDE_KV, _HAND_FORCE_N = 8000.0, 500.0, 400.0
_FINGER_KP, _FINGER_FORCE_N = 1000.0, 20.0


@dataclass
class Outcome:
    """Of an instance: whether a pose lifted it, which one, and how many were there."""

    lifted: bool
    tried: int
    poses: int
    reason: str = ""


def gripper_arena(item: catalogue.Instance) -> mujoco.MjModel:
    """The instance as body `obj` on a table, and the gripper with the robot's own bodies, shapes and fingers."""
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.compiler.autolimits = True
    apply_simulation_options(spec)
    spec.worldbody.add_geom(name="table", type=mujoco.mjtGeom.mjGEOM_BOX, size=[1, 1, 0.05], pos=[0, 0, -0.05])
    carrier = spec.worldbody.add_body(name="carrier", gravcomp=1.0)
    for name, axis in zip(SLIDES, np.eye(3), strict=True):
        joint = carrier.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
        joint.armature = 1.0
        actuator = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        actuator.set_to_position(kp=_SLIDE_KP, kv=_SLIDE_KV)
        actuator.forcerange = (-_HAND_FORCE_N, _HAND_FORCE_N)
    carrier.mass, carrier.inertia, carrier.explicitinertial = 1.0, [0.01, 0.01, 0.01], True
    wanted = {names.GRIPPER: "carrier"}
    for body in BODIES:
        if body.name == names.GRIPPER or body.parent in wanted:
            wanted[body.name] = body.name
            parent = spec.body("carrier" if body.name == names.GRIPPER else body.parent)
            added = parent.add_body(name=body.name, pos=body.pos, quat=body.quat, gravcomp=1.0)
            added.explicitinertial = True
            added.mass, added.ipos, added.iquat, added.inertia = body.mass, body.com, body.inertia_quat, body.inertia
            for joint_spec in body.joints:
                finger = added.add_joint(name=joint_spec.name, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=joint_spec.axis)
                finger.frictionloss, finger.damping = joint_spec.frictionloss, (joint_spec.damping, 0.0, 0.0)
                finger.armature = joint_spec.armature
                assert joint_spec.range is not None
                finger.range = joint_spec.range
    spec.body("gripper0_right_eef").add_site(name=names.GRIP_SITE)
    for name, material in _MATERIALS.items():
        spec.add_material(name=name, rgba=material.rgba)
    _add_meshes(spec, "fast")
    _mesh(spec, names.GRIPPER, "robot0_hand", "", "robot0_white", _HAND_MESH_QUAT)
    _fingers(spec, "")
    for index, (name, joint_name) in enumerate(zip(names.FINGER_ACTUATORS, names.FINGER_JOINTS, strict=True)):
        actuator = spec.add_actuator(name=name, target=joint_name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        actuator.set_to_position(kp=_FINGER_KP)
        actuator.ctrlrange = (0.0, 0.04) if index == 0 else (-0.04, 0.0)
        actuator.forcerange = (-_FINGER_FORCE_N, _FINGER_FORCE_N)
    add_object(spec, MaterialPalette(spec, load_style(style_ids()[0])), "obj", item)
    return spec.compile()


class GripperTrial:
    """Trials of one instance."""

    def __init__(self, item: catalogue.Instance) -> None:
        self.item = item
        self.model = gripper_arena(item)
        self.data = mujoco.MjData(self.model)
        self._settle()

    def _settle(self) -> None:
        data = self.data
        data.joint("obj_joint0").qpos[2] = self.item.size[2] / 2 + 0.002
        self._park()
        for _ in range(300):
            mujoco.mj_step(self.model, data)
        self.rest = data.joint("obj_joint0").qpos.copy()

    def _park(self) -> None:
        for name, value in zip(SLIDES, (2.0, 2.0, 1.0), strict=True):
            self.data.joint(name).qpos[0] = value
            self.data.actuator(name).ctrl[0] = value
        self._fingers(0.04)

    def _fingers(self, opening: float) -> None:
        for name, sign in zip(names.FINGER_ACTUATORS, (1.0, -1.0), strict=True):
            self.data.actuator(name).ctrl[0] = sign * opening

    def poses(self) -> list[GraspPose]:
        """Up to 16 poses in the room, for the object as it came to rest."""
        turn = np.empty(9)
        mujoco.mju_quat2Mat(turn, self.rest[3:7])
        return [
            GraspPose(pose.position + self.rest[:3], pose.rotation, pose.width, pose.score)
            for pose in grasp_poses_as_it_lies(self.item, turn.reshape(3, 3), PANDA_OMRON.gripper, POSES)
        ]

    def run(self) -> Outcome:
        """Try the poses in turn until one holds."""
        poses = self.poses()
        for index, pose in enumerate(poses):
            if self.lifts(pose):
                return Outcome(True, index + 1, len(poses))
        return Outcome(False, len(poses), len(poses), "no pose fits" if not poses else "slipped")

    def lifts(self, pose: GraspPose) -> bool:
        """Whether the gripper comes down to the pose, closes, and lifts and holds the object.

        The hand rises by 10 cm. What hangs by its rim or handle swings, so its origin must be 7 cm higher at the end,
        never have sunk below 5 cm, and it must touch a finger and not the table.
        """
        model, data = self.model, self.data
        mujoco.mj_resetData(model, data)
        data.joint("obj_joint0").qpos[:] = self.rest
        quat = np.empty(4)
        mujoco.mju_mat2Quat(quat, np.ascontiguousarray(pose.rotation).reshape(9))
        # The gripper's frame is turned by -90 degrees about z against the hand's, whose y the fingers open along.
        turned = np.empty(4)
        mujoco.mju_mulQuat(turned, quat, np.array([np.sqrt(0.5), 0.0, 0.0, -np.sqrt(0.5)]))
        model.body(names.GRIPPER).quat[:] = turned
        target = pose.position - pose.rotation[:, 2] * GRIP_ABOVE_GRIPPER_M
        start = target + np.array([0.0, 0.0, HOVER_M])
        for name, value in zip(SLIDES, start, strict=True):
            data.joint(name).qpos[0] = value
            data.actuator(name).ctrl[0] = value
        for name, value in zip(names.FINGER_JOINTS, (0.04, -0.04), strict=True):
            data.joint(name).qpos[0] = value
        self._fingers(0.04)
        self._move(start, target, APPROACH_S)
        steps = round(CLOSE_S / model.opt.timestep)
        for step in range(steps):
            self._fingers(0.04 * max(0.0, 1.0 - step / (0.6 * steps)))
            mujoco.mj_step(model, data)
        before = data.body("obj").xpos[2]
        self._move(target, target + np.array([0.0, 0.0, LIFT_M + 0.005]), LIFT_S)
        for _ in range(round(HOLD_S / model.opt.timestep / 50)):
            mujoco.mj_step(model, data, 50)
            if data.body("obj").xpos[2] < before + 0.05:
                return False
        return bool(data.body("obj").xpos[2] > before + LIFT_M - 0.03 and self._held())

    def _held(self) -> bool:
        """Whether the object touches a finger and nothing else but the gripper."""
        body = self.model.body("obj").id
        partners = set()
        for contact in self.data.contact:
            bodies = [int(self.model.geom_bodyid[g]) for g in contact.geom]
            if body in bodies:
                partners.add(sum(bodies) - body)
        return bool(partners) and self.model.geom("table").bodyid[0] not in partners

    def _move(self, start: np.ndarray, stop: np.ndarray, seconds: float) -> None:
        steps = round(seconds / self.model.opt.timestep)
        for step in range(1, steps + 1):
            share = 0.5 - 0.5 * np.cos(np.pi * step / steps)
            for name, value in zip(SLIDES, start + share * (stop - start), strict=True):
                self.data.actuator(name).ctrl[0] = value
            mujoco.mj_step(self.model, self.data)


def try_instance(name: str, index: int) -> Outcome:
    """The outcome for one instance."""
    return GripperTrial(catalogue.instance(catalogue.CATEGORIES[name], index)).run()
