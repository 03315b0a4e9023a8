"""Uses of what is in the hand, as pouring and wiping, are cut out of demonstrations and carried over elsewhere."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest

from robocasa_lerobot import cli
from robocasa_lerobot.demos.attempts import RecordingSettings
from robocasa_lerobot.demos.generate.objects.use_segments import ShownUse, use_path
from robocasa_lerobot.demos.generate.settings import GenerationSettings
from robocasa_lerobot.demos.generate.sources.prepare import _Watcher, prepare_files
from robocasa_lerobot.demos.generate.sources.segments import PICK, USE, rest_step, use_frames
from robocasa_lerobot.demos.generate.sources.source import Piece, Source, sources_of
from robocasa_lerobot.demos.generate.sources.transform import inverse, yaw_pose
from robocasa_lerobot.demos.generate.sources.uses import USES, is_use, use_key, where_it_lay, working_point
from robocasa_lerobot.demos.generate.stage import can_generate
from robocasa_lerobot.demos.planning.collision import Held
from robocasa_lerobot.demos.recording import record_tasks
from robocasa_lerobot.demos.replay import Demonstration, replay
from robocasa_lerobot.demos.skills import SKILLS
from robocasa_lerobot.demos.skills.pick_place.graspable import Graspable, graspable
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.tasks.registry import get_task, task_names
from robocasa_lerobot.envs.tasks.typical import stages_of

TASKS = ("WipeTable", "TiltPan", "FillBlenderJug")  # about where it lay, let go; about itself, kept; under water
VERBS = ("wipe", "tilt", "hold")


def test_every_task_can_be_generated() -> None:
    names = task_names()
    assert len(names) == 365
    assert [name for name in names if not can_generate(get_task(name))] == []
    assert {("pick_place", verb) for verb in USES} <= set(SKILLS)


def _tasks_with_every_verb() -> list[str]:
    """Tasks that have a stage of every skill and verb among them, few of them."""
    verbs = {name: {(stage.skill, stage.verb) for stage in stages_of(get_task(name))} for name in task_names()}
    missing, chosen = set().union(*verbs.values()), []
    while missing:
        chosen.append(max(verbs, key=lambda name: len(verbs[name] & missing)))
        missing -= verbs[chosen[-1]]
    return chosen


@pytest.mark.costly
def test_a_step_of_every_verb_can_be_noted() -> None:
    """Buttons are pressed and knobs turned, too: nothing is in the hand there that could be used."""
    for name in _tasks_with_every_verb():
        env = KitchenEnv(name, split="pretrain", cameras=(), terminate_on_success=False)
        env.reset(seed=100_000)
        watcher = _Watcher(env, Demonstration(name, {}, np.zeros((1, 1)), np.zeros((1, 12))))
        watcher.before()
        watcher.after(-1.0)
        found = watcher.prepared()
        uses = {use_key(number) for number, stage in enumerate(env.declaration.stages) if is_use(stage)}
        assert found.working_points.keys() == uses, name
        assert {key for key in found.poses if key.startswith("use.")} <= uses, name
        env.close()


def test_the_point_that_counts_is_the_lowest_or_over_the_middle_under_water() -> None:
    cube = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-2.0, 2.0) for z in (-3.0, 3.0)])
    obj = Graspable("cube", "the cube", (), cube, None, frozenset())
    np.testing.assert_allclose(working_point(obj, "wipe", np.eye(3)), [0.0, 0.0, -3.0])
    np.testing.assert_allclose(working_point(obj, "hold", np.eye(3)), [0.0, 0.0, 3.0])
    tipped = yaw_pose(0.0, 0.0, 0.3)[:3, :3] @ np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
    np.testing.assert_allclose(working_point(obj, "pour", tipped), [0.0, 2.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(tipped @ working_point(obj, "rinse", tipped), [0.0, 0.0, 2.0], atol=1e-12)


def test_where_an_object_lay_is_upright() -> None:
    pose = yaw_pose(1.0, 2.0, 0.7, 0.95) @ np.array(
        [[1.0, 0.0, 0.0, 0.0], [0.0, 0.9, -0.1, 0.0], [0.0, 0.1, 0.9, 0.0], [0.0, 0.0, 0.0, 1.0]]
    )
    np.testing.assert_allclose(where_it_lay(pose, 0.9), yaw_pose(1.0, 2.0, 0.7, 0.9), atol=1e-12)


@pytest.fixture(scope="module")
def sources(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("sources")
    record_tasks([RecordingSettings(task, 1, split="pretrain", seed=100_000) for task in TASKS], out)
    assert not any(outcome.dropped for outcome in prepare_files([out]))
    return out


def _use_of(folder: Path, task: str) -> tuple[Source, Piece]:
    source = sources_of(folder, task)[0]
    (segment,) = (one for one in source.segments if one.kind == USE)
    return source, Piece(source, segment)


@pytest.mark.slow
@pytest.mark.parametrize(("task", "verb"), zip(TASKS, VERBS, strict=True))
def test_a_use_is_cut_from_where_it_comes_near(sources: Path, task: str, verb: str) -> None:
    source, piece = _use_of(sources, task)
    segment, data = piece.segment, source.data
    assert piece.words["verb"] == verb
    before = [one for one in source.segments if one.contact < segment.contact]
    assert [one.kind for one in before if one.ref == segment.ref] == [PICK]
    assert segment.begin <= segment.lead <= segment.contact < segment.release <= segment.end
    assert before[-1].end <= segment.lead
    lay = rest_step(source.segments, segment.ref, segment.contact)
    away = data.poses[segment.ref][:, :3, 3] - use_frames(data, segment.stage, lay)[:, :3, 3]
    path = np.linalg.norm(away, axis=1)
    assert path[segment.contact : segment.release].max() < path[segment.contact : segment.release].min() + 0.121
    assert (data.gripper[segment.contact : segment.release] > 0).all()
    assert (data.gripper[segment.release : segment.end] < 0).any() == (verb == "wipe")


@pytest.mark.slow
@pytest.mark.parametrize("task", TASKS)
def test_a_use_in_its_own_scene_is_the_sources_own(sources: Path, task: str) -> None:
    """With the object as it was held there, and no turn, it passes through the same poses."""
    source, piece = _use_of(sources, task)
    segment, data = piece.segment, source.data
    env = GenerationSettings(task, 1, split="pretrain", varied=False, source=str(sources)).make_env()
    env.reset(seed=source.seed)
    obj, stage = graspable(env, segment.ref), env.declaration.stages[segment.stage]
    lay = rest_step(source.segments, segment.ref, segment.contact)
    frames = use_frames(data, segment.stage, lay)
    assert np.ptp(frames, axis=0).max() < 0.01  # nothing pushes it about
    in_hand = inverse(data.eef[segment.lead]) @ data.poses[segment.ref][segment.lead]
    held = Held(obj.name, in_hand[:3, 3], in_hand[:3, :3])
    path = use_path(stage, obj, held, frames[0], ShownUse.of(piece), np.eye(3), 0.0, 0.0)
    env.close()
    point = working_point(obj, stage.verb, data.poses[segment.ref][segment.release - 1][:3, :3])
    kept = data.working_points[use_key(segment.stage)][segment.release - 1]
    np.testing.assert_allclose(point, kept, atol=1e-3)
    for step in range(segment.lead, segment.release):
        pose = path.hand(step) @ in_hand
        there = data.poses[segment.ref][step]
        np.testing.assert_allclose(pose[:3, :3], there[:3, :3], atol=1e-9)
        moved = frames[step][:3, 3] - frames[0][:3, 3]
        np.testing.assert_allclose(pose[:3, 3] + moved, there[:3, 3], atol=2e-3)


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_uses_are_generated_and_replay(sources: Path, tmp_path: Path) -> None:
    for task in TASKS:
        words = f"generate --source {sources} --tasks {task} --episodes 1 --split pretrain --seed 100500 --workers 1"
        assert cli.main([*words.split(), "--out", str(tmp_path)]) == 0
        found = replay(tmp_path / f"{task}.hdf5", "demo_0")
        assert found.actions
        assert found.deviation == 0.0
        with h5py.File(tmp_path / f"{task}.hdf5") as file:
            assert '"kind": "use"' in str(file["data/demo_0"].attrs["ep_meta"])


@pytest.mark.slow
def test_a_lever_that_comes_up_by_itself_is_waited_for(tmp_path: Path) -> None:
    """The stage of GetToastedBread ends when the toaster has popped up, that of its source when its lever is down."""
    folder, common = tmp_path / "sources", ["--episodes", "1", "--split", "pretrain"]
    tasks = "TurnOnToaster,PickPlaceToasterToCounter"
    assert cli.main(["demos", "--tasks", tasks, *common, "--seed", "100000", "--out", str(folder)]) == 0
    assert cli.main(["prepare", str(folder)]) == 0
    made = ["generate", "--source", str(folder), "--tasks", "GetToastedBread", "--out", str(tmp_path / "made")]
    assert cli.main([*made, *common, "--seed", "200000"]) == 0
    assert (tmp_path / "made" / "GetToastedBread.hdf5").is_file()
