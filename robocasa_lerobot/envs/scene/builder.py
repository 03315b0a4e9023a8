"""Builds scenes: picks layout and style of a split, casts fixtures, places robot and objects, compiles the model."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from robocasa_lerobot.envs.camera_noise import CameraNoise, add_camera_noise
from robocasa_lerobot.envs.cameras import cameras_of_set
from robocasa_lerobot.envs.placement import Footprint, PlacementError, place
from robocasa_lerobot.envs.scene.layout import Layout, layout_ids, load_layout
from robocasa_lerobot.envs.scene.materials import MaterialPalette, load_style, style_ids
from robocasa_lerobot.envs.scene.objects import catalogue
from robocasa_lerobot.envs.scene.objects.shapes import add_object
from robocasa_lerobot.envs.scene.robot import add_robot, apply_simulation_options
from robocasa_lerobot.envs.scene.scene import PlacedObject, Scene
from robocasa_lerobot.envs.scene.selection import candidates, counter_areas, inside_area, robot_pose
from robocasa_lerobot.envs.task import OnCounter, Task
from robocasa_lerobot.errors import UnknownNameError, UserError

SPLITS = ("pretrain", "target")
RENDER_PRESETS = ("fast", "quality")
LAST_TARGET_ID = 10  # ids 1..10 are target, 11..60 pretraining (robocasa facts, section 6)
MAX_ATTEMPTS = 50
PLACEMENT_GAP_M = 0.004  # objects start this far above their surface and settle
# Key of the generator of camera noise: a stream of its own, so that noise changes nothing else of the scene.
_CAMERA_NOISE_STREAM = 2


@dataclass(frozen=True)
class _Look:
    render_preset: str
    camera_set: str
    camera_noise: CameraNoise | None


def scene_ids(split: str) -> list[tuple[int, int]]:
    """(layout, style) pairs of a split: target pairs (i, i), pretraining every layout with every style.

    Raises:
        UnknownNameError: no such split.
        UserError: the split has no kitchens in this version.
    """
    if split not in SPLITS:
        raise UnknownNameError("split", split, SPLITS)
    if split == "target":
        pairs = [(i, i) for i in layout_ids() if i <= LAST_TARGET_ID and i in style_ids()]
    else:
        pairs = [(i, j) for i in layout_ids() if i > LAST_TARGET_ID for j in style_ids() if j > LAST_TARGET_ID]
    if not pairs:
        raise UserError(f"split {split!r} has no kitchens in this version; use split='target'.")
    return pairs


def build_scene(
    task: Task,
    split: str,
    seed: int,
    render_preset: str = "fast",
    camera_set: str = "default",
    camera_noise: CameraNoise | None = None,
) -> Scene:
    """The scene of an episode. Render preset, cameras and their noise change looks only: never physics or placement.

    Raises:
        UnknownNameError: no such split, preset or camera set.
        UserError: no arrangement was found in 50 attempts.
    """
    if render_preset not in RENDER_PRESETS:
        raise UnknownNameError("render preset", render_preset, RENDER_PRESETS)
    cameras_of_set(camera_set)
    look = _Look(render_preset, camera_set, camera_noise)
    pairs = scene_ids(split)
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
    layout = load_layout(layout_id)
    roles: dict[str, str] = {}
    for wanted in task.fixtures:
        pool = candidates(layout, wanted.kind)
        if not pool:
            raise PlacementError(f"layout {layout_id} has no {wanted.kind}")
        roles[wanted.role] = pool[int(rng.integers(len(pool)))].name
    robot = robot_pose(rng, layout, task.robot_start, layout.fixtures[roles[task.robot_start.fixture]])
    openness = {roles[initial.fixture]: float(rng.uniform(initial.low, initial.high)) for initial in task.initial}
    objects = _place_objects(rng, task, split, layout, roles, openness)
    spec = _assemble(layout, style_id, look, objects)
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
        fixtures=layout.fixtures,
        roles=roles,
        objects=objects,
        openness=openness,
        robot=robot,
        instruction=task.instruction.format(side=robot.side, **names),
        paraphrases=tuple(wording.format(side=robot.side, **names) for wording in task.paraphrases),
    )


def _place_objects(
    rng: np.random.Generator,
    task: Task,
    split: str,
    layout: Layout,
    roles: dict[str, str],
    openness: dict[str, float],
) -> dict[str, PlacedObject]:
    placed: dict[str, PlacedObject] = {}
    taken: list[Footprint] = []
    used: set[str] = set()
    for wanted in task.objects:
        count = int(rng.integers(wanted.count[0], wanted.count[1] + 1))
        for index in range(count):
            item = catalogue.sample(
                rng,
                wanted.groups,
                split,
                graspable=wanted.graspable,
                washable=wanted.washable,
                max_height=wanted.max_height,
                exclude=frozenset(used),  # so that an instruction names one object of the scene
            )
            used.add(item.category.name)
            start = wanted.start
            if isinstance(start, OnCounter):
                areas, standing = counter_areas(layout, start, layout.fixtures[roles[start.near]])
            else:
                fixture = layout.fixtures[roles[start.fixture]]
                areas, standing = [inside_area(start, fixture, openness.get(fixture.name, 0.0))], []
            half = (item.size[0] / 2, item.size[1] / 2)
            footprint, area = place(rng, areas, half, [*taken, *standing])
            taken.append(footprint)
            name = wanted.name if wanted.count == (1, 1) else f"{wanted.name}_{index}"
            z = area.z + item.size[2] / 2 + PLACEMENT_GAP_M
            placed[name] = PlacedObject(name, item, (footprint.x, footprint.y, z), footprint.yaw)
    return placed


def _assemble(layout: Layout, style_id: int, look: _Look, objects: dict[str, PlacedObject]) -> mujoco.MjSpec:
    spec = mujoco.MjSpec()
    spec.modelname = f"kitchen_{layout.layout_id}_{style_id}"
    spec.compiler.degree = False
    spec.compiler.autolimits = True
    apply_simulation_options(spec)
    # What is at rest sleeps: a kitchen of a hundred joints then costs little more than its robot.
    spec.option.enableflags |= int(mujoco.mjtEnableBit.mjENBL_SLEEP)
    _light(spec, layout, look.render_preset)
    palette = MaterialPalette(spec, load_style(style_id))
    for fixture in layout.fixtures.values():
        fixture.build(spec, palette)
    add_robot(spec, look.render_preset, camera_set=look.camera_set)
    for placed in objects.values():
        add_object(spec, palette, placed.name, placed.item)
    return spec


def _light(spec: mujoco.MjSpec, layout: Layout, render_preset: str) -> None:
    visual = spec.visual
    visual.headlight.ambient = [0.38, 0.38, 0.38]
    visual.headlight.diffuse = [0.22, 0.22, 0.22]
    visual.headlight.specular = [0.05, 0.05, 0.05]
    visual.quality.shadowsize = 4096
    visual.quality.offsamples = 0 if render_preset == "fast" else 8
    if render_preset == "fast":
        # Fewer facets on round shapes: half the time of a software-rendered picture, hardly visible at 256 pixels.
        visual.quality.numslices, visual.quality.numstacks, visual.quality.numquads = 10, 6, 1
    visual.map.zfar = 12.0
    # Distances of the map are in units of the model's extent.
    spec.stat.extent = 1.0
    spec.stat.center = [(layout.room["x_min"] + layout.room["x_max"]) / 2, -1.0, 1.0]
    middle = spec.stat.center[0]
    for name, position, direction, strength, shadow in (
        ("ceiling_light", [middle, -2.0, layout.room["height"]], [0.12, 0.35, -1.0], 0.48, True),
        ("window_light", [middle, -1.0, 2.4], [-0.45, -0.1, -0.8], 0.18, False),
    ):
        light = spec.worldbody.add_light(name=name, pos=position, dir=direction)
        light.type = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
        light.diffuse = [strength, strength, strength * 0.97]
        light.specular = [0.25, 0.25, 0.25]
        light.castshadow = shadow and render_preset == "quality"
