"""Registries that recipes can fill: our kitchens, restricted to what can be demonstrated, and phases without data."""

from __future__ import annotations

import dataclasses
import itertools
import json
from pathlib import Path

import pytest
import yaml
from training_support import TINY

from robocasa_lerobot import cli
from robocasa_lerobot.benchmark.tasks import published_task_sets, task_facts
from robocasa_lerobot.data.fake import write_fake_dataset
from robocasa_lerobot.data.mixture_config import MixtureConfig, SelectionConfig
from robocasa_lerobot.data.registry.recipes import demonstrated_tasks
from robocasa_lerobot.data.registry.registry import (
    MissingDatasetsError,
    NothingRegisteredError,
    open_registry,
    registered_part,
    resolve_mixture,
    select_datasets,
)
from robocasa_lerobot.data.registry.registry_file import load_registry
from robocasa_lerobot.demos.attempts import MAX_ATTEMPTS_PER_EPISODE
from robocasa_lerobot.demos.demonstrator import can_demonstrate
from robocasa_lerobot.envs.tasks.registry import get_task, task_names
from robocasa_lerobot.envs.tasks.typical import stages_of
from robocasa_lerobot.errors import UnknownNameError, UserError
from robocasa_lerobot.training.config.experiment import load_experiment
from robocasa_lerobot.training.planning.skipped import PARTIAL, PHASE
from robocasa_lerobot.training.planning.unavailable import runnable

EXPERIMENTS = Path(__file__).parents[2] / "configs/experiments"
KITCHENS = str(EXPERIMENTS / "parts/kitchens.yaml")
EVALUATION_SEEDS_END = 2**31  # as `evaluation.plan.trial_seed` says


def test_our_kitchens_have_the_benchmarks_sets_as_far_as_tasks_can_be_demonstrated() -> None:
    able = {name for name in task_names() if can_demonstrate(get_task(name))}
    assert demonstrated_tasks() == able
    registry = open_registry(KITCHENS)
    for name, tasks in published_task_sets().items():
        assert registry.task_sets[name] == tuple(task for task in tasks if task in able)
        assert registry.lacking(name) == (len(set(tasks) - able), len(tasks))
    for split, source, task_set in (
        ("pretrain", "human", "pretrain300"),
        ("pretrain", "mg", "mimicgen60"),
        ("pretrain", "mg_5x5", "diversity17"),
        ("pretrain", "mg_5x1", "diversity17"),
        ("target", "human", "target50"),
    ):
        entries = select_datasets(SelectionConfig(KITCHENS, split=split, source=source))
        assert {entry.task for entry in entries} == set(published_task_sets()[task_set]) & able
        assert len({entry.root for entry in entries}) == len(entries)


def test_recipes_have_seeds_of_their_own() -> None:
    config = load_registry(Path(KITCHENS))
    ranges = sorted(
        (dataset.make.seed, dataset.make.seed + 10_000 * MAX_ATTEMPTS_PER_EPISODE)  # 10,000: as many as are published
        for dataset in config.datasets
        if dataset.make is not None and dataset.make.redraw is None
    )
    assert ranges[0][0] >= EVALUATION_SEEDS_END
    assert all(end <= start for (_, end), (start, _) in itertools.pairwise(ranges))
    assert ranges[-1][1] < 2**32


def test_what_is_missing_of_our_kitchens_is_made_by_a_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)  # where nothing has been made yet
    config = MixtureConfig(select=[SelectionConfig(KITCHENS, task_set="atomic_seen", split="target", source="human")])
    with pytest.raises(MissingDatasetsError, match="data EXPERIMENT_FILE --make") as caught:
        resolve_mixture(config)
    assert len(caught.value.entries) == 18
    assert len(str(caught.value).splitlines()) == 2  # the same remedy for all


@pytest.mark.usefixtures("atomic_only")
def test_sets_of_which_nothing_is_there_have_no_stand_ins() -> None:
    nothing = SelectionConfig(KITCHENS, task_set="composite_seen", split="target", source="human")
    with pytest.raises(NothingRegisteredError, match="none of the 16 tasks of composite_seen"):
        select_datasets(nothing)
    assert registered_part(MixtureConfig(select=[nothing])) == (
        None,
        ["none of the 16 tasks of composite_seen is in this version yet."],
    )
    some = SelectionConfig(KITCHENS, task_set="target50", split="target", source="human", group="a")
    gone = dataclasses.replace(nothing, group="b")
    part, said = registered_part(MixtureConfig(select=[some, gone], shares={"a": 0.2, "b": 0.8}))
    assert part == MixtureConfig(select=[some], shares={"a": 0.2})
    assert said[0] == "18 of the 50 tasks of target50 are in this version."
    published = MixtureConfig(select=[SelectionConfig(task_set="composite_seen")])
    assert registered_part(published) == (published, [])


def test_registry_files_are_laid_over_others(tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text(yaml.safe_dump({"base": KITCHENS, "task_sets": {"mine": ["OpenDrawer"]}}))
    (tmp_path / "b.yaml").write_text(yaml.safe_dump({"base": ["a.yaml"], "episodes": {"human": 3}, "root": "x"}))
    registry = open_registry(str(tmp_path / "b.yaml"))
    assert registry.config.episodes == {"human": 3, "mg": 40, "target": 20}
    entries = registry.find(registry.task_sets["mine"], "pretrain", "human", "lerobot")
    assert [str(entry.root) for entry in entries] == ["x/pretrain/human/OpenDrawer"]
    (tmp_path / "a.yaml").write_text(yaml.safe_dump({"base": "b.yaml"}))
    with pytest.raises(UserError, match="its own base"):
        open_registry(str(tmp_path / "b.yaml"))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"only": "demonstrate"}, "Did you mean 'demonstrated'"),
        ({"datasets": [{"path": "a/{task}"}]}, "needs `tasks` or a `task_set`"),
        ({"datasets": [{"path": "a", "tasks": ["X"], "make": {}}]}, "put {task} into the path"),
        ({"datasets": [{"path": "{task}", "tasks": ["X"], "make": {"episodes": "humans"}}]}, "Did you mean 'human'"),
        ({"datasets": [{"path": "{task}", "tasks": ["X"], "make": {"sed": 1}}]}, "Did you mean 'seed'"),
        ({"datasets": [{"path": "{task}", "tasks": ["X"], "make": {"redraw": "y"}}]}, "go together"),
    ],
)
def test_mistakes_in_recipes_are_told(tmp_path: Path, content: dict[str, object], message: str) -> None:
    (tmp_path / "r.yaml").write_text(yaml.safe_dump({"episodes": {"human": 1}, **content}))
    with pytest.raises(UserError, match=message):
        open_registry(str(tmp_path / "r.yaml"))


def test_atomic_lifelong_phases_share_all_atomic_tasks_among_them() -> None:
    config = load_registry(EXPERIMENTS / "parts/lifelong_atomic.yaml")
    phases = [config.task_sets[f"lifelong_phase{number}"] for number in (1, 2, 3, 4)]
    assert sorted(task for tasks in phases for task in tasks) == sorted(published_task_sets()["lifelong_phase1"])
    skills = [{stage.skill for task in tasks for stage in stages_of(get_task(task))} for tasks in phases]
    assert skills[:2] == [{"doors", "drawers", "racks"}, {"buttons", "knobs", "levers"}]
    assert skills[2:] == [{"pick_place", "navigation"}, {"pick_place"}]


@pytest.mark.usefixtures("atomic_only")
def test_phases_without_tasks_are_left_out() -> None:
    experiment, said = runnable(load_experiment(EXPERIMENTS / "small/foundation.yaml"))
    assert [phase.name for phase in experiment.phases] == ["pretrain", "atomic_10", "atomic_30", "atomic_100"]
    assert [phase.init for phase in experiment.phases] == ["from_scratch", "pretrain", "pretrain", "pretrain"]
    assert [item.phase for item in said if item.kind == PHASE] == [
        f"composite_{kind}_{demos}" for kind in ("seen", "unseen") for demos in (10, 30, 100)
    ]
    partial = [item for item in said if item.kind == PARTIAL]
    assert [item.phase for item in partial] == ["pretrain"]
    assert "65 of the 300 tasks of pretrain300" in partial[0].reason
    published = load_experiment(EXPERIMENTS / "robocasa365/foundation.yaml")
    assert runnable(published) == (published, [])


def test_phases_of_which_some_tasks_are_there_run() -> None:
    able, sets = demonstrated_tasks(), published_task_sets()
    experiment = load_experiment(EXPERIMENTS / "small/lifelong.yaml")
    lacking = {phase.name: set(sets[f"lifelong_{phase.name}"]) - able for phase in experiment.phases}
    none = [name for name, tasks in lacking.items() if len(tasks) == len(sets[f"lifelong_{name}"])]
    kept, said = runnable(experiment)
    assert [phase.name for phase in kept.phases] == [name for name in lacking if name not in none]
    assert [item.phase for item in said if item.kind == PHASE] == none
    partial = {item.phase for item in said if item.kind == PARTIAL and "are in this version" in item.reason}
    assert partial == {name for name, tasks in lacking.items() if tasks and name not in none}


def _chain(tmp_path: Path, sets: list[str], **settings: dict[str, object]) -> Path:
    """An experiment of phases one after the other, on a registry that has the set `there` and benchmark sets."""
    if not (tmp_path / "data").exists():
        write_fake_dataset(tmp_path / "data", episodes=4, length=4, image_size=32, tasks=["OpenDrawer"])
    registry = {
        "root": str(tmp_path),
        "only": "demonstrated",
        "task_sets": {"there": ["OpenDrawer"]},
        "datasets": [{"path": "data", "tasks": ["OpenDrawer"]}],
    }
    (tmp_path / "registry.yaml").write_text(yaml.safe_dump(registry))
    phases = [
        {
            "name": f"p{number}",
            "mixture": {"select": [{"task_set": name}]},
            "statistics": "keep",
            **settings.get(f"p{number}", {}),
        }
        for number, name in enumerate(sets)
    ]
    content = {
        "name": "chain",
        "output_dir": str(tmp_path / "out"),
        "device": "cpu",
        "registry": str(tmp_path / "registry.yaml"),
        "policy": {"type": "diffusion_transformer", **TINY["diffusion_transformer"]},
        "defaults": {"steps": 1, "batch_size": 2, "log_every": 1, "warmup_steps": 1},
        "phases": phases,
    }
    (tmp_path / "chain.yaml").write_text(yaml.safe_dump(content))
    return tmp_path / "chain.yaml"


@pytest.mark.usefixtures("atomic_only")
def test_what_builds_on_a_left_out_phase_starts_from_the_last_one_that_runs(tmp_path: Path) -> None:
    gone = "composite_seen"
    replay = {
        "p3": {"replay": {"share": 0.2, "phases": ["p1"]}},
        "p4": {"replay": {"share": 0.2, "phases": ["p0", "p2"]}},
    }
    file = _chain(tmp_path, ["there", gone, gone, "there", "there"], **replay)
    experiment, said = runnable(load_experiment(file))
    assert [(p.name, p.init) for p in experiment.phases] == [("p0", None), ("p3", "p0"), ("p4", "p3")]
    assert [p.replay and p.replay.phases for p in experiment.phases] == [None, None, ["p0"]]
    assert [(item.kind, item.phase) for item in said] == [(PHASE, "p1"), (PHASE, "p2"), (PARTIAL, "p3")]
    assert "starts from phase p0, because p2 is left out" in said[-1].reason
    # A pretraining that is left out takes its fine-tuning with it: from scratch it would be another experiment.
    experiment, said = runnable(
        load_experiment(_chain(tmp_path, [gone, "there", "there"], p2={"init": "from_scratch"}))
    )
    assert [p.name for p in experiment.phases] == ["p2"]
    assert [(item.kind, item.phase) for item in said] == [(PHASE, "p0"), (PHASE, "p1")]
    with pytest.raises(UserError, match="no phase can run"):
        runnable(load_experiment(_chain(tmp_path, [gone, gone])))


@pytest.mark.usefixtures("atomic_only")
def test_training_says_what_it_leaves_out_and_records_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    file = _chain(tmp_path, ["there", "lifelong_phase3", "there"])
    assert cli.main(["train", "--config_path", str(file), "--plan", "--measure", "0"]) == 0
    planned = capsys.readouterr().out
    assert "p1 <- p0 (left out)" in planned
    assert "none of the 20 tasks of lifelong_phase3" in planned
    assert not (tmp_path / "out").exists()
    assert cli.main(["train", "--config_path", str(file)]) == 0
    assert "phase p1 is left out: none of the 20 tasks of lifelong_phase3" in capsys.readouterr().out
    lines = [json.loads(line) for line in (tmp_path / "out/skipped.jsonl").read_text().splitlines()]
    assert [(line["kind"], line["phase"]) for line in lines] == [("phase", "p1"), ("partial", "p2")]
    assert sorted(path.parent.name for path in (tmp_path / "out").glob("*/phase.json")) == ["p0", "p2"]
    assert json.loads((tmp_path / "out/p2/phase.json").read_text())["init"].startswith(str(tmp_path / "out/p0"))
    # The whole experiment is on record, so that the same command later takes up what is possible then.
    assert [phase.name for phase in load_experiment(tmp_path / "out/experiment.yaml").phases] == ["p0", "p1", "p2"]


def test_experiments_that_are_parts_of_others_share_their_folder(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    whole = _chain(tmp_path, ["there", "there", "there"], p1={"init": "p0"}, p2={"init": "p0"})
    part = tmp_path / "part.yaml"
    part.write_text(yaml.safe_dump({"base": str(whole), "without_phases": ["p1"]}))
    for phase in ("p0", "p1"):
        assert cli.main(["train", "--config_path", str(whole), "--phase", phase]) == 0
    for file in (part, whole, part):
        capsys.readouterr()
        assert cli.main(["train", "--config_path", str(file)]) == 0
        assert "phase p0: finished before" in capsys.readouterr().out
    assert {phase.name for phase in load_experiment(tmp_path / "out/experiment.yaml").phases} == {"p0", "p1", "p2"}
    assert cli.main(["train", "--config_path", str(whole), "--phases.p1.batch_size=1"]) == 2
    assert "phases.p1.batch_size: 2 -> 1" in capsys.readouterr().err


def test_unknown_sets_of_datasets_are_told(tmp_path: Path) -> None:
    (tmp_path / "r.yaml").write_text(yaml.safe_dump({"datasets": [{"path": "{task}", "task_set": "atomic_sen"}]}))
    with pytest.raises(UnknownNameError, match="Did you mean 'atomic_seen'"):
        select_datasets(SelectionConfig(str(tmp_path / "r.yaml"), tasks=["OpenDrawer"]))


def test_a_tenth_of_few_demonstrations_trains_without_any_held_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """10 % of two demonstrations is one, of which none can be held out; that must not end an experiment."""
    monkeypatch.chdir(tmp_path)
    mixture = {"select": [{"task_set": "there", "demos": "10%"}]}
    file = _chain(tmp_path, ["there"], p0={"held_out": {"share": 0.1}, "mixture": mixture})
    assert cli.main(["train", "--config_path", str(file)]) == 0
    assert not (tmp_path / "out/p0/held_out.jsonl").exists()
    card = (tmp_path / "out/p0/checkpoints/last/pretrained_model/README.md").read_text()
    assert "# chain: p0, step 1" in card
    assert "data (all tasks): 1 episodes" in card


@pytest.mark.parametrize("folder", ["robocasa365", "small"])
def test_sim_and_real_is_the_papers_protocol(folder: str) -> None:
    experiment = load_experiment(EXPERIMENTS / folder / "sim_and_real.yaml")
    assert [(p.name, experiment.init_of(p)) for p in experiment.phases] == [
        ("midtrain", "from_scratch"),
        ("cofinetune", "midtrain"),
    ]
    (middle,), (same,) = (phase.mixture.select for phase in experiment.phases)
    assert {middle.views, same.views} == {"lerobot_cotraining_cams"}
    sets = load_registry(Path(str(middle.registry))).task_sets
    assert (len(sets["best150"]), len(set(sets["best150"]))) == (150, 150)
    facts = {name: task_facts()[name] for name in published_task_sets()["pretrain300"]}
    composite = sorted((f.subtasks, f.human_seconds, name) for name, f in facts.items() if f.kind == "composite")
    best = {name for name, f in facts.items() if f.kind == "atomic"} | {name for *_, name in composite[:85]}
    assert set(sets["best150"]) == best
    real = [Path(member.root).name for member in experiment.phases[1].mixture.members]
    assert real == sets["real4"]
    entries = {entry.task for entry in select_datasets(same)}
    assert entries == set(real) - {"PlaceOnDishRack"}
    expected = best if folder == "robocasa365" else best & demonstrated_tasks()
    assert {entry.task for entry in select_datasets(middle)} == expected
