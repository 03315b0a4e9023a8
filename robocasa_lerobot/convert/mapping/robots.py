"""Robots of robosuite and RoboCasa recognised from what a file holds: one or several arms, with or without a base."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from robocasa_lerobot import contract
from robocasa_lerobot.contract import Part
from robocasa_lerobot.convert.mapping.controllers import action_parts
from robocasa_lerobot.convert.mapping.custom import ABSOLUTE_SUFFIX, custom_mapping
from robocasa_lerobot.convert.mapping.robot_mapping import Arm, Columns, RobotMapping
from robocasa_lerobot.convert.reading.demo import Demo, SourceError
from robocasa_lerobot.convert.reading.demo_file import DemoFile
from robocasa_lerobot.convert.reading.layout import ABSOLUTE_ACTIONS
from robocasa_lerobot.convert.reading.mjcf import SceneNames, scene_names
from robocasa_lerobot.errors import UnknownNameError

# Site and body names of robosuite's composed models. The end effector's rotation is that of the hand's body, not of
# the grip site, which differs by a constant turn about its z axis (facts of robosuite 1.4 and 1.5).
BASE_SITE = "mobilebase0_center"
HAND_BODY = "robot0_right_hand"
GRIP_SITE = "gripper0_right_grip_site"
# Cameras of arms with a fixed base in the order in which they are taken when the user names none.
DEFAULT_CAMERAS = (
    "agentview",
    "robot0_eye_in_hand",
    "robot1_eye_in_hand",
    "robot0_eye_in_right_hand",
    "robot0_eye_in_left_hand",
    "frontview",
    "sideview",
    "birdview",
)
NUM_DEFAULT_CAMERAS = 3
_ROBOT = re.compile(r"robot(\d+)_")


def _absolute(part: Part) -> Part:
    """The part of the same meaning that is a pose to reach, instead of a step towards it."""
    components = {
        "end_effector_position": ("eef_x", "eef_y", "eef_z"),
        "end_effector_rotation": ("eef_ax", "eef_ay", "eef_az"),
    }.get(part.name)
    return part if components is None else Part(f"{part.name}{ABSOLUTE_SUFFIX}", components)


# Of a PandaOmron's `actions_abs`, in stored order.
ABSOLUTE_ACTION_PARTS = tuple(_absolute(part) for part in contract.ACTION_PARTS)


def choose_mapping(file: DemoFile, demo: Demo) -> RobotMapping:
    """The mapping for the robot of a file, judged by one of its demos; that of the mapping file where there is one.

    Raises:
        SourceError: the robot is none of the known kinds.
        UnknownNameError: an extra column is not in the demo.
    """
    mapping = custom_mapping(file.layout.robot, demo) if file.layout.robot is not None else _recognised(file, demo)
    extras = []
    for key in file.layout.extra_columns:
        column = demo.column(key)
        if column is None:
            known = [path for path, (shape, _) in demo.shapes().items() if len(shape) < 4]
            raise UnknownNameError("extra column", key, known, f"({file.path}, {demo.name})")
        extras.append(Columns(key, column.shape[1], 0, column.shape[1]))
    return replace(mapping, extra_columns=tuple(extras))


def _recognised(file: DemoFile, demo: Demo) -> RobotMapping:
    names = scene_names(demo.model_xml) if demo.model_xml else SceneNames((), frozenset(), frozenset(), ())
    for recognise in RECOGNITIONS:
        mapping = recognise(file, demo, names)
        if mapping is not None:
            return mapping
    raise SourceError(
        f"{file.path}: no mapping fits its robot ({demo.actions.shape[1]}-D actions, robots "
        f"{file.environment.get('robots')!r}). Known: {contract.ROBOT_TYPE} ({contract.ACTION_SIZE}-D actions, "
        f"{', '.join(contract.STATE_PART_HDF5_KEYS.values())} or the site {BASE_SITE}) and robosuite's arms "
        f"(robot0_eef_pos, robot0_eef_quat or the body {HAND_BODY} and a site {GRIP_SITE}, and the same of further "
        f"arms). Describe another one in a mapping file: `robocasa-lerobot inspect {file.path} --draft-mapping "
        "mapping.yaml` writes a draft for --mapping."
    )


def _panda_omron(file: DemoFile, demo: Demo, names: SceneNames) -> RobotMapping | None:
    if demo.actions.shape[1] != contract.ACTION_SIZE:
        return None
    keys = contract.STATE_PART_HDF5_KEYS
    arm = _arm(demo, names, 0, "right", "", alone=True)
    recorded = all(key in demo.observation_keys for key in keys.values())
    if not recorded and not ({BASE_SITE, arm.grip_site} <= names.sites and arm.hand_body in names.bodies):
        return None
    sizes = {part.name: part.size for part in contract.STATE_PARTS}
    action_key = file.layout.action_key
    parts = contract.ACTION_PARTS
    where = contract.ACTION_SLICES_HDF5
    return RobotMapping(
        robot_type=contract.ROBOT_TYPE,
        state_parts=contract.STATE_PARTS,
        action_parts=ABSOLUTE_ACTION_PARTS if action_key == ABSOLUTE_ACTIONS else parts,
        state_columns=tuple(Columns(f"obs/{key}", sizes[name], 0, sizes[name]) for name, key in keys.items()),
        action_columns=tuple(
            Columns(action_key, contract.ACTION_SIZE, where[part.name].start, where[part.name].stop) for part in parts
        ),
        default_cameras=contract.CAMERAS,
        arms=(arm,),
        base_site=BASE_SITE,
        unit_commands=True,
    )


def _arms(file: DemoFile, demo: Demo, names: SceneNames) -> RobotMapping | None:
    arms = _find_arms(demo, names)
    if not arms:
        return None
    observed = set(demo.observation_keys)
    recorded = all({f"{arm.observations}eef_pos", f"{arm.observations}eef_quat"} <= observed for arm in arms)
    if not recorded and not all(arm.grip_site and arm.hand_body in names.bodies for arm in arms):
        return None
    state_parts: list[Part] = []
    state_columns: list[Columns] = []
    num_fingers = []
    for arm in arms:
        key = f"obs/{arm.observations}gripper_qpos"
        gripper = demo.column(key) if recorded else None
        fingers = len(arm.joints) if not recorded else gripper.shape[1] if gripper is not None else 0
        num_fingers.append(fingers)
        for part, observation in (
            (Part("end_effector_position", ("eef_x", "eef_y", "eef_z")), "eef_pos"),
            (Part("end_effector_rotation", ("eef_qx", "eef_qy", "eef_qz", "eef_qw")), "eef_quat"),
            (Part("gripper_qpos", tuple(f"finger_{i + 1}" for i in range(fingers))), "gripper_qpos"),
        ):
            if part.size:
                state_parts.append(_of_arm(part, arm))
                state_columns.append(Columns(f"obs/{arm.observations}{observation}", part.size, 0, part.size))
    size = demo.actions.shape[1]
    joints = _num_arm_joints(demo, names, len(arms))
    absolute = file.layout.action_key == ABSOLUTE_ACTIONS
    parts = action_parts(file.environment, [arm.name for arm in arms], num_fingers, joints, size, absolute)
    ends = [sum(part.size for part in parts[: i + 1]) for i in range(len(parts))]
    return RobotMapping(
        robot_type=_robot_type(file.environment.get("robots")),
        state_parts=tuple(state_parts),
        action_parts=parts,
        state_columns=tuple(state_columns),
        action_columns=tuple(
            Columns(file.layout.action_key, size, end - part.size, end) for part, end in zip(parts, ends, strict=True)
        ),
        default_cameras=default_cameras(demo.image_cameras or names.cameras),
        arms=tuple(arms),
        unit_commands=not (absolute and parts[0].name == "action"),
    )


def _find_arms(demo: Demo, names: SceneNames) -> list[Arm]:
    seen = (*demo.observation_keys, *names.bodies)
    robots = sorted({int(match[1]) for name in seen if (match := _ROBOT.match(name))})
    found = []
    for robot in robots:
        both = f"robot{robot}_left_eef_pos" in demo.observation_keys or f"gripper{robot}_left_grip_site" in names.sites
        for side in ("right", "left") if both else ("right",):
            name = (f"robot{robot}_" if len(robots) > 1 else "") + (f"{side}_" if both else "")
            found.append(_arm(demo, names, robot, side, name, alone=not both))
    return found


def _arm(demo: Demo, names: SceneNames, robot: int, side: str, name: str, *, alone: bool) -> Arm:
    """Names in robosuite: >= 1.5 has the side in every name, older versions only for robots with two arms."""
    sites = [f"gripper{robot}_{side}_grip_site", *([f"gripper{robot}_grip_site"] if alone else [])]
    prefix = f"gripper{robot}_" if alone else f"gripper{robot}_{side}_"
    # The GR1 humanoids have the second one.
    end = next((end for end in ("hand", "eef") if f"robot{robot}_{side}_{end}" in names.bodies), "hand")
    return Arm(
        name=name,
        observations=f"robot{robot}_" if alone else f"robot{robot}_{side}_",
        hand_body=f"robot{robot}_{side}_{end}",
        grip_site=next((site for site in sites if site in names.sites), ""),
        joints=tuple(joint for joint in names.joints if joint.startswith(prefix)),
    )


def _of_arm(part: Part, arm: Arm) -> Part:
    return Part(arm.name + part.name, tuple(arm.name + component for component in part.components))


def _num_arm_joints(demo: Demo, names: SceneNames, num_arms: int) -> int | None:
    """Joints of each arm, where all have as many."""
    observed = [key for key in demo.observation_keys if re.fullmatch(r"robot\d+_joint_pos", key)]
    columns = [demo.observation(key) for key in observed]
    total = sum(column.shape[1] for column in columns if column is not None) or sum(
        1 for joint in names.joints if _ROBOT.match(joint)
    )
    return total // num_arms if total and total % num_arms == 0 else None


def _robot_type(robots: Any) -> str:
    if isinstance(robots, list) and robots and all(isinstance(robot, str) for robot in robots):
        return "+".join(robots)
    return robots if isinstance(robots, str) and robots else "unknown"


def default_cameras(available: Sequence[str]) -> tuple[str, ...]:
    """The cameras of fixed arms that are taken where the user names none."""
    known = [camera for camera in DEFAULT_CAMERAS if camera in available]
    others = [camera for camera in available if camera not in known]
    return tuple([*known, *others][:NUM_DEFAULT_CAMERAS])


RECOGNITIONS = (_panda_omron, _arms)
