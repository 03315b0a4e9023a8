"""The parts that scenes are made of: layouts, textures, objects, placement."""

from __future__ import annotations

import csv
import io
import json

import mujoco
import numpy as np
import pytest
from blueprint_words.ours import MISCOUNTED, UNLISTED, UNLISTED_LAST
from PIL import Image
from task_selection import every_task

from robocasa_lerobot.envs.checks.soundness import overlaps
from robocasa_lerobot.envs.kitchens.fixtures.cabinets import FULL_TRAVEL_OF_DEPTH, Drawer
from robocasa_lerobot.envs.kitchens.footprints import Area, Footprint, PlacementError, place
from robocasa_lerobot.envs.kitchens.layout import layout_ids, load_layout
from robocasa_lerobot.envs.kitchens.materials import split_of, style_ids
from robocasa_lerobot.envs.kitchens.textures import GENERATORS, TextureRecord, texture_png
from robocasa_lerobot.envs.scene.assembly import bare_kitchen
from robocasa_lerobot.envs.scene.build import build_scene
from robocasa_lerobot.envs.tasks.registry import get_task, task_names
from robocasa_lerobot.envs.tasks.task import Stage, Task


@pytest.mark.parametrize("kind", GENERATORS)
def test_textures_are_pure_functions_of_their_record(kind):
    record = TextureRecord(kind, (0.7, 0.5, 0.3), (0.3, 0.2, 0.1), seed=5)
    png = texture_png(record)
    texture_png.cache_clear()
    assert texture_png(record) == png
    pixels = np.asarray(Image.open(io.BytesIO(png)))
    assert pixels.shape == (256, 256, 3)
    assert pixels.std() > 1
    assert texture_png(TextureRecord(kind, (0.7, 0.5, 0.3), (0.3, 0.2, 0.1), seed=6)) != png


# Each layout in two styles, far apart: every layout, every style, every model of an appliance.
PAIRS = [(i, j) for i in layout_ids() for j in style_ids() if split_of(i) == split_of(j) and (i - j) % 50 in (0, 17)]


@pytest.mark.parametrize(("layout_id", "style_id"), PAIRS[::5])
def test_kitchens_compile_with_their_fixtures_apart_and_rest(layout_id, style_id):
    _assert_sound(layout_id, style_id)


@pytest.mark.slow
@pytest.mark.parametrize(("layout_id", "style_id"), PAIRS)
def test_all_kitchens_compile_with_their_fixtures_apart_and_rest(layout_id, style_id):
    _assert_sound(layout_id, style_id)


def _assert_sound(layout_id, style_id):
    layout = load_layout(layout_id, style_id)
    spec, _ = bare_kitchen(layout)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert overlaps(model, data, layout.fixtures) == []
    start = data.qpos.copy()
    for _ in range(200):
        mujoco.mj_step(model, data)
    assert np.abs(data.qpos - start).max() < 5e-3  # doors and drawers stay shut


def test_overlaps_are_found():
    layout = load_layout(1)
    first, second = [f for f in layout.fixtures.values() if isinstance(f, Drawer)][:2]
    second.pos = (first.pos[0], first.pos[1], first.pos[2] + 0.03)
    spec, _ = bare_kitchen(layout)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert (first.name, second.name) in {(o.first, o.second) for o in overlaps(model, data, layout.fixtures)}


def test_drawers_open_by_their_full_travel():
    drawer = next(f for f in load_layout(1).fixtures.values() if isinstance(f, Drawer))
    assert drawer.full_travel == pytest.approx(FULL_TRAVEL_OF_DEPTH * drawer.depth)
    assert FULL_TRAVEL_OF_DEPTH == 0.55


def test_footprints_overlap_as_rectangles_do():
    a = Footprint(0, 0, 0, (0.5, 0.1))
    assert a.overlaps(Footprint(0.9, 0, 0, (0.5, 0.1)))
    assert not a.overlaps(Footprint(1.1, 0, 0, (0.5, 0.1)))
    assert a.overlaps(Footprint(1.1, 0, 0, (0.5, 0.1)), margin=0.2)
    # Their circumscribed circles meet, the rectangles do not.
    assert not a.overlaps(Footprint(0.0, 0.5, np.pi / 4, (0.3, 0.1)))
    assert a.overlaps(Footprint(0.0, 0.3, np.pi / 4, (0.3, 0.1)))


def test_placement_keeps_inside_and_apart_or_says_so():
    area = Area(-0.3, 0.3, -0.2, 0.2, (1.0, -1.0), np.pi / 2, 0.9)
    rng = np.random.default_rng(1)
    taken: list[Footprint] = []
    for _ in range(5):
        found, where = place(rng, [area], (0.05, 0.05), taken)
        assert where is area
        assert not any(found.overlaps(other, 0.0099) for other in taken)
        corners = found.corners() - [1.0, -1.0]
        # The area's frame is turned by a quarter: its x runs along the room's y.
        assert np.abs(corners[:, 1]).max() <= 0.3 + 1e-9
        assert np.abs(corners[:, 0]).max() <= 0.2 + 1e-9
        taken.append(found)
    with pytest.raises(PlacementError, match="no free place"):
        place(rng, [area], (0.28, 0.19), taken)


@pytest.mark.parametrize("task", every_task())
@pytest.mark.parametrize("seed", range(5))
def test_scenes_are_pure_functions_of_task_split_and_seed(task, seed):
    first, second = (build_scene(get_task(task), "target", seed) for _ in range(2))
    assert first.spec.to_xml() == second.spec.to_xml()
    assert first.ep_meta() == second.ep_meta()
    json.dumps(first.ep_meta())


@pytest.mark.parametrize("task", every_task())
def test_the_recorded_xml_is_the_model(task):
    """A model loaded from the XML that demonstrations carry puts every body where the env has it."""
    scene = build_scene(get_task(task), "target", 1)
    data, _ = scene.initial_data(np.random.default_rng(0))
    loaded = mujoco.MjModel.from_xml_string(scene.spec.to_xml(), scene.spec.assets)
    again = mujoco.MjData(loaded)
    again.qpos[:] = data.qpos
    mujoco.mj_kinematics(loaded, again)
    mujoco.mj_kinematics(scene.model, data)
    assert loaded.nq == scene.model.nq
    assert np.abs(again.xpos - data.xpos).max() < 1e-4
    assert np.abs(again.geom_xpos - data.geom_xpos).max() < 1e-4


def stage_counts(task: Task) -> set[int]:
    """How many stages a task may have; where they depend on what is drawn, those of some scenes."""
    if isinstance(task.stages, tuple) and all(isinstance(stage, Stage) for stage in task.stages):
        return {len(task.stages)}
    return {len(task.bound(build_scene(task, "target", seed)).stages) for seed in range(8)}


@pytest.mark.costly
@pytest.mark.parametrize("name", task_names())
def test_declarations_agree_with_the_published_facts(name, shared):
    with (shared / "facts" / "tasks.csv").open() as file:
        row = next(r for r in csv.DictReader(file) if r["task"] == name)
    task = get_task(name)
    assert (task.facts.horizon or 0) == int(row["horizon"] or 0)
    assert (task.facts.own_horizon is None) == bool(row["horizon"])  # ours stand only where none is published
    assert task.horizon % 50 == 0
    assert task.facts.kind == row["kind"]
    assert task.facts.human_seconds == int(row["human_episode_seconds"])
    assert task.facts.sets == set(row["sets"].split())
    counts = {count - UNLISTED.get(name, 0) - UNLISTED_LAST.get(name, 0) for count in stage_counts(task)}
    assert min(counts) <= MISCOUNTED.get(name, int(row["subtasks"])) <= max(counts)
    assert len(task.paraphrases) >= 4
    assert task.instruction not in task.paraphrases
