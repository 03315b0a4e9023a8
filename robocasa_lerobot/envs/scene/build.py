"""Builds scenes: picks layout and style of a split, casts fixtures, places robot and objects, compiles the model."""

from __future__ import annotations

from dataclasses import dataclass, replace

import mujoco
import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot.envs.kitchens.appliances.kinds.blender import Blender
from robocasa_lerobot.envs.kitchens.fixtures.base import of_kind
from robocasa_lerobot.envs.kitchens.footprints import PlacementError, place
from robocasa_lerobot.envs.kitchens.layout import Layout, load_layout
from robocasa_lerobot.envs.kitchens.splits import Pairs, benchmark_split, scene_ids, without
from robocasa_lerobot.envs.objects.shapes import add_object
from robocasa_lerobot.envs.robots.camera_noise import CameraNoise, add_camera_noise
from robocasa_lerobot.envs.robots.panda_omron.robot import PANDA_OMRON
from robocasa_lerobot.envs.robots.robot import Robot
from robocasa_lerobot.envs.scene.drawn import Drawn, PlacedObject
from robocasa_lerobot.envs.scene.initial_states import Initial, LidAside, PartAt
from robocasa_lerobot.envs.scene.kept_kitchens import kitchen
from robocasa_lerobot.envs.scene.memory import Memory, add_memory
from robocasa_lerobot.envs.scene.placement.at_rest import ask_for_rest
from robocasa_lerobot.envs.scene.placement.counter_areas import counter_areas
from robocasa_lerobot.envs.scene.placement.objects import place_objects
from robocasa_lerobot.envs.scene.placement.overlaps import ask_for_room
from robocasa_lerobot.envs.scene.placement.regions import Shares
from robocasa_lerobot.envs.scene.robot_poses import RobotPose, open_before, open_doors_of, robot_pose
from robocasa_lerobot.envs.scene.roles import cast_roles, counter_of
from robocasa_lerobot.envs.scene.scene import Scene
from robocasa_lerobot.envs.scene.scene_spec import SceneSpec
from robocasa_lerobot.envs.scene.spec import InitialOpenness, OnCounter
from robocasa_lerobot.envs.scene.task_parameters import Choices, draw_choices, filled
from robocasa_lerobot.envs.scene.words import numbered, said, words_of
from robocasa_lerobot.envs.seeds import checked_seed
from robocasa_lerobot.errors import UnknownNameError, UserError

RENDER_PRESETS = ("fast", "quality")
MAX_ATTEMPTS = 50
FEW_KITCHENS = 5  # in so few, 50 attempts have met each about ten times
# Key of the generator of camera noise: a stream of its own, so that noise changes nothing else of the scene.
_CAMERA_NOISE_STREAM = 5

# Liquids in a vessel: colour and opacity.
LIQUIDS = {
    "coffee": (0.25, 0.13, 0.06, 1.0),
    "hot_chocolate": (0.34, 0.19, 0.11, 1.0),
    "broth": (0.80, 0.62, 0.28, 0.6),
    "lemonade": (0.95, 0.90, 0.50, 0.6),
    "marinade": (0.42, 0.22, 0.10, 0.95),
    "milk": (0.97, 0.96, 0.92, 1.0),
    "orange_juice": (0.98, 0.62, 0.15, 0.9),
    "soup": (0.86, 0.50, 0.20, 0.7),
    "smoothie": (0.93, 0.55, 0.58, 1.0),
    "soy_sauce": (0.28, 0.12, 0.05, 0.6),
    "tea": (0.60, 0.30, 0.08, 0.8),
    "tomato_sauce": (0.85, 0.25, 0.12, 0.6),
    "water": (0.72, 0.86, 0.94, 0.5),
}


@dataclass(frozen=True)
class _Look:
    render_preset: str
    camera_set: str
    camera_noise: CameraNoise | None


@dataclass(frozen=True)
class Arrangement:
    """What stands where at the start of a task.

    Attributes:
        roles: fixtures by role.
        choices: what was chosen among equals.
        openness: of doors and drawers, by fixture and part.
        initial: the task's further initial state, each entry with the number drawn for it.
        lids: roles of the blenders whose lid is not on, and whether it is gone altogether.
        objects: by name.
        robot: where it stands.
    """

    roles: dict[str, str]
    choices: Choices
    openness: dict[tuple[str, str], float]
    initial: tuple[tuple[Initial, float], ...]
    lids: dict[str, bool]
    objects: dict[str, PlacedObject]
    robot_pose: RobotPose


def build_scene(
    task: SceneSpec,
    split: str,
    seed: int,
    render_preset: str = "fast",
    camera_set: str = "default",
    camera_noise: CameraNoise | None = None,
    kitchens: Pairs | None = None,
    robot: Robot = PANDA_OMRON,
) -> Scene:
    """The scene of an episode. Render preset, cameras and their noise change looks only: never physics or placement.

    `kitchens` are (layout, style) pairs to choose from instead of the split's own; the split still says which objects.

    Raises:
        UnknownNameError: no such split, preset or camera set.
        UserError: it is no seed, or no arrangement was found in 50 attempts.
    """
    seed = checked_seed(seed)
    if render_preset not in RENDER_PRESETS:
        raise UnknownNameError("render preset", render_preset, RENDER_PRESETS)
    robot.cameras(camera_set)
    look = _Look(render_preset, camera_set, camera_noise)
    pairs = without(scene_ids(split) if kitchens is None else kitchens, task.needs, task.exclude_styles)
    rng = np.random.default_rng(seed)
    failure = ""
    for _ in range(MAX_ATTEMPTS):
        layout_id, style_id = pairs[int(rng.integers(len(pairs)))]
        try:
            return _attempt(task, split, seed, layout_id, style_id, look, robot, rng)
        except PlacementError as error:
            failure = str(error)
    remedy = "Use another seed." if len(pairs) > FEW_KITCHENS else "It may have no room there: name other kitchens."
    raise UserError(
        f"{task.name}, split {split}, seed {seed}: no arrangement in {MAX_ATTEMPTS} attempts (last: {failure}). "
        f"{remedy}"
    )


def tell(scene: Scene, task: SceneSpec) -> None:
    """Word a scene's instruction with the words that it has now."""
    scene.instruction = said(task.instruction, scene.words)
    scene.paraphrases = tuple(said(wording, scene.words) for wording in task.paraphrases)


def _attempt(
    task: SceneSpec,
    split: str,
    seed: int,
    layout_id: int,
    style_id: int,
    look: _Look,
    robot: Robot,
    rng: np.random.Generator,
) -> Scene:
    layout = load_layout(layout_id, style_id)
    arranged = arrange(rng, task, benchmark_split(split), layout, robot)
    roles, choices, objects, pose = arranged.roles, arranged.choices, arranged.objects, arranged.robot_pose
    spots = {role: _lid_spot(rng, layout, roles[role], objects) for role, gone in arranged.lids.items() if not gone}
    spec = _assemble(task, layout, look, robot, objects)
    remembering = task.remembering(Drawn(roles=roles, objects=objects, choices=choices.values))
    kept = {part.name: part.numbers for part in remembering}
    add_memory(spec, kept)
    if look.camera_noise is not None:
        noise_rng = np.random.default_rng([seed, _CAMERA_NOISE_STREAM])
        add_camera_noise(spec, robot.cameras(look.camera_set), look.camera_noise, noise_rng)
    model = spec.compile()
    categories = {name: placed.item.category.name for name, placed in objects.items()}
    words = words_of(layout, roles, categories, [wanted.name for wanted in task.objects if wanted.count != (1, 1)])
    # A choice's words may name objects: "the {food}" of the bowl that was drawn.
    words.update({"side": pose.side} | {name: said(word, words) for name, word in choices.words.items()})
    scene = Scene(
        split=split,
        seed=seed,
        layout_id=layout_id,
        style_id=style_id,
        spec=spec,
        model=model,
        layout=layout,
        roles=roles,
        objects=objects,
        openness=arranged.openness,
        robot=robot,
        robot_pose=pose,
        instruction="",
        choices=choices.values,
        words=words,
        initial=arranged.initial,
        lid_spots=spots,
        remembering=remembering,
        memory=Memory.of(model, kept),
    )
    tell(scene, task)
    ask_for_room(scene)
    ask_for_rest(scene)
    return scene


def arrange(
    rng: np.random.Generator, task: SceneSpec, split: str, layout: Layout, robot: Robot = PANDA_OMRON
) -> Arrangement:
    """Draw what stands where in a layout at the start of a task.

    Raises:
        PlacementError: the layout has not what the task needs, or not the room for it.
    """
    roles = cast_roles(rng, task.fixtures, layout)
    for wanted in task.fixtures:
        if wanted.fitted:
            layout.fixtures[roles[wanted.role]].fit(wanted.fitted)
    choices = draw_choices(rng, task, layout.fixtures, roles)
    pose: RobotPose | None = None
    start, shape = task.robot_start, robot.shape
    at_object = filled(start.at_object, choices.values)
    start = replace(start, fixture=filled(start.fixture, choices.values), at_object=at_object)
    openings = [entry for entry in task.initial if isinstance(entry, InitialOpenness)]
    opened = open_before((layout.fixtures[roles[entry.fixture]], entry.low, entry.high) for entry in openings)
    if not start.at_object:
        pose = robot_pose(rng, layout, start, layout.fixtures[roles[start.fixture]], shape, opened=opened)
    openness = {
        (roles[entry.fixture], _part(layout, roles, entry)): float(rng.uniform(entry.low, entry.high))
        for entry in openings
    }
    further = [entry for entry in task.initial if isinstance(entry, Initial)]
    initial = tuple((entry, entry.draw(rng, choices.values)) for entry in further)
    lids = _lids(task, roles)
    for role, gone in lids.items():
        of_kind(layout.fixtures[roles[role]], Blender).with_lid = not gone
    places: dict[str, float | Shares] = {name: share for (name, part), share in openness.items() if not part}
    places |= _shares(initial, roles, choices)
    objects = place_objects(rng, task, split, layout, roles, places, choices.values, open_doors_of(opened))
    if pose is None:
        at = objects[start.at_object].region_middle
        pose = robot_pose(rng, layout, start, layout.fixtures[roles[start.fixture]], shape, at, opened)
    return Arrangement(roles, choices, openness, initial, lids, objects, pose)


def _part(layout: Layout, roles: dict[str, str], entry: InitialOpenness) -> str:
    """The part of a fixture that starts open.

    Raises:
        PlacementError: the fixture has no door there.
    """
    fixture = layout.fixtures[roles[entry.fixture]]
    if entry.part and not any(door.startswith(entry.part) for door in fixture.door_names):
        raise PlacementError(f"{fixture.name} has no door of its {entry.part}. Ask for another kind of fixture.")
    return entry.part


def _shares(initial: tuple[tuple[Initial, float], ...], roles: dict[str, str], choices: Choices) -> dict[str, Shares]:
    """Where parts stand that objects may lie on, by fixture."""
    found: dict[str, dict[str, float]] = {}
    for entry, share in initial:
        if isinstance(entry, PartAt):
            found.setdefault(roles[entry.fixture], {})[entry.part.format(**choices.values)] = share
    return dict(found)


def _lids(task: SceneSpec, roles: dict[str, str]) -> dict[str, bool]:
    """Roles of the blenders whose lid is not on, and whether it is gone altogether."""
    return {entry.fixture: entry.gone for entry in task.initial if isinstance(entry, LidAside)}


def _lid_spot(
    rng: np.random.Generator, layout: Layout, name: str, objects: dict[str, PlacedObject]
) -> NDArray[np.float64]:
    """Where the lid of a blender may lie on its counter: in the room, metres.

    Raises:
        PlacementError: there is no room for it.
    """
    blender = of_kind(layout.fixtures[name], Blender)
    counter = counter_of(layout, blender)
    areas, standing = counter_areas(layout, OnCounter("", "left_right", size=(0.35, 0.35)), blender)
    taken = [placed.footprint for placed in objects.values()]
    width, depth, _ = blender.lid_size
    spot, _ = place(rng, areas, (width / 2, depth / 2), [*standing, *taken], what="the blender's lid")
    return np.array([spot.x, spot.y, counter.surface_z + 0.002])


def _assemble(
    task: SceneSpec, layout: Layout, look: _Look, robot: Robot, objects: dict[str, PlacedObject]
) -> mujoco.MjSpec:
    spec, palette = kitchen(layout, look.render_preset)
    robot.add_to(spec, look.render_preset, look.camera_set)
    liquids = {
        name: LIQUIDS[wanted.filled]
        for wanted in task.objects
        if wanted.filled
        for name in numbered(wanted.name, objects)
    }
    for placed in objects.values():
        add_object(spec, palette, placed.name, placed.item, liquid=liquids.get(placed.name))
    return spec
