"""Reference policies in the kitchens: the engine's own sanity check."""

from __future__ import annotations

import dataclasses
import json
import math
from pathlib import Path
from types import SimpleNamespace

import h5py
import pytest
from task_selection import solvable

from robocasa_lerobot.demos.recording import RecordingSettings, record_task
from robocasa_lerobot.envs.tasks.registry import task_names
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.actors.reference_policies import ReplayPolicy
from robocasa_lerobot.evaluation.actors.stored_episodes import one_per_scene, read_episodes
from robocasa_lerobot.evaluation.config.evaluation import EvaluationConfig
from robocasa_lerobot.evaluation.config.loader import load_config
from robocasa_lerobot.evaluation.records.results import TrialRecord
from robocasa_lerobot.evaluation.run import engine

TABLE = Path(__file__).parents[2] / "benchmarks/results/demonstrators.json"


def evaluate(out: Path, *arguments: str) -> list[TrialRecord]:
    given = ["--videos=0", "--workers=2", f"--out={out}", *arguments]
    return engine.evaluate(engine.prepare(load_config(EvaluationConfig, given)))


@pytest.fixture(scope="module")
def demos(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("demos")
    settings = RecordingSettings("CloseDrawer", episodes=3, seed=5, action_noise=0.05)
    return record_task(settings, folder, show_progress=False).path


@pytest.mark.costly
def test_replayed_demonstrations_solve_their_scenes_and_zeros_do_not(demos: Path, tmp_path: Path) -> None:
    episodes = read_episodes(demos)
    records = evaluate(tmp_path / "out", f"--policy=replay:{demos},zero", "--env.tasks=CloseDrawer", "--trials=3")
    replayed = [r for r in records if r.label == "replay"]
    assert [r.seed for r in replayed] == [e.seed for e in episodes]
    assert [r.seed for r in records if r.label == "zero"] == [e.seed for e in episodes]
    assert [r.success for r in records] == [True] * 3 + [False] * 3
    for record, episode in zip(replayed, episodes, strict=True):
        # The recording goes on for 15 steps in which the goal holds; the trial ends at the first.
        assert record.steps == record.first_success_step == len(episode.actions) - 14
        assert set(record.seconds.__dict__.values()) != {0.0}
    with pytest.raises(UserError, match="3 episodes of CloseDrawer in target scenes, 4 trials"):
        evaluate(tmp_path / "more", f"--policy=replay:{demos}", "--env.tasks=CloseDrawer", "--trials=4")
    with pytest.raises(UserError, match="0 episodes of OpenDrawer"):
        evaluate(tmp_path / "other", f"--policy=replay:{demos}", "--env.tasks=OpenDrawer", "--trials=1")
    with pytest.raises(UserError, match="expected an HDF5"):
        evaluate(tmp_path / "none", "--policy=replay:nothing.hdf5", "--env.tasks=CloseDrawer")


def test_a_scene_is_replayed_once_by_its_first_episode(demos: Path, tmp_path: Path) -> None:
    file = tmp_path / "CloseDrawer.hdf5"
    file.write_bytes(demos.read_bytes())
    with h5py.File(file, "r+") as opened:
        data = opened["data"]
        for name in ("demo_3", "demo_4"):
            data.copy("demo_0", name)
            data[name]["actions"][:] = 0.0
        meta = json.loads(data["demo_4"].attrs["ep_meta"])
        data["demo_4"].attrs["ep_meta"] = json.dumps({**meta, "split": "pretrain"})
    first, *others = read_episodes(demos)
    same, elsewhere = read_episodes(file)[3:]
    scenes = one_per_scene([first, *others, same, elsewhere])
    assert list(scenes.values()) == [first, *others, elsewhere]
    config = load_config(EvaluationConfig, [f"--policy=replay:{file}", "--env.tasks=CloseDrawer", "--trials=3"])
    plan = engine.prepare(config).plan
    assert [spec.seed for spec in plan] == [e.seed for e in (first, *others)]
    with pytest.raises(UserError, match="3 episodes of CloseDrawer in target scenes, 4 trials"):
        engine.prepare(dataclasses.replace(config, trials=4))
    policy = ReplayPolicy(file)
    for split, episode in (("target", first), ("pretrain", elsewhere)):
        policy.reset(0, SimpleNamespace(task="CloseDrawer", split=split, scene=SimpleNamespace(seed=first.seed)))
        assert (policy.act({}, "") == episode.actions[0]).all()


def test_episodes_whose_robot_starts_elsewhere_are_refused(demos: Path, tmp_path: Path) -> None:
    file = tmp_path / "CloseDrawer.hdf5"
    file.write_bytes(demos.read_bytes())
    noises: list[dict[str, float]] = [{}, {"base_within_m": 1.5}]
    for noise in noises:
        with h5py.File(file, "r+") as opened:
            attributes = opened["data/demo_1"].attrs
            attributes["ep_meta"] = json.dumps({**json.loads(attributes["ep_meta"]), "initial_noise": noise})
        if not noise:
            assert len(read_episodes(file)) == 3
    with pytest.raises(UserError, match="demo_1: its ep_meta has initial_noise"):
        read_episodes(file)


@pytest.mark.slow
def test_a_converted_dataset_is_replayed_as_its_source_is(demos: Path, tmp_path: Path) -> None:
    from robocasa_lerobot.cli import main

    root = tmp_path / "dataset"
    assert main(["convert", str(demos), "--out", str(root), "--image-size", "32", "--workers", "1"]) == 0
    for ours, theirs in zip(read_episodes(root), read_episodes(demos), strict=True):
        assert (ours.task, ours.split, ours.seed) == (theirs.task, theirs.split, theirs.seed)
        assert (ours.actions == theirs.actions).all()
    records = evaluate(tmp_path / "out", f"--policy=replay:{root}", "--env.tasks=CloseDrawer", "--trials=3")
    assert all(r.success for r in records)


@pytest.mark.costly
def test_the_demonstrator_is_a_policy_of_the_engine(tmp_path: Path) -> None:
    records = evaluate(tmp_path / "out", "--policy=demonstrator", "--env.tasks=OpenDrawer,CloseDrawer", "--trials=3")
    assert [r.success for r in records] == [True] * 6
    assert [r.error for r in records] == [None] * 6
    for record in records:
        assert record.terms
        assert all(term.final for term in record.terms.values())


# Of every task this many trials: over 65 tasks 260, of which 2 % are 5.2.
_TRIALS = 4


@pytest.mark.slow
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("policy", ["zero", "random"])
def test_neither_doing_nothing_nor_anything_succeeds(policy: str, tmp_path: Path) -> None:
    names = task_names()
    records = evaluate(tmp_path / "out", f"--policy={policy}", f"--env.tasks={','.join(names)}", f"--trials={_TRIALS}")
    assert len(records) == _TRIALS * len(names)
    assert {record.error for record in records} == {None}
    by_luck = [record.task for record in records if record.success]
    assert len(by_luck) / len(records) < 0.02, by_luck


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_the_demonstrator_reaches_what_its_table_states(tmp_path: Path) -> None:
    """Over all tasks, within two standard errors of both samples together: by chance it fails once in forty."""
    table = json.loads(TABLE.read_text(encoding="utf-8"))["tasks"]
    stated = {name: row for name, row in table.items() if row["success_rate"] is not None}
    assert set(stated) == set(solvable())
    names = f"--env.tasks={','.join(stated)}"
    records = evaluate(tmp_path / "out", "--policy=demonstrator", names, f"--trials={_TRIALS}")
    expected = sum(_TRIALS * row["success_rate"] for row in stated.values())
    # Both samples vary: binomial variance of these trials, and of the table's, scaled to as many trials.
    variance = sum(
        row["success_rate"] * (1 - row["success_rate"]) * _TRIALS * (1 + _TRIALS / row["trials"])
        for row in stated.values()
    )
    reached = sum(record.success for record in records)
    assert reached >= expected - 2 * math.sqrt(variance), f"{reached} of {len(records)}, the table says {expected:.1f}"
