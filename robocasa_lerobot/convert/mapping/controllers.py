"""What the numbers of an action mean, from the controllers that the environment's arguments name.

Orders measured in robosuite 1.5.1: a robot with one arm takes [arm, gripper], several robots one after the other; a
robot with two arms takes [right, left, right gripper, left gripper] unless `body_part_ordering` says otherwise. Before
1.5 (no `body_parts` in the configuration) it took [right, right gripper, left, left gripper].
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from robocasa_lerobot.contract import Part

_JOINT_KINDS = {
    "JOINT_POSITION": "joint_position",
    "JOINT_VELOCITY": "joint_velocity",
    "JOINT_TORQUE": "joint_torque",
}


def action_parts(
    environment: Mapping[str, Any],
    arms: Sequence[str],
    num_fingers: Sequence[int],
    num_joints: int | None,
    size: int,
    absolute: bool,
) -> tuple[Part, ...]:
    """The named parts of an action of `size` numbers, or one part without meaning where the sizes do not add up.

    Args:
        environment: arguments the environment was made with (`robots`, `controller_configs`).
        arms: what the parts of each arm begin with, in order; robots with two arms have the right one first.
        num_fingers: gripper joints of each arm; an arm without any has no gripper.
        num_joints: joints of each arm, None where unknown.
        size: numbers in an action.
        absolute: whether poses are to be reached instead of added (`actions_abs`).
    """
    plain = (Part("action", tuple(f"action_{i}" for i in range(size))),)
    configurations = _arm_configurations(environment, arms)
    if configurations is None:
        return plain
    bodies: dict[str, list[Part]] = {}
    for arm, (configuration, _) in zip(arms, configurations, strict=True):
        parts = _arm_parts(arm, configuration, num_joints, absolute)
        if parts is None:
            return plain
        bodies[arm] = parts
    grippers = {
        arm: [Part(f"{arm}gripper_close", (f"{arm}gripper_close",))] if fingers else []
        for arm, fingers in zip(arms, num_fingers, strict=True)
    }
    ordered: list[Part] = []
    done: set[str] = set()
    for arm, (_, robot) in zip(arms, configurations, strict=True):
        if arm in done:
            continue
        # The arms of one robot come together.
        mine = [a for a, (_, other) in zip(arms, configurations, strict=True) if other is robot]
        done |= set(mine)
        for name in _order(robot, mine):
            ordered += grippers[name[1:]] if name.startswith("+") else bodies[name]
    return tuple(ordered) if sum(part.size for part in ordered) == size else plain


def _order(robot: _Robot, arms: Sequence[str]) -> list[str]:
    """Arms in the order of their numbers; grippers as `+` and the name of their arm."""
    if len(arms) == 1 or not robot.composite:
        return [name for arm in arms for name in (arm, f"+{arm}")]
    sides = {"right": arms[0], "left": arms[1]}
    names = {**sides, **{f"{side}_gripper": f"+{arm}" for side, arm in sides.items()}}
    order = robot.ordering or ("right", "left", "right_gripper", "left_gripper")
    return [names[part] for part in order if part in names]


class _Robot:
    """The controllers of one robot; `composite` is robosuite >= 1.5."""

    def __init__(self, configuration: Mapping[str, Any]) -> None:
        parts = configuration.get("body_parts")
        self.composite = isinstance(parts, Mapping)
        nested = parts.get("arms") if isinstance(parts, Mapping) else None
        self._arms = nested if isinstance(nested, Mapping) else parts if isinstance(parts, Mapping) else {}
        self._configuration = configuration
        specific = configuration.get("composite_controller_specific_configs")
        ordering = specific.get("body_part_ordering") if isinstance(specific, Mapping) else None
        self.ordering = tuple(map(str, ordering)) if isinstance(ordering, list) else None

    def arm(self, side: str) -> Mapping[str, Any]:
        found = self._arms.get(side) if self.composite else self._configuration
        return found if isinstance(found, Mapping) else {}


def _arm_configurations(
    environment: Mapping[str, Any], arms: Sequence[str]
) -> list[tuple[Mapping[str, Any], _Robot]] | None:
    found = environment.get("controller_configs")
    given = found if isinstance(found, list) else [found]
    configurations: list[Mapping[str, Any]] = [one for one in given if isinstance(one, Mapping)]
    if len(configurations) != len(given) or not given:
        return None
    sides = ["left" if arm.endswith("left_") else "right" for arm in arms]
    owners = [sum(side == "right" for side in sides[: i + 1]) - 1 for i in range(len(arms))]
    num_robots = max(owners) + 1
    if len(configurations) == 1:
        configurations = configurations * num_robots
    elif len(configurations) == len(arms) != num_robots:  # before 1.5: one for each arm
        robots = [_Robot(configurations[owners.index(i)]) for i in range(num_robots)]
        return [(_Robot(configurations[i]).arm(sides[i]), robots[owners[i]]) for i in range(len(arms))]
    if len(configurations) != num_robots:
        return None
    robots = [_Robot(configuration) for configuration in configurations]
    return [(robots[owner].arm(side), robots[owner]) for owner, side in zip(owners, sides, strict=True)]


def _arm_parts(arm: str, configuration: Mapping[str, Any], num_joints: int | None, absolute: bool) -> list[Part] | None:
    kind = configuration.get("type")
    absolute = absolute or configuration.get("input_type") == "absolute" or configuration.get("control_delta") is False
    ending, step = ("_absolute", "") if absolute else ("", "d")
    position = Part(f"{arm}end_effector_position{ending}", tuple(f"{arm}eef_{step}{axis}" for axis in "xyz"))
    letter = "a" if absolute else "r"
    rotation = Part(f"{arm}end_effector_rotation{ending}", tuple(f"{arm}eef_{letter}{axis}" for axis in "xyz"))
    if kind in ("OSC_POSE", "IK_POSE"):
        return [position, rotation]
    if kind == "OSC_POSITION":
        return [position]
    if kind in _JOINT_KINDS and num_joints is not None:
        name = _JOINT_KINDS[kind] + (ending if kind == "JOINT_POSITION" else "")
        return [Part(f"{arm}{name}", tuple(f"{arm}joint_{i + 1}" for i in range(num_joints)))]
    return None
