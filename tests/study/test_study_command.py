"""`robocasa-lerobot study`, as users type it."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

from robocasa_lerobot import cli
from robocasa_lerobot.config_files import configs_folder
from robocasa_lerobot.study import stored as files
from robocasa_lerobot.study.runs import StoppedError, configs_for, root_for, runs_of
from robocasa_lerobot.study.settings import load_study
from robocasa_lerobot.study.stored import ABOUT, is_stored, stored_folder
from robocasa_lerobot.training.config.experiment import load_experiment

TINY = ("--scale=tiny", "--seeds=1", "--measure=0")
STUDIES = {
    "study.yaml": "corrections=1,few=1,more=1,pretrain=1,target=1",
    "study_generation.yaml": "made=1,sources=1",
}  # demonstrations of each kind
PARTS = [(file, part) for file in STUDIES for part in load_study(configs_folder() / file).parts]


COMMAND = [sys.executable, "-m", "robocasa_lerobot.cli", "study"]


def study(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "HF_HUB_OFFLINE": "1"}
    return subprocess.run(
        [*COMMAND, *arguments], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )


def test_the_plan_tells_what_each_part_takes(tmp_path: Path) -> None:
    done = study(tmp_path, "--plan", "--measure=0", "multitask", "data_efficiency", "lifelong")
    assert done.returncode == 0, done.stderr
    lines = {line.split()[0]: line.split() for line in done.stdout.splitlines() if line and not line.startswith(" ")}
    assert lines["multitask"][1:3] == ["3", "7,200"]
    assert lines["data_efficiency"][1:3] == ["3", "1,700"]
    assert lines["lifelong"][1:3] == ["3", "300"], "most of its data are the second part's"
    assert lines["multitask"][4] == "?", "trainings were not measured"
    assert not (tmp_path / "datasets").exists()


@pytest.mark.slow
def test_the_plan_leaves_out_what_has_ended(tmp_path: Path) -> None:
    whole = load_study()
    for run in runs_of([whole.parts["multitask"]], tmp_path, configs_folder())[:2]:
        folder = stored_folder(tmp_path / "kept", run.experiment, run.seed)
        folder.mkdir(parents=True)
        steps = {phase.name: phase.steps for phase in run.config.phases}
        (folder / ABOUT).write_text(json.dumps({"scale": None, "episodes": None, "steps": steps, "device": "cpu"}))
    done = study(tmp_path, "--plan", "--measure=0", "--results=kept", "multitask")
    line = next(line.split() for line in done.stdout.splitlines() if line.startswith("multitask"))
    assert line[1] == "1"
    assert line[5] == "480", "its trials"
    started = tmp_path / "outputs" / "study" / "multitask" / "seed_2" / "multitask" / "evaluations"
    for name in ("study_target", "study_validation"):
        (started / name).mkdir(parents=True)
    (started / "study_target" / "finished").touch()
    (started / "study_validation" / "trials.jsonl").write_text("{}\n" * 100)
    done = study(tmp_path, "--plan", "--measure=0", "--results=kept", "multitask")
    line = next(line.split() for line in done.stdout.splitlines() if line.startswith("multitask"))
    assert line[5] == "140", "240 have ended there, and 100 of the others"


def test_a_misspelt_part_is_told(tmp_path: Path) -> None:
    done = study(tmp_path, "multitsk")
    assert done.returncode == 2
    assert "multitask" in done.stderr


def test_trials_differ_between_seeds_and_data_do_not(tmp_path: Path) -> None:
    whole = load_study()
    runs = runs_of([whole.parts["multitask"]], tmp_path, configs_folder())
    assert [run.name for run in runs] == ["multitask/seed_0", "multitask/seed_1", "multitask/seed_2"]
    first, second = (load_experiment(run.write_file()) for run in runs[:2])
    assert (first.seed, second.seed) == (0, 1)
    assert first.phases[0].mixture == second.phases[0].mixture
    assert [text.split()[-1] for text in second.phases[0].evaluations] == ["--seed=1", "--seed=1"]
    assert Path(second.output_dir) == tmp_path / "multitask" / "seed_1"


def test_parts_share_their_runs() -> None:
    parts = load_study().parts
    runs = runs_of([parts["recipes"], parts["quality"]], Path("r"), configs_folder())
    assert len({run.name for run in runs}) == len(runs)
    assert sum(run.experiment == "quality_varied" for run in runs) == 3


def test_on_a_gpu_every_experiment_has_the_larger_policy_and_pictures(tmp_path: Path) -> None:
    whole = load_study()
    configs = configs_for("cuda", whole, tmp_path)
    for run in runs_of(list(whole.parts.values()), tmp_path, configs):
        experiment = load_experiment(run.write_file())
        assert experiment.device == "cuda"
        small = load_experiment(configs_folder() / "experiments/study" / run.base.name)
        assert [phase.steps for phase in experiment.phases] == [phase.steps // 4 for phase in small.phases]
        assert [phase.batch_size for phase in experiment.phases] == [8 * phase.batch_size for phase in small.phases]
        registry = Path(str(experiment.registry))
        assert registry.is_relative_to(tmp_path)
        if run.experiment != "recipe_act":
            policy = experiment.policy
            assert "demo" not in str(policy), "the larger one"
            assert policy["image_size"][0] >= 128
    reference, *others = (
        load_experiment(configs / "experiments/study" / f"{name}.yaml").policy
        for name in ("quality_varied", "recipe_executed_8", "recipe_history_2")
    )
    changed = [{key for key in other if other[key] != reference[key]} for other in others]
    assert changed == [{"n_action_steps"}, {"n_obs_steps", "horizon"}], "and nothing else"
    text = (configs / whole.registry).read_text(encoding="utf-8")
    assert "image_size: 64" not in text
    assert "root: datasets/study_cuda" in text
    sizes = [
        load_experiment(configs / "experiments/study" / f"{name}.yaml").policy["image_size"]
        for name in ("quality_varied", "recipe_more_pixels")
    ]
    assert sizes == [[128, 128], [192, 192]]
    assert "study_gpu" not in (configs_folder() / "experiments/parts/study_policy.yaml").read_text(encoding="utf-8")


def test_a_trial_of_the_study_does_not_stand_for_it(tmp_path: Path) -> None:
    whole = load_study()
    parts = [whole.parts["multitask"]]
    asked, tried = (
        runs_of(parts, tmp_path, configs_folder(), *made)[0] for made in ((None, None), ("tiny", "pretrain=1"))
    )
    folder = stored_folder(tmp_path, tried.experiment, tried.seed)
    folder.mkdir(parents=True)
    steps = {phase.name: phase.steps for phase in tried.config.phases}
    assert steps["multitask"] < 100
    (folder / ABOUT).write_text(
        json.dumps({"scale": tried.scale, "episodes": tried.episodes, "steps": steps, "device": "cpu"})
    )
    assert is_stored(tried, tmp_path)
    assert not is_stored(asked, tmp_path)
    about = json.loads((folder / ABOUT).read_text())
    now = files._evaluations(tried.config.phases, set(steps))
    (folder / ABOUT).write_text(json.dumps({**about, "evaluations": now}))
    assert is_stored(tried, tmp_path)
    more = {phase: dict.fromkeys(own, "of more trials") for phase, own in now.items()}
    (folder / ABOUT).write_text(json.dumps({**about, "evaluations": more}))
    assert not is_stored(tried, tmp_path), "other evaluations are run"
    assert "--replace" in asked.commands(None)[0], "its data neither"
    roots = [root_for(whole, *case) for case in (("cpu", None), ("cpu", "tiny"), ("cuda", None))]
    assert [str(root) for root in roots] == ["outputs/study", "outputs/study_tiny", "outputs/study_cuda"]
    few = root_for(whole, "cpu", None, "few=1,pretrain=10")
    assert str(few) == "outputs/study_few-1-pretrain-10", "phases of ten demonstrations are not the study's"


def keep_a_run(results: Path, **changes: object) -> Path:
    """What is kept of the first run of `multitask`, made otherwise."""
    run = runs_of([load_study().parts["multitask"]], Path("unused"), configs_folder())[0]
    about = {"scale": None, "episodes": None, "device": "cpu", "steps": {"multitask": 1}, **changes}
    folder = stored_folder(results, run.experiment, run.seed)
    folder.mkdir(parents=True)
    (folder / ABOUT).write_text(json.dumps(about))
    return folder


@pytest.mark.parametrize(
    ("words", "kept", "told"),
    [
        (["--scale=tiny"], {}, "scale: None, now 'tiny'"),
        (["--episodes=pretrain=10"], {}, "episodes: None, now 'pretrain=10'"),
        (["--scale=tiny"], {"scale": "tiny", "device": "NVIDIA H200"}, "device: 'GPU', now 'CPU'"),
    ],
)
def test_kept_results_are_not_replaced_by_those_of_another_study(
    words: list[str],
    kept: dict[str, object],
    told: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    folder = keep_a_run(tmp_path / "kept", **kept)
    for part in ("multitask", "quality"):  # the page is of all parts
        assert cli.main(["study", part, "--results=kept", *words]) == 2
        said = capsys.readouterr().err
        assert told in said
        assert "Give another --results and --page" in said
    assert [path.name for path in folder.iterdir()] == [ABOUT]
    assert not (tmp_path / "datasets").exists(), "nothing was made"


def test_fewer_seeds_take_nothing_from_the_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """With all that is asked for kept, the command only writes the page."""
    whole = load_study()
    kept = tmp_path / "kept"
    for part, seeds in (("multitask", 1), ("quality", 3)):
        for run in runs_of([whole.parts[part]], tmp_path, configs_folder()):
            if run.seed < seeds:
                steps = {phase.name: phase.steps for phase in run.config.phases}
                keep_whole_run(stored_folder(kept, run.experiment, run.seed), steps)
    monkeypatch.chdir(tmp_path)
    assert cli.main(["study", "multitask", "--seeds=1", "--results=kept"]) == 0
    assert "==" not in capsys.readouterr().out, "nothing was run"
    page = (kept / "results.md").read_text(encoding="utf-8")
    assert "1 of 3 trainings" in page
    assert "15 of 15 trainings" in page, "those of the other part"
    parts = whole.shown_with(whole.chosen(["recipes"], seeds=2)).parts
    assert (parts["recipes"].seeds, parts["quality"].seeds) == (2, 3)


def keep_whole_run(folder: Path, steps: dict[str, int]) -> None:
    """A run of which all phases are kept, without trials."""
    folder.mkdir(parents=True)
    files._write_trials(folder / files.TRIALS, [])
    (folder / files.CURVES).write_text("phase,step,loss\n" + "".join(f"{phase},1,0.5\n" for phase in steps))
    about = {
        **{"scale": None, "episodes": None, "device": "cpu", "steps": steps, "commit": "c", "versions": {}},
        **{"machine": {"processor": "P", "cores": "2"}, "training_hours": 1.0, "trial_hours_of_one_process": 1.0},
    }
    (folder / ABOUT).write_text(json.dumps(about))


@pytest.mark.slow
@pytest.mark.parametrize(("number", "status"), [(signal.SIGTERM, 2), (signal.SIGKILL, -signal.SIGKILL)])
def test_nothing_goes_on_alone_when_the_study_ends(tmp_path: Path, number: signal.Signals, status: int) -> None:
    words = ("multitask", "--episodes=more=100", *TINY, "--seeds=2", "--at_once=2")
    with subprocess.Popen([*COMMAND, *words], cwd=tmp_path, stderr=subprocess.PIPE, text=True) as process:
        deadline = time.monotonic() + 120
        while not list(tmp_path.glob("datasets/study/.making/**/log.txt")):  # recordings have begun
            assert process.poll() is None
            assert time.monotonic() < deadline
            time.sleep(0.2)
        others = psutil.Process(process.pid).children(recursive=True)
        assert sum("study" in other.cmdline() for other in others) == 1, "the other training's"
        process.send_signal(number)
        assert process.wait(60) == status
        _, alive = psutil.wait_procs(others, timeout=60)
        assert not alive
        assert process.stderr is not None
        assert ("the same study goes on there" in process.stderr.read()) is (status == 2)


@pytest.mark.parametrize(
    ("statuses", "told"),
    [
        ([0, -signal.SIGABRT, 0, 0], ""),
        ([-signal.SIGSEGV] * 2, "status -11"),
        ([-signal.SIGKILL], "status -9"),
        ([2], "status 2"),
    ],
)
def test_a_command_that_crashed_is_tried_once_more(
    statuses: list[int], told: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = runs_of([load_study().parts["multitask"]], tmp_path, configs_folder(), "tiny")[0]
    left = [*statuses, 0, 0]
    monkeypatch.setattr("robocasa_lerobot.study.runs.run_command", lambda *words: left.pop(0))
    with pytest.raises(StoppedError, match=told) if told else contextlib.nullcontext():
        assert len(list(run.carry_out(1))) == 1
    assert len(left) == (3 if not told else 2)


def test_each_phase_is_a_command_of_its_own(tmp_path: Path) -> None:
    run = runs_of([load_study().parts["lifelong"]], tmp_path, configs_folder(), "tiny")[0]
    data, *trainings = run.commands(2)
    assert data[:2] == ["data", str(run.file)]
    assert [words[2] for words in trainings] == [f"--phase={phase.name}" for phase in run.config.phases]
    assert len(trainings) == 13
    assert all("--evaluate" in words and "--scale=tiny" in words for words in trainings)


@pytest.mark.slow
@pytest.mark.render
@pytest.mark.parametrize(("file", "part"), PARTS)
def test_a_part_runs_from_data_to_its_table(file: str, part: str, tmp_path: Path) -> None:
    path = configs_folder() / file
    words = (part, f"--config_path={path}", f"--episodes={STUDIES[file]}", *TINY)
    done = study(tmp_path, *words)
    assert done.returncode == 0, done.stderr[-3000:]
    whole = load_study(path)
    results = tmp_path / root_for(whole, "cpu", "tiny", STUDIES[file]) / "results"
    page = (results / "results.md").read_text(encoding="utf-8")
    assert "these numbers mean nothing" in page
    config = whole.parts[part]
    for experiment in config.experiments:
        about = json.loads((results / experiment / "seed_0/about.json").read_text(encoding="utf-8"))
        assert about["scale"]
        assert about["device"] == "cpu"
    for row in config.rows:
        assert f"|{row}|" in page, "every row has trials"
    again = study(tmp_path, *words)
    assert again.returncode == 0
    assert "==" not in again.stdout, "what has ended is not run again"
