"""What a held object is used on, by verb: the frame that its path is relative to, and the point of it that counts.

A tool is used where a point of it comes to: the lip of a vessel over what it pours on, the end of a spatula in a pan.
So a path is carried over as that of this point, relative to where it is used; an object of another size, held in
another way, brings its own point there. A pan that is shaken or turned where it stands is relative to itself.
"""

from __future__ import annotations

import numpy as np

from robocasa_lerobot.demos.generate.sources.transform import heading, yaw_pose
from robocasa_lerobot.demos.motion import UP, Array
from robocasa_lerobot.demos.skills.pick_place.graspable import Graspable
from robocasa_lerobot.demos.skills.pick_place.tools.surfaces import surface_of
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.kitchens.appliances.kinds.sink import Sink
from robocasa_lerobot.envs.predicates.objects import object_corners
from robocasa_lerobot.envs.tasks.task import Stage

RINSE = "rinse"  # what is put down when it has been used
UNDER_WATER = ("hold", RINSE)
BY_ITSELF = ("shake", "tilt", "turn")
USES = (*UNDER_WATER, *BY_ITSELF, "pour", "press", "press_with", "stir", "wipe")
FLAT_M = 0.003  # over the lowest point of an object: what else it stands on


def use_key(stage: int) -> str:
    """Under which a stage's frame and point are kept in a prepared demonstration."""
    return f"use.{stage}"


def is_use(stage: Stage) -> bool:
    """Whether a stage uses what is in the hand: knobs are turned and buttons pressed, too, but not held."""
    return stage.skill == "pick_place" and stage.verb in USES


def is_about_itself(env: KitchenEnv, stage: Stage) -> bool:
    """Whether a stage uses its object about where that lay before it was taken."""
    target = env.scene.fill(stage.target)
    if stage.verb == "wipe" and target not in env.scene.objects:  # a counter goes on and on
        return bool(np.isinf(surface_of(env, target, np.zeros(3)).size[0]))
    return stage.verb in BY_ITSELF


def has_heading(env: KitchenEnv, stage: Stage) -> bool:
    """Whether the frame of a use points anywhere: round things do not, whose headings mean nothing."""
    return is_about_itself(env, stage) or stage.verb == "wipe" or env.scene.fill(stage.target) not in env.scene.objects


def where_it_lay(pose: Array, underside_m: float) -> Array:
    """The frame (4, 4) of a use about an object's own place, from its pose there and the height of its underside."""
    return yaw_pose(float(pose[0, 3]), float(pose[1, 3]), heading(pose[:3, :3]), underside_m)


def use_frame(env: KitchenEnv, stage: Stage) -> Array:
    """Upright pose (4, 4) of where a stage uses its object at present, unless that is where it lay.

    Raises:
        SkillError: the target is nothing that a tool is used on.
        UserError: it is no sink, where a sink is needed.
    """
    target, data = env.scene.fill(stage.target), env.data
    if target not in env.scene.objects:
        if stage.verb == "wipe":
            return _at(surface_of(env, target, np.zeros(3)).middle, env.scene.fixture(target).yaw)
        sink = env.scene.fixture(target, Sink)
        spout = data.site(f"{sink.name}_water").xpos
        edge = sink.basin.world(data, (0.0, 0.0, sink.basin.half[2]))
        return _at(spout if stage.verb in UNDER_WATER else edge, sink.yaw)
    body, item = data.body(target), env.scene.objects[target].item
    at = np.array(body.xpos)
    yaw = 0.0
    match stage.verb:
        case "wipe":
            surface = surface_of(env, target, at)
            at, yaw = surface.middle, heading(surface.axes.T)
        case "stir" if item.interior is not None:
            low = np.array(item.interior.center) - [0.0, 0.0, item.interior.half[2]]
            at = at + body.xmat.reshape(3, 3) @ low
        case _:
            at[2] = object_corners(env.scene, data, target)[:, 2].max()
    return _at(at, yaw)


def _at(point: Array, yaw: float) -> Array:
    x, y, z = point.tolist()
    return yaw_pose(x, y, yaw, z)


def working_point(obj: Graspable, verb: str, rotation: Array) -> Array:
    """The point (3,) of an object, in its axes from its origin, that counts when it is turned so.

    Under water it is over the middle, as high as the object reaches; else the middle of its lowest points.
    """
    heights = obj.cloud @ rotation[2]
    if verb in UNDER_WATER:
        top: Array = rotation.T @ (UP * float(heights.max()))
        return top
    low: Array = obj.cloud[heights < heights.min() + FLAT_M].mean(axis=0)
    return low
