"""Generation: sources are chosen as asked, their segments succeed in other kitchens, and files are what they say."""

from __future__ import annotations

import json
import random
import shutil
from collections import Counter
from pathlib import Path

import h5py
import numpy as np
import pytest
from cluster_work import hdf5_content
from killed_runs import run_killed

from robocasa_lerobot import cli, contract
from robocasa_lerobot.demos.attempts import RecordingSettings
from robocasa_lerobot.demos.generate.course import KINDS, source_costs
from robocasa_lerobot.demos.generate.fits import _turn_about
from robocasa_lerobot.demos.generate.objects.place_segments import lean_of
from robocasa_lerobot.demos.generate.part_segments import _as_from
from robocasa_lerobot.demos.generate.select import NEAREST, Manner, narrowed, pose_distance
from robocasa_lerobot.demos.generate.settings import GenerationSettings
from robocasa_lerobot.demos.generate.sources.frames import anchor, shares_of
from robocasa_lerobot.demos.generate.sources.prepare import prepare_files
from robocasa_lerobot.demos.generate.sources.rules import CutRules, read_rules, rules_for
from robocasa_lerobot.demos.generate.sources.source import digest_of, sources_of
from robocasa_lerobot.demos.generate.sources.transform import heading, inverse, make_pose, yaw_pose
from robocasa_lerobot.demos.motion import UP, rotation_about
from robocasa_lerobot.demos.recording import record_tasks
from robocasa_lerobot.demos.replay import read_demonstration, replay
from robocasa_lerobot.errors import UserError

TASK = "CloseDrawer"
BASE = contract.ACTION_SLICES["base_motion"]


def test_a_frame_lies_at_the_same_share_of_another_box() -> None:
    narrow, wide = np.array([[0.0, 0.0, 0.0], [0.4, 0.02, 0.6]]), np.array([[0.0, 0.0, 0.0], [0.8, 0.02, 0.6]])
    shares = shares_of(np.array([0.3, 0.02, 0.3]), narrow)
    np.testing.assert_allclose(anchor(wide, shares), [0.6, 0.02, 0.3])
    # A door that hangs on the other side reaches from its hinge to the left.
    left = np.array([[-0.8, 0.0, 0.0], [0.0, 0.02, 0.6]])
    np.testing.assert_allclose(anchor(left, shares, mirror=True), [-0.6, 0.02, 0.3])


def test_sources_are_selected_as_asked() -> None:
    places = {0: 0.9, 1: 0.1, 2: 0.2, 3: 0.3, 4: 0.8}
    options = [(number, way) for number in places for way in ("one", "other")]

    def chosen(select: str, seed: int) -> list[tuple[int, str]]:
        return narrowed(
            options,
            Manner(select=select),
            np.random.default_rng(seed),
            source=lambda option: option[0],
            object_change=lambda option: yaw_pose(places[option[0]], 0.0, 0.0),
            first_pose=lambda option: yaw_pose(1.0 - places[option[0]], 0.0, 0.0),
            hand=np.eye(4),
        )

    assert chosen("feasible", 0) == options
    for select, possible in (
        ("random", set(places)),
        ("nearest_object", {1, 2, 3}),
        ("nearest_robot", {0, 4, 3}),
    ):
        drawn = [chosen(select, seed) for seed in range(60)]
        assert all(len({number for number, _ in one}) == 1 for one in drawn)
        assert all(len(one) == 2 for one in drawn)  # what a source offers stays together
        assert {one[0][0] for one in drawn} == possible
        assert chosen(select, 5) == chosen(select, 5)
    assert NEAREST == 3


def test_sources_that_are_not_drawn_cost_more_and_all_are_drawn_alike() -> None:
    tasks = ["CloseDrawer"] * 6 + ["OpenDrawer"] * 10 + ["CloseDrawer"] * 4

    def drawn(seed: int, cap: float) -> set[int]:
        costs = source_costs(tasks, np.random.default_rng(seed), 0.3, cap)
        assert costs.min() >= 0.0
        return {number for number, cost in enumerate(costs) if cost <= 0.3}

    times = Counter(number for seed in range(600) for number in drawn(seed, 0.2))
    assert sum(times.values()) == 2400  # two of each task's ten
    assert set(times) == set(range(20))
    assert max(times.values()) < 160  # about 120 each
    assert all(Counter(tasks[number] for number in drawn(seed, 0.2)).most_common(1)[0][1] == 2 for seed in range(20))
    assert drawn(3, 1.0) == set(range(20))
    assert len(drawn(3, 0.01)) == 2
    later = source_costs(tasks, np.random.default_rng(3), 0.0, 0.2)
    assert sorted(Counter(np.round(later, 9)).values()) == [4] * 5  # each task's ten by twos, each dearer than before
    assert np.diff(np.unique(later))[1:] == pytest.approx(0.15)


def test_what_is_put_down_leans_to_the_same_side_of_the_robot() -> None:
    forwards = rotation_about(np.array([0.0, 1.0, 0.0]), 0.5)
    lay, turned = rotation_about(UP, 0.3), rotation_about(UP, 1.7)
    here = rotation_about(UP, -2.0)
    np.testing.assert_allclose(lean_of(lay, forwards @ lay, np.eye(3)), forwards, atol=1e-9)
    for turn in (np.eye(3), turned):  # however the object was turned on its way
        lean = lean_of(lay, forwards @ turn @ lay, here)
        np.testing.assert_allclose(lean @ UP, here @ forwards @ UP, atol=1e-9)
    assert heading(lean_of(lay, turned @ lay, here)) == pytest.approx(0.0, abs=1e-9)


def test_a_lever_is_held_where_it_points() -> None:
    axis = np.array([0.0, 0.0, 1.0])
    there, here = np.array([0.07, -0.02, 0.01]), np.array([0.02, -0.08, 0.03])
    turned = rotation_about(axis, _turn_about(axis, there, here)) @ there
    assert np.cross(turned[:2], here[:2]) == pytest.approx(0.0, abs=1e-12)
    assert turned[:2] @ here[:2] > 0


def test_poses_are_as_the_arm_sees_them_from_where_the_base_begins() -> None:
    begins, later = np.array([1.0, 2.0, 0.4]), np.array([1.3, 2.1, 0.9])
    pose = yaw_pose(2.0, 2.5, 1.0, 0.9)
    seen = inverse(yaw_pose(*later.tolist())) @ pose
    np.testing.assert_allclose(inverse(yaw_pose(*begins.tolist())) @ _as_from(later, begins) @ pose, seen, atol=1e-9)


def test_the_distance_of_poses_counts_metres_and_radians() -> None:
    assert pose_distance(yaw_pose(1.0, 2.0, 0.5), yaw_pose(1.0, 2.3, 0.9)) == pytest.approx(0.7)
    assert pose_distance(make_pose([0, 0, 1], np.eye(3)), np.eye(4)) == pytest.approx(1.0)


def test_rules_of_a_file_replace_what_is_derived(tmp_path: Path) -> None:
    path = tmp_path / "rules.yaml"
    path.write_text("drawers open: {near_m: 0.1, frame: handle}")
    rules = read_rules(path)
    assert rules_for(rules, {"skill": "drawers", "verb": "open"}) == CutRules(near_m=0.1, frame="handle")
    assert rules_for(rules, {"skill": "drawers", "verb": "close"}) == CutRules()
    path.write_text("drawers open:")
    assert read_rules(path) == {}
    for wrong, said in (
        ("drawers pen: {}", "drawers open"),
        ("drawers open: {nearm: 1}", "near_m"),
        ("drawers open: {gap_steps: few}", "should be a int"),
        ("drawers open: handle", "expected rules with their values"),
        ("drawers open: {frame: handel}", "handle"),
        ("- a", "should name"),
    ):
        path.write_text(wrong)
        with pytest.raises(UserError, match=said):
            read_rules(path)
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(UserError, match="cannot be read as YAML"):
        read_rules(path)


@pytest.fixture(scope="module")
def sources(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("sources")
    record_tasks([RecordingSettings(TASK, 2, split="pretrain", seed=100_000)], out, show_progress=False)
    with pytest.raises(UserError, match="prepare"):
        sources_of(out, TASK)
    assert not any(outcome.dropped for outcome in prepare_files([out]))
    whole, near = sources_of(out, TASK)[0], sources_of(out, TASK, '{"drawers close": {"near_m": 0.05}}')[0]
    assert near.segments[0].lead > whole.segments[0].lead
    return out


@pytest.mark.slow
def test_generated_files_replay_and_say_where_each_step_comes_from(sources: Path, tmp_path: Path) -> None:
    arguments = f"--source {sources} --tasks {TASK} --episodes 2 --split pretrain --seed 100500 --workers 1"
    assert cli.main(["generate", *arguments.split(), "--action-noise", "0.05", "--out", str(tmp_path / "one")]) == 0
    path = tmp_path / "one" / f"{TASK}.hdf5"
    for demo in ("demo_0", "demo_1"):
        found = replay(path, demo)
        assert found.actions
        assert found.states
        assert found.same_start
        assert found.deviation == 0.0  # nothing but its actions has moved anything
    with h5py.File(path) as file:
        for group in file["data"].values():
            steps = len(group["actions"])
            labels, kinds, at = group["src_demo_labels"][()], group["segment_kind"][()], group["src_step"][()]
            assert labels.shape == (steps, 1)
            assert kinds.shape == at.shape == (steps,)
            assert set(labels[:, 0]) <= {-1, 0, 1}
            assert KINDS[1] == "contact"
            of_source = labels[:, 0] >= 0
            assert (kinds == 1).any()
            assert of_source[kinds == 1].all()
            assert (at[of_source & (kinds != KINDS.index("bridge"))] >= 0).all()
            segments = json.loads(group.attrs["ep_meta"])["generation"]["segments"]
            assert group["src_demo_inds"][()].tolist() == [row["demo"] for row in segments]
            assert segments[-1]["kind"] == "part"
            assert segments[-1]["ref"] == "drawer.box"
    # The file follows from seeds and sources alone: attempts that another run had made before it was killed are kept.
    other = tmp_path / "two"
    values = {"task": TASK, "split": "pretrain", "seed": 100_500, "action_noise": 0.05, "varied": False}
    moved = shutil.copytree(sources, tmp_path / "moved")  # wherever they lie
    record_tasks([GenerationSettings.of(moved, episodes=1, **values)], other, show_progress=False)
    (other / f"{TASK}.hdf5").unlink()
    record_tasks([GenerationSettings.of(moved, episodes=2, **values)], other, show_progress=False)
    here, there = hdf5_content(path), hdf5_content(other / f"{TASK}.hdf5")
    assert here.keys() == there.keys()
    assert all(np.array_equal(value, there[key]) for key, value in here.items())


@pytest.mark.slow
@pytest.mark.parametrize(
    "options",
    [
        "--base copy",
        "--base fixed",
        "--bridge line",
        "--select random",
        "--select nearest_object",
        "--select nearest_robot",
    ],
)
def test_other_ways_of_choosing_standing_and_joining(sources: Path, tmp_path: Path, options: str) -> None:
    words = (
        f"generate --source {sources} --tasks {TASK} --episodes 1 --split pretrain --seed 100700 --workers 1 {options}"
    )
    assert cli.main([*words.split(), "--out", str(tmp_path)]) == 0
    path = tmp_path / f"{TASK}.hdf5"
    assert replay(path, "demo_0").actions
    with h5py.File(path) as file:
        kinds = file["data/demo_0/segment_kind"][()]
        drives = np.abs(contract.hdf5_to_stored(file["data/demo_0/actions"][()])[:, BASE]).any(axis=1)
    if options == "--base fixed":
        assert not (kinds == KINDS.index("drive")).any()
    assert not drives[kinds == KINDS.index("bridge")].any()


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_ten_kills_change_nothing(sources: Path, tmp_path: Path) -> None:
    words = (
        f"generate --source {sources} --tasks {TASK} --episodes 24 --split pretrain --seed 100600 --action-noise 0.05"
    )
    assert cli.main([*words.split(), "--workers", "2", "--out", str(tmp_path / "whole")]) == 0
    killed = tmp_path / "killed"
    assert run_killed(words.split(), killed, random.Random(0), at_least=10) >= 10
    here, there = (hdf5_content(place / f"{TASK}.hdf5") for place in (tmp_path / "whole", killed))
    assert list(here) == list(there)
    assert all(np.array_equal(value, there[key]) for key, value in here.items())
    assert [path.name for path in killed.iterdir()] == [f"{TASK}.hdf5"]


@pytest.mark.slow
def test_a_source_succeeds_in_its_own_scene(sources: Path) -> None:
    settings = GenerationSettings(TASK, 1, split="pretrain", varied=False, source=str(sources))
    for source in sources_of(sources, TASK):
        env = settings.make_env()
        recording = settings.record(env, source.seed)
        env.close()
        assert recording.success, recording.reason


@pytest.mark.slow
def test_replays_with_noise_repeat_each_source_in_its_own_scene(
    sources: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = f"generate --source {sources} --tasks {TASK} --episodes 4 --seed 100900 --workers 1 --method replay".split()
    assert cli.main([*words, "--split", "pretrain", "--out", str(tmp_path)]) == 2
    assert "--action-noise" in capsys.readouterr().err
    noise = ("--action-noise", "0.02")
    assert cli.main([*words, *noise, "--split", "target", "--out", str(tmp_path)]) == 2
    assert "split of one of them is pretrain" in capsys.readouterr().err
    assert cli.main([*words, *noise, "--split", "pretrain", "--out", str(tmp_path)]) == 0
    own = [read_demonstration(sources / f"{TASK}.hdf5", f"demo_{number}") for number in range(2)]
    path = tmp_path / f"{TASK}.hdf5"
    executed = []
    for number in range(4):
        made = read_demonstration(path, f"demo_{number}")
        with h5py.File(path) as file:
            group = file[f"data/demo_{number}"]
            source = own[int(group["src_demo_inds"][0])]
            wanted = contract.hdf5_to_stored(group[contract.CLEAN_ACTION][()])
        assert made.seed == source.seed
        np.testing.assert_array_equal(made.states[0], source.states[0])
        common = min(len(wanted), len(source.actions))
        np.testing.assert_allclose(wanted[:common], source.actions[:common], atol=1e-6)
        assert 0.0 < np.abs(made.actions[:common] - source.actions[:common]).std() < 0.03
        assert replay(path, f"demo_{number}").actions
        executed.append(made.actions.tobytes())
    assert len(set(executed)) == 4, "noise follows from the attempt, not from the scene"
    assert cli.main(["convert", str(path), "--out", str(tmp_path / "data"), "--image-size", "64"]) == 0
    assert cli.main(["verify", str(tmp_path / "data")]) == 0


def test_a_replay_has_the_style_of_its_source(tmp_path: Path) -> None:
    """Whose actions it repeats, whatever style an attempt of its own would have."""
    record_tasks([RecordingSettings(TASK, 1, varied=False)], tmp_path, show_progress=False)
    values = {"task": TASK, "episodes": 1, "split": "target", "seed": 100_900, "method": "replay"}
    settings = GenerationSettings.of(tmp_path, **values, action_noise=0.02)
    env = settings.make_env()
    recording = settings.record(env, 100_900)
    env.close()
    assert settings.varied
    assert recording.ep_meta["motion_style"]["speed"] == 1.0
    assert recording.ep_meta["action_noise"] == 0.02


@pytest.mark.slow
def test_a_composite_task_is_generated_from_sources_of_atomic_ones(tmp_path: Path) -> None:
    known = {"split": "pretrain", "seed": 100_000}
    atomic = ("PickPlaceCounterToStove", "TurnOnStove", "CloseDrawer")
    record_tasks([RecordingSettings(task, 2, **known) for task in atomic], tmp_path / "sources", show_progress=False)
    assert not any(outcome.dropped for outcome in prepare_files([tmp_path / "sources"]))
    arguments = f"--source {tmp_path / 'sources'} --tasks ButterOnPan --episodes 1 --split pretrain --seed 200500"
    assert cli.main(["generate", *arguments.split(), "--workers", "1", "--out", str(tmp_path / "made")]) == 0
    found = replay(tmp_path / "made" / "ButterOnPan.hdf5", "demo_0")
    assert found.actions
    with h5py.File(tmp_path / "made" / "ButterOnPan.hdf5") as file:
        segments = json.loads(file["data/demo_0"].attrs["ep_meta"])["generation"]["segments"]
    assert {row["source"].partition("/")[0] for row in segments} == set(atomic[:2])
    assert [row["kind"] for row in segments][:2] == ["pick", "place"]


@pytest.mark.slow
def test_nothing_is_generated_in_a_sources_own_scene(sources: Path) -> None:
    with pytest.raises(UserError, match="own scene"):
        GenerationSettings.of(sources, task=TASK, episodes=2, split="pretrain", seed=99_999)
    settings = GenerationSettings.of(sources, task=TASK, episodes=2, split="pretrain", seed=100_500)
    assert settings.identity()["sources"] == digest_of(sources_of(sources, TASK))
    assert "source" not in settings.identity()
