"""MimicGen's own way: its templates, where subtasks end, how they are chosen and carried over, and files."""

from __future__ import annotations

import json
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from robocasa_lerobot import cli
from robocasa_lerobot.demos.generate.mimicgen.refs import name_here
from robocasa_lerobot.demos.generate.mimicgen.subtasks import (
    DatagenInfo,
    boundaries,
    carried,
    datagen_of,
    read_datagen,
    selected,
    with_offsets,
    write_datagen,
)
from robocasa_lerobot.demos.generate.mimicgen.template import (
    INTERPOLATION,
    OBJECT,
    RANDOM,
    ROBOT,
    Subtask,
    Template,
    derived_template,
    read_json_template,
    template_from,
)
from robocasa_lerobot.demos.generate.select import pose_distance
from robocasa_lerobot.demos.generate.settings import GenerationSettings
from robocasa_lerobot.demos.generate.sources.prepare import prepare_files
from robocasa_lerobot.demos.generate.sources.prepared import (
    GROUP,
    HAND_IN_SITE,
    Prepared,
    read_prepared,
    write_prepared,
)
from robocasa_lerobot.demos.generate.sources.segments import cut, signals_of
from robocasa_lerobot.demos.generate.sources.source import sources_of
from robocasa_lerobot.demos.generate.sources.transform import inverse, yaw_pose
from robocasa_lerobot.demos.motion import Array, hand_rotation
from robocasa_lerobot.demos.motion_style import PLAIN
from robocasa_lerobot.demos.recording import RecordingSettings, record_tasks
from robocasa_lerobot.demos.replay import replay
from robocasa_lerobot.demos.skills.common import SkillError
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.tasks.registry import task_names
from robocasa_lerobot.errors import UserError

STACK: dict[str, Any] = {
    "name": "stack",
    "type": "robosuite",
    "experiment": {"generation": {"select_src_per_subtask": True, "transform_first_robot_pose": False}},
    "task": {
        "task_spec": {
            "subtask_1": {
                "object_ref": "cube",
                "subtask_term_signal": "grasp",
                "subtask_term_offset_range": [2, 4],
                "selection_strategy": OBJECT,
                "selection_strategy_kwargs": {"nn_k": 2},
                "action_noise": 0.05,
                "num_interpolation_steps": 5,
            },
            "subtask_2": {"object_ref": "bin", "subtask_term_signal": None, "selection_strategy": RANDOM},
        }
    },
}
STEPS, GRASP = 20, 8


def still(pose: Array) -> Array:
    """The same at every step."""
    return np.repeat(pose[None], STEPS, axis=0)


def info(number: int, at: float) -> DatagenInfo:
    """A demonstration along x whose cube lies at `at`, and is grasped."""
    path = np.array([yaw_pose(0.1 * step, 0.0, 0.0, 1.0) for step in range(STEPS)])
    steps = np.arange(STEPS)
    return DatagenInfo(
        number,
        f"demo_{number}",
        eef=path,
        target=path @ yaw_pose(0.05, 0.0, 0.1),
        gripper=np.where(steps < GRASP, -1.0, 1.0),
        objects={"cube": still(yaw_pose(at, 0.0, 0.3)), "bin": still(yaw_pose(1.0, 1.0, 0.0))},
        signals={"grasp": (steps >= GRASP).astype(np.int64)},
    )


def written(path: Path, seeds: list[int]) -> Path:
    """A file that MimicGen might have prepared, with a demonstration of each seed."""
    with h5py.File(path, "w") as file:
        for number, seed in enumerate(seeds):
            demo = file.create_group(f"data/demo_{number}")
            demo.attrs["seed"] = seed
            write_datagen(demo.create_group(GROUP), info(number, 0.8), "Stack")
    return path


def opened(
    path: Path, *touches: slice, pose: Array | None = None, yaws: Array | float = 0.0, name: str = "drawer.box"
) -> Path:
    """A file as `prepare` writes it, with one demonstration in which a drawer is touched and moved so often."""
    still_there, touched = still(np.eye(4) if pose is None else pose), np.zeros(STEPS, np.int64)
    for steps in touches:
        touched[steps] = 1
    words = {"skill": "drawers", "verb": "open", "parts": [name], "thing": "", "place": "drawer"}
    found = Prepared(
        eef=still_there,
        target=still_there,
        gripper=-np.ones(STEPS),
        base=np.column_stack([np.zeros((STEPS, 2)), np.broadcast_to(yaws, STEPS)]),
        stage=np.zeros(STEPS, np.int64),
        gap=np.zeros(STEPS),
        poses={name: still_there},
        joints={name: np.linspace(0.0, 1.0, STEPS)},
        touching={name: touched},
        contact_points={name: np.zeros((STEPS, 3))},
        undersides={},
        working_points={},
        about={"stages": [words], "parts": {name: {"range": [0, 1]}}},
    )
    with h5py.File(path, "w") as file:
        demo = file.create_group("data/demo_0")
        file["data"].attrs["env"] = path.stem if path.stem in task_names() else "OpenDrawer"
        write_prepared(demo, found, signals_of(cut(found), STEPS))
    return path


def settings_of(path: Path, **values: Any) -> GenerationSettings:
    given: dict[str, Any] = {
        "task": "OpenDrawer",
        "episodes": 1,
        "split": "pretrain",
        "seed": 100,
        "method": "mimicgen",
    }
    return GenerationSettings.of(path, **(given | values))


def test_a_templates_sources_are_the_first_ones_and_not_of_the_attempts_own_scenes(tmp_path: Path) -> None:
    path, template = written(tmp_path / "stack.hdf5", [5, 6, 7]), json.dumps(STACK)
    first = settings_of(path, template=template, first_sources=2)
    assert [one.seed for one in first.subtasks().infos] == [5, 6]
    with pytest.raises(UserError, match=r"sources come from seeds \[7\]"):
        settings_of(path, template=template, seed=7)
    settings_of(path, template=template, seed=7, first_sources=2)


def test_subtasks_are_derived_by_the_rules_that_are_given(tmp_path: Path) -> None:
    path = opened(tmp_path / "OpenDrawer.hdf5", slice(2, 6), slice(12, 18))
    whole, apart = (settings_of(path, rules=rules).subtasks() for rules in ("{}", '{"drawers open": {"gap_steps": 2}}'))
    assert [len(one.template.subtasks) for one in (whole, apart)] == [1, 2]
    assert boundaries(apart.infos[0], apart.template) == [7, STEPS]  # where the first touch has ended
    with pytest.raises(UserError, match=r"no subtasks to carry over\. Choose another --method"):
        settings_of(opened(tmp_path / "none.hdf5"))


def test_a_part_is_the_scenes_own_whatever_the_source_calls_its(tmp_path: Path) -> None:
    for number, name in enumerate(("stove.knob_rear_left", "stove.knob_front_left")):
        opened(tmp_path / f"{number}.hdf5", slice(2, 6), name=name)
    sources = [one for number in range(2) for one in sources_of(tmp_path / f"{number}.hdf5", "OpenDrawer")]
    template, alike = derived_template(sources)
    assert [subtask.object_ref for subtask in template.subtasks] == ["stage0.part0"]
    assert len(alike) == 2
    assert all("stage0.part0" in datagen_of(0, source).objects for source in alike)
    env = KitchenEnv("TurnOnStove", cameras=())
    try:
        called = {}
        for seed in range(12):
            env.reset(seed=seed)
            called[name_here(env, "stage0.part0")] = env.scene.fill("stove.{knob}")
        assert len(called) > 1
        assert all(wanted.removeprefix("stove.") in name for name, wanted in called.items())
        assert name_here(env, "stage0.place") == name_here(env, "stove") == "stove"
        with pytest.raises(SkillError, match="has 1 of the parts"):
            name_here(env, "stage0.part1")
    finally:
        env.close()


def test_whole_subtasks_come_from_demonstrations_of_the_same_task(tmp_path: Path) -> None:
    opened(tmp_path / "CloseDrawer.hdf5", slice(2, 6))
    with pytest.raises(UserError, match="no sources of OpenDrawer, but of CloseDrawer"):
        settings_of(tmp_path)


def test_a_template_says_what_it_says_and_the_rest_is_the_librarys() -> None:
    template = template_from(STACK)
    first, last = template.subtasks
    assert first == Subtask("cube", "grasp", (2, 4), OBJECT, 2, 0.05)
    assert (last.signal, last.offsets, last.interpolation_steps, last.action_noise) == (None, (0, 0), 5, 0.0)
    assert (template.per_subtask, template.first_pose, template.from_last_target) == (True, False, True)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"subtask_term_signal": None}, "every subtask but the last"),
        ({"selection_strategy": "nearest_neighbour_object"}, OBJECT),
        ({"subtask_term_offset_range": [4, 2]}, "two rising numbers"),
        ({"object_ref": None}, "at random"),
    ],
)
def test_what_a_template_cannot_say(tmp_path: Path, change: dict[str, Any], said: str) -> None:
    asked = json.loads(json.dumps(STACK))
    asked["task"]["task_spec"]["subtask_1"] |= change
    path = tmp_path / "stack.json"
    path.write_text(json.dumps(asked))
    with pytest.raises(UserError, match=said):
        read_json_template(path)
    path.write_text(json.dumps({"task": {"task_spec": {"stage_1": {}, "stage_2": {}}}}))
    with pytest.raises(UserError, match="RoboCasa"):
        read_json_template(path)
    for content in (b"{", b"\xff\xfe\x00"):
        path.write_bytes(content)
        with pytest.raises(UserError, match="JSON"):
            read_json_template(path)
    for wrong, text in (({"task": 5}, "no `task.task_spec`"), ({"task": {"task_spec": {"s": "x"}}}, "found 'x'")):
        path.write_text(json.dumps(wrong))
        with pytest.raises(UserError, match=text):
            read_json_template(path)
    path.write_text(json.dumps(STACK | {"experiment": None}))
    assert template_from(read_json_template(path)) == template_from(STACK | {"experiment": {}})


def test_subtasks_end_after_their_signal_and_put_off_by_what_is_drawn() -> None:
    template, source = template_from(STACK), info(0, 0.8)
    ends = boundaries(source, template)
    assert ends == [GRASP + 1, STEPS]  # the step in which it has risen belongs to it
    drawn = [with_offsets(ends, template, np.random.default_rng(seed)) for seed in range(40)]
    assert {first for first, _ in drawn} == {(0, 11), (0, 12), (0, 13)}
    assert all(last == (first[1], STEPS) for first, last in drawn)
    source.signals["lift"] = (np.arange(STEPS) > GRASP).astype(np.int64)  # just when the subtask before has ended
    three = Template((Subtask("cube", "grasp"), Subtask("cube", "lift"), Subtask("bin", None)))
    assert boundaries(source, three) == [GRASP + 1, GRASP + 2, STEPS]
    source.signals["grasp"][:] = 1
    with pytest.raises(UserError, match="does not rise"):
        boundaries(source, template)
    del source.signals["grasp"]
    with pytest.raises(UserError, match="grasp"):
        boundaries(source, template)


def test_the_nearest_sources_come_into_question() -> None:
    sources = [info(number, at) for number, at in enumerate((0.2, 0.9, 0.8, 0.3))]
    spans, now, hand = [(0, GRASP)] * 4, yaw_pose(0.85, 0.0, 0.3), np.eye(4)

    def drawn(selection: str, neighbours: int) -> set[int]:
        subtask = Subtask("cube", "grasp", selection=selection, neighbours=neighbours)
        return {selected(subtask, sources, spans, now, hand, np.random.default_rng(seed)) for seed in range(40)}

    assert drawn(OBJECT, 2) == {1, 2}
    assert drawn(OBJECT, 0) == {1, 2, 3}  # three, where nothing is said
    assert drawn(RANDOM, 0) == {0, 1, 2, 3}
    # The hand begins where it was in the source, less how far the cube lay from there: nearest for the nearest cube.
    assert drawn(ROBOT, 1) == drawn(INTERPOLATION, 0) <= {1, 2}


def test_a_subtask_is_carried_over_by_its_object() -> None:
    source, now = info(0, 0.8), yaw_pose(-1.0, 2.0, -0.7)
    subtask = Subtask("cube", "grasp")
    poses, gripper = carried(source, subtask, (2, 9), now, first=False)
    then = source.objects["cube"][2]
    np.testing.assert_allclose(inverse(now) @ poses, inverse(then) @ source.target[2:9], atol=1e-9)
    np.testing.assert_array_equal(gripper, source.gripper[2:9])
    led, commands = carried(source, subtask, (2, 9), now, first=True)
    np.testing.assert_allclose(inverse(now) @ led[0], inverse(then) @ source.eef[2], atol=1e-9)
    assert len(led) == len(commands) == 8
    alone, _ = carried(source, Subtask(None, "grasp"), (2, 9), None, first=False)
    np.testing.assert_array_equal(alone, source.target[2:9])


@pytest.mark.slow
def test_files_are_generated_as_published_and_with_a_template(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    task, sources = "PickPlaceCounterToSink", tmp_path / "sources"
    record_tasks([RecordingSettings(task, 10, split="pretrain", seed=100_000)], sources, show_progress=False)
    assert not any(outcome.dropped for outcome in prepare_files([sources]))
    found, alike = derived_template(sources_of(sources, task))
    assert [subtask.object_ref for subtask in found.subtasks] == ["stage0.object", "stage0.place"]
    assert len(alike) >= 2
    with h5py.File(sources / f"{task}.hdf5") as file:
        one = read_datagen(0, "one", file["data/demo_0"][GROUP])
    (signal,) = one.signals
    end, last = boundaries(datagen_of(0, alike[0]), found)
    assert 0 < end < last == len(one.eef)
    command = f"generate --source {sources} --tasks {task} --episodes 1 --split pretrain --seed 200500 --workers 1"
    assert cli.main([*command.split(), "--method", "mimicgen", "--out", str(tmp_path / "made")]) == 0
    made = tmp_path / "made" / f"{task}.hdf5"
    assert replay(made, "demo_0").actions
    with h5py.File(made) as file:
        group = file["data/demo_0"]
        segments = json.loads(group.attrs["ep_meta"])["generation"]["segments"]
        labels, base = group["src_demo_labels"][:, 0], group["actions"][:, 7:11]
    assert [row["ref"] for row in segments] == ["obj", "sink"]
    assert set(labels) <= {-1, *(row["demo"] for row in segments)}
    assert not base.any()
    spec = {"subtask_1": {"object_ref": "obj", "subtask_term_signal": signal}, "subtask_2": {"object_ref": "sink"}}
    path = tmp_path / "template.json"
    path.write_text(json.dumps({"task": {"task_spec": spec}}))
    more = [*command.split(), "--template", str(path), "--out", str(tmp_path / "more")]
    assert cli.main(more) == 2
    assert "--method mimicgen" in capsys.readouterr().err
    assert cli.main([*more, "--method", "mimicgen"]) == 0


def test_poses_in_files_have_the_grip_sites_axes_as_mimicgens_have(tmp_path: Path) -> None:
    env = KitchenEnv("CloseDrawer", cameras=())
    try:
        env.reset(seed=100)
        site = env.data.site(env.scene.robot.names.grip_site).xmat.reshape(3, 3)
        np.testing.assert_allclose(site @ HAND_IN_SITE[:3, :3], hand_rotation(env.data), atol=1e-9)
    finally:
        env.close()
    hand = yaw_pose(0.3, 0.2, 0.7)
    with h5py.File(opened(tmp_path / "OpenDrawer.hdf5", slice(2, 6), pose=hand)) as file:
        group = file["data/demo_0"][GROUP]
        np.testing.assert_allclose(group["eef_pose"][0] @ HAND_IN_SITE, hand, atol=1e-12)
        np.testing.assert_array_equal(read_prepared(group).eef[0], hand)


def test_a_templates_noise_has_clean_labels_beside_it(tmp_path: Path) -> None:
    """Two subtasks with noise, carried over beside the drawer that they should open: the attempt fails, labelled."""
    asked = json.loads(json.dumps(STACK))
    spec = asked["task"]["task_spec"]
    spec["subtask_1"] |= {"object_ref": "drawer", "selection_strategy": RANDOM, "selection_strategy_kwargs": None}
    spec["subtask_2"] |= {"object_ref": "drawer"}
    path = tmp_path / "OpenDrawer.hdf5"
    with h5py.File(path, "w") as file:
        demo = file.create_group("data/demo_0")
        demo.attrs["seed"] = 5
        one = info(0, 0.8)
        write_datagen(demo.create_group(GROUP), replace(one, objects={"drawer": one.objects["cube"]}), "Stack")
    settings = settings_of(path, template=json.dumps(asked))
    env = settings.make_env()
    try:
        recording = settings.record(env, 100)
    finally:
        env.close()
    clean, labels = recording.per_step["clean_action"], recording.per_step["src_demo_labels"][:, 0]
    assert clean.shape == recording.actions.shape
    away = np.abs(clean - recording.actions).max(axis=1)
    noisy = (labels >= 0) & (np.arange(len(labels)) < GRASP)
    assert away[noisy].min() > 1e-4
    assert away[labels < 0].max() < 1e-6  # lines between subtasks have none
    assert recording.ep_meta["motion_style"] == asdict(PLAIN), "the settings vary, but no subtask asks for a style"
    assert (recording.ep_meta["action_noise"], recording.ep_meta["subtask_noise"]) == (0.05, [0.05, 0.0])


def test_weights_of_a_template_count() -> None:
    asked = json.loads(json.dumps(STACK))
    chosen = asked["task"]["task_spec"]["subtask_1"]["selection_strategy_kwargs"]
    chosen |= {"pos_weight": 0.0, "rot_weight": 2.0}
    subtask = template_from(asked).subtasks[0]
    assert subtask.weights == (0.0, 2.0)
    here, there = yaw_pose(0.0, 0.0, 0.0), yaw_pose(3.0, 0.0, 0.4)
    assert pose_distance(here, there, subtask.weights) == pytest.approx(0.8)
    chosen["nn"] = 3
    with pytest.raises(UserError, match="nn_k"):
        template_from(asked)


def test_a_number_that_cannot_be_is_said_so(tmp_path: Path) -> None:
    path, template = written(tmp_path / "stack.hdf5", [5]), json.dumps(STACK)
    for values, said in (
        ({"cap": 20.0}, "--cap is 20"),
        ({"spread": -1.0}, "--spread"),
        ({"first_sources": -1}, "--first"),
    ):
        with pytest.raises(UserError, match=said):
            settings_of(path, template=template, **values)


def test_a_base_that_faces_west_does_not_turn_by_facing_it_from_the_other_side(tmp_path: Path) -> None:
    around = np.where(np.arange(STEPS) % 2, np.pi - 1e-6, -np.pi + 1e-6)
    paths = [opened(tmp_path / f"{name}.hdf5", slice(8, 14), yaws=yaws) for name, yaws in (("a", 0.0), ("b", around))]
    east, west = (sources_of(path, "OpenDrawer")[0].segments[0] for path in paths)
    assert west.lead == east.lead < west.contact
