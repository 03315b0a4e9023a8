"""Tasks of which something is drawn: the same seed gives the same, and goal, stages and words follow from it."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from drawn_tasks import CUBES, DRAWN, FOOD, FRUIT, FRUITS, ICE, PANTRY, SINK, TOOLS, in_sink

from robocasa_lerobot.demos.demonstrator import can_demonstrate
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.kitchens.appliances.kinds.sink import Sink
from robocasa_lerobot.envs.kitchens.fixtures.cabinets import HingeCabinet
from robocasa_lerobot.envs.objects.catalogue import Instance, auxiliary
from robocasa_lerobot.envs.predicates import AllOf, ForEach, ObjectOn, StateIs
from robocasa_lerobot.envs.scene.build import build_scene
from robocasa_lerobot.envs.scene.scene import Scene
from robocasa_lerobot.envs.scene.spec import (
    Choice,
    FixtureSpec,
    ObjectSpec,
    OnCounter,
    Placement,
    RobotStart,
    SampleRegion,
)
from robocasa_lerobot.envs.scene.task_parameters import draw_choices, item_of, name_of, number_of
from robocasa_lerobot.envs.tasks.registry import get_task, task_names
from robocasa_lerobot.envs.tasks.stage_text import stage_text
from robocasa_lerobot.envs.tasks.task import BoundTask, Stage, StagesWhen, Task
from robocasa_lerobot.envs.tasks.typical import goal_of, stages_of
from robocasa_lerobot.errors import UserError

SEEDS = range(8)


def in_scene(task: Task, seed: int, split: str = "target") -> tuple[Scene, BoundTask]:
    scene = build_scene(task, split, seed)
    return scene, task.bound(scene)


@pytest.mark.parametrize("name", DRAWN)
def test_everything_that_is_drawn_follows_from_the_seed(name: str) -> None:
    task = DRAWN[name]
    drawn = set()
    for seed in SEEDS:
        (first, told), (again, told_again) = (in_scene(task, seed) for _ in range(2))
        assert first.objects == again.objects
        assert (first.choices, first.words) == (again.choices, again.words)
        assert (told.stages, first.instruction) == (told_again.stages, again.instruction)
        drawn.add((len(first.objects), *(first.choices[choice.name] for choice in task.choices)))
        for stage in told.stages:
            assert not set("{}0123456789_") & set(stage_text(stage, first))
    assert len(drawn) > 1, drawn


def test_as_many_objects_goals_and_stages_as_were_drawn() -> None:
    counts = set()
    for seed in SEEDS:
        scene, told = in_scene(FRUITS, seed)
        names = scene.named("fruit")
        assert names == tuple(f"fruit_{i}" for i in range(len(names)))
        assert tuple(stage.object for stage in told.stages) == names
        counts.add(len(names))
        terms: dict[str, bool] = {}
        data, _ = scene.initial_data(np.random.default_rng(0))
        assert not told.goal.evaluate(scene, data, terms)
        assert set(terms) == {key for n in names for key in (f"{n}_in_sink", f"gripper_far_from_{n}")}
        kinds = [scene.words[each] for each in names]
        assert scene.instruction.startswith("Put ")
        assert scene.instruction.endswith(" into the sink.")
        if len(set(kinds)) == len(kinds):
            assert all(f"the {kind}" in scene.instruction for kind in kinds)
    assert counts == {1, 2, 3}


def test_one_of_several_that_is_elsewhere_is_enough_to_fail() -> None:
    seed = next(seed for seed in SEEDS if len(build_scene(FRUITS, "target", seed).named("fruit")) == 3)
    scene, told = in_scene(FRUITS, seed)
    data, _ = scene.initial_data(np.random.default_rng(0))
    basin = scene.fixture("sink", Sink).basin
    middle = data.body(basin.body).xpos + np.asarray(basin.center)
    for number, name in enumerate(scene.named("fruit")):
        assert not told.goal.evaluate(scene, data, {}), number
        data.body(name).xpos[:] = middle
    assert told.goal.evaluate(scene, data, {})


def test_a_choice_may_say_how_many_and_what_is_said_of_them() -> None:
    seen = set()
    for seed in SEEDS:
        scene, told = in_scene(ICE, seed)
        names = scene.named("ice_cube")
        assert str(len(names)) == scene.choices["n"]
        assert len(told.stages) == len(names)
        said = {2: "both", 3: "all three"}[len(names)]
        assert scene.instruction == f"Move {said} ice cubes from the bowl into the blender."
        assert scene.words["ice_cube"] == f"{said} ice cubes"
        assert scene.words["ice_cube_count"] == {2: "two", 3: "three"}[len(names)]
        bowl = scene.objects["bowl"]
        for name in names:
            assert scene.objects[name].item.scale == (0.8, 0.8, 0.8)
            away = np.subtract(scene.objects[name].pos, bowl.pos)[:2]
            assert np.hypot(*away) < max(bowl.item.size[:2]) / 2
        seen.add(len(names))
    assert seen == {2, 3}


def test_the_other_stands_on_the_other_side() -> None:
    sides = set()
    for seed in SEEDS:
        scene, _ = in_scene(PANTRY, seed)
        cabinet = scene.fixture("cab")
        assert isinstance(cabinet, HingeCabinet)
        across = {name: cabinet.to_local(placed.pos)[0] for name, placed in scene.objects.items()}
        side = scene.choices["side"]
        assert (across["here"] < across["there"]) == (side == "left")
        other = "right" if side == "left" else "left"
        assert scene.instruction == f"It is on the {side}, the other on the {other}."
        sides.add(side)
    assert sides == {"left", "right"}


def test_the_robot_starts_where_a_choice_says() -> None:
    choice = Choice("at", {"cab": {}, "other": {}})
    others = (*PANTRY.fixtures, FixtureSpec("other", "sink"))
    task = replace(PANTRY, choices=(*PANTRY.choices, choice), fixtures=others, robot_start=RobotStart("{at}"))
    starts = set()
    for seed in range(6):
        scene, _ = in_scene(task, seed)
        wanted, pose = scene.standing_pose(scene.choices["at"]), scene.robot_pose
        assert np.hypot(wanted.x - pose.x, wanted.y - pose.y) < 0.3
        starts.add(scene.choices["at"])
    assert starts == {"cab", "other"}


def test_parts_that_a_choice_leaves_out_are_not_drawn() -> None:
    task = get_task("SweetenHotChocolate")
    burners = {build_scene(task, "target", seed).choices["burner"] for seed in range(5)}
    assert len(burners) > 1
    assert not any(burner.startswith("rear") for burner in burners)


def test_categories_goals_and_stages_by_a_choice() -> None:
    tools = set()
    for seed in range(12):
        scene, told = in_scene(TOOLS, seed)
        tool = FOOD[scene.objects["food"].item.category.name]
        tools.add(tool)
        assert told.stages[0].object == tool
        assert len(told.stages) == {"knife": 1, "peeler": 2}[tool]
        terms: dict[str, bool] = {}
        data, _ = scene.initial_data(np.random.default_rng(0))
        told.goal.evaluate(scene, data, terms)
        assert list(terms) == [ObjectOn(tool, "food").name]
    assert tools == {"knife", "peeler"}


def test_the_object_of_a_stage_by_a_choice() -> None:
    drawn, kept = (
        Stage("pick_place", "place", "food", object="{_tool}"),
        Stage("x", "y", "sink", object="{sink}_lid"),
    )
    for seed in range(4):
        scene, told = in_scene(replace(TOOLS, stages=(drawn, kept)), seed)
        assert told.stages[0].object == scene.choices["_tool"]
        assert told.stages[1] == kept  # names of fixtures are filled in by skills
        assert stage_text(told.stages[0], scene).startswith(f"put the {scene.choices['_tool']} on the ")


def alike(**fields: Any) -> Task:
    start = Placement("counter", region=SampleRegion("sink", "any"), size=(0.9, 0.5))
    counter = FixtureSpec("counter", "counter", near="sink")
    wanted = ObjectSpec("nest", ("cup", "bowl"), start, count=(2, 3), same_category_as="nest", **fields)
    return replace(
        FRUITS,
        fixtures=(*SINK.fixtures, counter),
        objects=(wanted,),
        goal=ForEach("nest", in_sink),
        stages=(Stage("levers", "on", "sink", part="handle"),),
        instruction="Nest {nest}.",
        paraphrases=(),
    )


def test_several_alike_and_smaller_and_smaller() -> None:
    for seed in range(4):
        scene = build_scene(alike(scale_step=0.8), "target", seed)
        items = [scene.objects[name].item for name in scene.named("nest")]
        assert len({item.category.name for item in items}) == 1
        assert [item.scale[0] for item in items] == pytest.approx([0.8**i for i in range(len(items))])
        scene = build_scene(alike(scale_step=0.8, same_model=True), "target", seed)
        items = [scene.objects[name].item for name in scene.named("nest")]
        assert len({item.model for item in items}) == 1
        assert [item.scale[2] for item in items] == pytest.approx([0.8**i for i in range(len(items))])


def test_of_the_category_of_another() -> None:
    start = SINK.objects[0].start
    for seed in range(4):
        first = ObjectSpec("a", ("vegetable",), start, graspable=True)
        second = replace(first, name="b", same_category_as="a", scale=(1.0, 1.0, 0.9))
        task = replace(
            FRUITS,
            objects=(first, second),
            goal=StateIs("sink", "water_on"),
            stages=(Stage("levers", "on", "sink"),),
            instruction="{a} {a+b}",
            paraphrases=(),
        )
        scene = build_scene(task, "pretrain", seed)
        one, two = (scene.objects[name].item for name in "ab")
        assert one.category == two.category
        assert two.scale == (1.0, 1.0, 0.9)
        assert scene.words["a+b"].startswith("both ")


NOTHING: dict[str, Any] = {
    "goal": StateIs("sink", "water_on"),
    "stages": (Stage("levers", "on", "sink"),),
    "instruction": "-",
    "paraphrases": (),
}


def test_a_lid_is_that_of_its_own_saucepan() -> None:
    start = SINK.objects[0].start
    pan = ObjectSpec("pan", ("saucepan_with_lid",), start, scale=0.6)
    lid = ObjectSpec("lid", ("saucepan_lid",), start, part_of="pan")
    for seed in range(4):
        scene = build_scene(replace(FRUITS, objects=(pan, lid), **NOTHING), "pretrain", seed)
        one, two = (scene.objects[name].item for name in ("pan", "lid"))
        assert two == auxiliary(one)
        assert two.scale == (0.6, 0.6, 0.6)
    with pytest.raises(UserError, match="which has none"):
        build_scene(
            replace(FRUITS, objects=(replace(FRUIT, count=(1, 1)), replace(lid, part_of="fruit")), **NOTHING),
            "pretrain",
            0,
        )


@pytest.mark.parametrize(
    ("wanted", "message"),
    [
        (ObjectSpec("lid", ("saucepan_lid",), FRUIT.start, part_of="nobody"), "is not there before it"),
        (replace(FRUIT, count="{side_count}"), "a number is needed"),
        (replace(FRUIT, scale="{side_count}"), "a number is needed"),
        (replace(FRUIT, same_category_as="nobody"), "is not there before it"),
    ],
)
def test_wrong_declarations_say_what_is_wrong(wanted: ObjectSpec, message: str) -> None:
    task = replace(FRUITS, objects=(wanted,), choices=(Choice("side_count", {"many": {}}),))
    with pytest.raises(UserError, match=message):
        build_scene(task, "target", 0)


@pytest.mark.parametrize(
    "declared", [{"of": "stove"}, {"options": {"left": {"_knob": "left one"}}}, {"options": {"left": {}}}]
)
def test_the_value_of_a_choice_cannot_be_replaced_by_its_word(declared: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=r"'_knob'.*would replace the value.*Call it 'knob'"):
        Choice("_knob", **declared)
    assert Choice("knob", **declared).name == "knob"


def test_a_scene_with_nothing_to_do_is_a_mistake_of_the_declaration() -> None:
    task = replace(FRUITS, stages=(StagesWhen("n", {"3": (Stage("levers", "on", "sink"),)}),), choices=(CUBES,))
    drawn = {seed: build_scene(replace(task, stages=FRUITS.stages), "target", seed).choices["n"] for seed in SEEDS}
    assert set(drawn.values()) == {"2", "3"}
    for seed, count in drawn.items():
        if count == "2":
            with pytest.raises(UserError, match="leaves nothing to do"):
                build_scene(task, "target", seed)
        else:
            assert task.bound(build_scene(task, "target", seed)).stages


def test_goal_and_stages_may_be_functions_of_the_scene() -> None:
    def goal(scene: Scene) -> AllOf:
        return AllOf(*(ObjectOn(above, below) for below, above in pairs(scene)))

    def stages(scene: Scene) -> tuple[Stage, ...]:
        return tuple(Stage("pick_place", "place", below, object=above) for below, above in pairs(scene))

    def pairs(scene: Scene) -> list[tuple[str, str]]:
        names = scene.named("nest")
        return list(itertools.pairwise(names))

    task = replace(alike(scale_step=0.8), goal=goal, stages=stages)
    env = KitchenEnv(task, cameras=(), horizon=5)
    with pytest.raises(UserError, match="reset"):
        env.declaration  # noqa: B018
    seen = set()
    for seed in range(6):
        _, info = env.reset(seed=seed)
        told = env.declaration
        count = len(env.scene.named("nest"))
        assert [(s.object, s.target) for s in told.stages] == [(f"nest_{i + 1}", f"nest_{i}") for i in range(count - 1)]
        assert len(info["success_terms"]) == count - 1
        seen.add(count)
    env.close()
    assert seen == {2, 3}
    assert {(stage.skill, stage.verb) for stage in stages_of(task)} == {("pick_place", "place")}
    assert isinstance(goal_of(task), AllOf)
    assert can_demonstrate(task)


def test_readers_without_a_scene_see_all_that_may_come() -> None:
    from robocasa_lerobot.gallery.task_pages import page

    assert [stage.object for stage in stages_of(FRUITS)] == ["fruit_i"]
    assert [stage.object for stage in stages_of(TOOLS)] == ["knife", "peeler", ""]
    assert all(map(can_demonstrate, DRAWN.values()))
    text = "\n".join(page(replace(ICE, paraphrases=("a",))))
    for said in ("for each of `ice_cube`", "`ice_cube_i_inside_blender`", "{n} x ice cube", "place ice_cube_i"):
        assert said in text
    assert "all of one model" in "\n".join(page(alike(same_model=True)))


def test_lists() -> None:
    from robocasa_lerobot.envs.scene.words import listed, number_word, plural

    assert listed(["apple"]) == "the apple"
    assert listed(["apple", "pear"]) == "the apple and the pear"
    assert listed(["carrot", "carrot"]) == "both carrots"
    assert listed(["carrot"] * 3) == "all three carrots"
    assert listed(["knife", "pear", "knife"]) == "the two knives and the pear"
    assert listed(["a", "b", "c"]) == "the a, the b and the c"
    for word, several in (
        ("tomato", "tomatoes"),
        ("cherry", "cherries"),
        ("dish brush", "dish brushes"),
        ("glass", "glasses"),
        ("tacos", "tacos"),
        ("loaf", "loaves"),
        ("tray", "trays"),
    ):
        assert plural(word) == several
    assert number_word(12) == "12"


@pytest.mark.costly
def test_no_object_takes_the_last_category_of_one_that_is_drawn_later() -> None:
    """A tool in the drawer that was a bowl left SnackSorting none for the counter."""
    for name in task_names():
        task = get_task(name)
        drawn_freely = replace(task, choices=tuple(choice for choice in task.choices if not choice.of))
        for seed in range(40):
            rng = np.random.default_rng(seed)
            choices = draw_choices(rng, drawn_freely, {}, {}).values
            items: dict[str, Instance] = {}
            for number, wanted in enumerate(task.objects, start=1):
                later, free = task.objects[number:], not (wanted.repeats or wanted.part_of or wanted.same_category_as)
                for index in range(number_of(rng, wanted, choices)):
                    item = item_of(rng, wanted, index, "target", items, choices, later)
                    assert not free or item.category not in {other.category for other in items.values()}, name
                    items[name_of(wanted, index)] = item


def test_a_category_is_left_to_the_only_one_that_it_suits() -> None:
    start = OnCounter("counter")
    first, second = ObjectSpec("first", ("apple", "bowl"), start), ObjectSpec("second", ("bowl",), start)
    rng = np.random.default_rng(0)
    drawn = {
        later: {item_of(rng, first, 0, "target", {}, {}, later).category.name for _ in range(30)}
        for later in ((), (second,), (replace(second, repeats=True),))
    }
    assert list(drawn.values()) == [{"apple", "bowl"}, {"apple"}, {"apple", "bowl"}]
    # An object that only this category suits takes it, and the later one says what it misses.
    assert item_of(rng, second, 0, "target", {}, {}, (second,)).category.name == "bowl"
