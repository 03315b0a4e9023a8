"""Builds scenes: picks layout and style of a split, casts fixtures, places robot and objects, compiles the model."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from robocasa_lerobot.envs.camera_noise import CameraNoise, add_camera_noise
from robocasa_lerobot.envs.cameras import cameras_of_set
from robocasa_lerobot.envs.placement import PlacementError
from robocasa_lerobot.envs.scene.arrange import cast_roles, place_objects
from robocasa_lerobot.envs.scene.assembly import bare_kitchen
from robocasa_lerobot.envs.scene.kitchens import Pairs, scene_ids, without
from robocasa_lerobot.envs.scene.layout import Layout, load_layout
from robocasa_lerobot.envs.scene.objects.shapes import add_object
from robocasa_lerobot.envs.scene.robot import add_robot
from robocasa_lerobot.envs.scene.scene import PlacedObject, Scene
from robocasa_lerobot.envs.scene.selection import robot_pose
from robocasa_lerobot.envs.task import Task
from robocasa_lerobot.errors import UnknownNameError, UserError

RENDER_PRESETS = ("fast", "quality")
MAX_ATTEMPTS = 50
# Key of the generator of camera noise: a stream of its own, so that noise changes nothing else of the scene.
_CAMERA_NOISE_STREAM = 2


@dataclass(frozen=True)
class _Look:
    render_preset: str
    camera_set: str
    camera_noise: CameraNoise | None


def build_scene(
    task: Task,
    split: str,
    seed: int,
    render_preset: str = "fast",
    camera_set: str = "default",
    camera_noise: CameraNoise | None = None,
    kitchens: Pairs | None = None,
) -> Scene:
    """The scene of an episode. Render preset, cameras and their noise change looks only: never physics or placement.

    `kitchens` are (layout, style) pairs to choose from instead of the split's own; the split still says which objects.

    Raises:
        UnknownNameError: no such split, preset or camera set.
        UserError: no arrangement was found in 50 attempts.
    """
    if render_preset not in RENDER_PRESETS:
        raise UnknownNameError("render preset", render_preset, RENDER_PRESETS)
    cameras_of_set(camera_set)
    look = _Look(render_preset, camera_set, camera_noise)
    pairs = without(scene_ids(split) if kitchens is None else kitchens, task.needs, task.exclude_styles)
    rng = np.random.default_rng(seed)
    failure = ""
    for _ in range(MAX_ATTEMPTS):
        layout_id, style_id = pairs[int(rng.integers(len(pairs)))]
        try:
            return _attempt(task, split, seed, layout_id, style_id, look, rng)
        except PlacementError as error:
            failure = str(error)
    raise UserError(
        f"{task.name}, split {split}, seed {seed}: no arrangement in {MAX_ATTEMPTS} attempts (last: {failure}). "
        "Use another seed."
    )


def _attempt(
    task: Task,
    split: str,
    seed: int,
    layout_id: int,
    style_id: int,
    look: _Look,
    rng: np.random.Generator,
) -> Scene:
    layout = load_layout(layout_id, style_id)
    roles = cast_roles(rng, task, layout)
    robot = robot_pose(rng, layout, task.robot_start, layout.fixtures[roles[task.robot_start.fixture]])
    openness = {roles[initial.fixture]: float(rng.uniform(initial.low, initial.high)) for initial in task.initial}
    objects = place_objects(rng, task, split, layout, roles, openness)
    spec = _assemble(layout, look, objects)
    if look.camera_noise is not None:
        noise_rng = np.random.default_rng([seed, _CAMERA_NOISE_STREAM])
        add_camera_noise(spec, look.camera_set, look.camera_noise, noise_rng)
    model = spec.compile()
    names = {name: placed.item.category.name.replace("_", " ") for name, placed in objects.items()}
    return Scene(
        task=task,
        split=split,
        seed=seed,
        layout_id=layout_id,
        style_id=style_id,
        spec=spec,
        model=model,
        layout=layout,
        roles=roles,
        objects=objects,
        openness=openness,
        robot=robot,
        instruction=task.instruction.format(side=robot.side, **names),
        paraphrases=tuple(wording.format(side=robot.side, **names) for wording in task.paraphrases),
    )


def _assemble(layout: Layout, look: _Look, objects: dict[str, PlacedObject]) -> mujoco.MjSpec:
    spec, palette = bare_kitchen(layout, look.render_preset)
    add_robot(spec, look.render_preset, camera_set=look.camera_set)
    for placed in objects.values():
        add_object(spec, palette, placed.name, placed.item)
    return spec
