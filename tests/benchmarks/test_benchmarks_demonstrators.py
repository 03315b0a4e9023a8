"""The demonstrators' benchmark: its arithmetic, and that it goes on where it was stopped."""

from __future__ import annotations

import importlib
import json
import time
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from robocasa_lerobot.benchmark.tasks import facts_of
from robocasa_lerobot.envs.tasks.registry import task_names

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(BENCHMARKS)
    return importlib.import_module("demonstrators")


def _trial(bench: ModuleType, task: str, split: str, seed: int, success: bool, steps: int = 200, **values: Any) -> Any:
    known = {"action_noise": 0.0, "varied": True, "wall_s": 2.0, "workers": 2, "commit": "abc", "false_terms": ()}
    reason = "" if success else f"the hand stayed {seed} cm away"
    return bench.Trial(
        **{**known, **values}, task=task, split=split, seed=seed, success=success, steps=steps, reason=reason
    )


def test_a_result_of_other_seeds_is_not_written_over(
    bench: ModuleType, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "kept.json"
    out.write_text(json.dumps({"settings": {"first_seed": 5, "action_noise": 0.0, "varied": True}}))
    before = out.read_bytes()
    words = ["--tasks", "OpenDrawer", "--trials", str(tmp_path / "t.jsonl"), "--out", str(out)]
    assert bench.main([*words, "--first-seed", "610000"]) == 2
    assert "first_seed: 5, now 610000" in capsys.readouterr().err
    assert bench.parse(words).first_seed == 5
    assert [path.name for path in tmp_path.iterdir()] == ["kept.json"]
    assert out.read_bytes() == before


def test_rates_times_and_reasons_are_counted(bench: ModuleType, tmp_path: Path) -> None:
    report = importlib.import_module("demonstrators_report")
    trials = [_trial(bench, "OpenDrawer", "target", seed, seed != 1) for seed in range(4)]
    trials += [_trial(bench, "OpenDrawer", "pretrain", seed, False) for seed in range(2)]
    tasks = report.summary(trials, {"OpenDrawer": True, "CloseDrawer": True, "OpenFridge": False})
    drawer = tasks["OpenDrawer"]
    assert (drawer["success_rate"], drawer["successes"], drawer["trials"]) == (0.5, 3, 6)
    assert drawer["low"] < 0.5 < drawer["high"]
    assert drawer["splits"]["target"]["success_rate"] == 0.75
    assert drawer["splits"]["pretrain"]["success_rate"] == 0.0
    assert drawer["seconds_median"] == 10.0
    assert drawer["times_human"] == round(10.0 / drawer["human_seconds"], 3)
    assert drawer["failures"] == {"the hand stayed # cm away": 3}
    assert drawer["failed_seeds"] == [["pretrain", 0], ["pretrain", 1], ["target", 1]]
    assert tasks["OpenFridge"] == {
        "demonstrator": False, "kind": "atomic", "success_rate": None, "successes": 0, "trials": 0,
        "human_seconds": facts_of("OpenFridge").human_seconds,
    }  # fmt: skip
    found = report.ratios(tasks)
    assert (
        found["mean_success"]
        == found["worst_task"]
        == found["mean_success_atomic"]
        == found["worst_task_atomic"]
        == 0.5
    )
    assert found["mean_success_composite"] is found["worst_task_composite"] is None
    assert found["mean_success_counting_missing_as_0"] == pytest.approx(0.5 / 3)
    assert found["tasks_with_demonstrator"] == pytest.approx(2 / 3)
    assert bench.per_hour(trials) == {"one_process": 900.0, "all_processes": 1800.0}
    assert drawer["failed_at"] == {"the hand stayed # cm away": 3}  # of trials that do not say their stages
    body = {"tasks": tasks, "ratios": found, "demonstrations_per_hour": bench.per_hour(trials)}
    assert "OpenDrawer" in report.text(body)
    assert "no demonstrator: OpenFridge" in report.text(body)
    report.draw(tasks, tmp_path / "rates.png")
    assert (tmp_path / "rates.png").stat().st_size > 10_000


def test_the_worst_tasks_are_told_where_they_fail(bench: ModuleType) -> None:
    report = importlib.import_module("demonstrators_report")
    first, second = ("doors open", 1, True, False), ("doors close", 2, False, False)
    trials = [_trial(bench, "OpenDrawer", "target", seed, False, stages=(first, second)) for seed in range(2)]
    trials += [_trial(bench, "OpenDrawer", "target", 2, False, stages=(first, (*second[:2], True, False)))]
    trials += [_trial(bench, "CloseDrawer", "target", 0, True, stages=(first, second))]
    tasks = report.summary(trials, dict.fromkeys(("OpenDrawer", "CloseDrawer"), True))
    assert report._worst_page({"tasks": tasks}) == [
        "",
        "## Where the worst 1 fail",
        "",
        "|task|first stage that was not done, and the reason|failures|",
        "|---|---|--:|",
        "|OpenDrawer|2 doors close: the hand stayed # cm away|2|",
        "|OpenDrawer|all stages done: the hand stayed # cm away|1|",
    ]
    assert report._worst_page({"tasks": {"CloseDrawer": tasks["CloseDrawer"]}}) == []


def test_finished_trials_are_kept_replaced_and_forgotten(
    bench: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file, out = tmp_path / "trials.jsonl", tmp_path / "result.json"
    made: list[tuple[Any, ...]] = []

    def run(jobs: list[Any], path: Path, workers: int) -> None:
        made.extend(jobs)
        with path.open("a") as stream:
            for task, split, seed, noise, varied in jobs:
                trial = _trial(bench, task, split, seed, True, action_noise=noise, varied=varied)
                stream.write(json.dumps(vars(trial)) + "\n")

    monkeypatch.setattr(bench, "run", run)
    monkeypatch.setattr(bench, "draw", lambda *_: None)
    options = ["--seeds", "2", "--trials", str(file), "--out", str(out)]
    assert bench.main(["--tasks", "OpenDrawer,CloseDrawer", *options]) == 0
    assert len(made) == 8
    assert {seed for _, _, seed, _, _ in made} == {bench.FIRST_SEED, bench.FIRST_SEED + 1}
    file.write_text(file.read_text()[:-9])  # killed while it wrote the last line
    made.clear()
    bench._mend(file)
    bench.main(["--tasks", "OpenDrawer,CloseDrawer", *options])
    assert len(made) == 1
    made.clear()
    bench.main(["--tasks", "OpenDrawer", "--fresh", *options])
    seeds = (bench.FIRST_SEED, bench.FIRST_SEED + 1)
    assert sorted(made) == sorted(("OpenDrawer", s, n, 0.0, True) for s in bench.SPLITS for n in seeds)
    result = json.loads(out.read_text())
    assert result["trials"] == 8
    assert set(result["tasks"]) == set(task_names())
    assert result["tasks"]["CloseDrawer"]["success_rate"] == 1.0
    assert {"machine", "versions", "date", "ratios"} <= set(result)
    page = out.with_suffix(".md").read_text()
    assert "|CloseDrawer|4/4|100%|" in page
    assert "|OpenFridge|" not in page
    assert "Made at abc (8)." in page
    assert "(result.png)" in page
    made.clear()
    before = (kept := out.with_suffix(".trials.gz")).read_bytes()
    file.unlink()  # another checkout, which has the result alone
    bench.main(["--tasks", "OpenDrawer,CloseDrawer", *options])
    assert made == []
    assert json.loads(out.read_text())["trials"] == 8
    assert kept.read_bytes() == before


def test_trials_are_made_again_where_their_skills_or_declaration_changed(
    bench: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sources = importlib.import_module("demonstrators_sources")
    press, open_drawer = (sources.sources_of(task) for task in ("TurnOnMicrowave", "OpenDrawer"))
    assert press != open_drawer
    bare = "def f(x):\n    'Says nothing.'\n    return x  # so\n"
    assert sources._bare(bare) == sources._bare("def f(x): return x")
    assert sources._bare(bare) != sources._bare("def f(x): return -x")
    own = sources._code
    changed = "robocasa_lerobot.demos.skills.drawers"
    monkeypatch.setattr(sources, "_code", lambda module: own(module) + "pass" * (module == changed))
    sources.sources_of.cache_clear()
    assert sources.sources_of("OpenDrawer") != open_drawer
    assert sources.sources_of("TurnOnMicrowave") == press  # it opens no drawer

    file, out, made = tmp_path / "trials.jsonl", tmp_path / "result.json", []
    monkeypatch.setattr(bench, "run", lambda jobs, path, workers: made.extend(jobs))
    monkeypatch.setattr(bench, "draw", lambda *_: None)
    tasks = {"TurnOnMicrowave": press, "OpenDrawer": open_drawer}
    stages = (("a b", 2, True, False), ("c d", 1, False, False))
    old = [_trial(bench, n, "target", 7, True, sources=found, stages=stages) for n, found in tasks.items()]
    file.write_text(bench._lines([*old, _trial(bench, "CloseDrawer", "target", 7, True)]))
    options = ["--seeds=1", "--first-seed=7", "--splits=target", f"--trials={file}", f"--out={out}"]
    bench.main(["--tasks=TurnOnMicrowave,OpenDrawer,CloseDrawer", *options])
    assert [job[0] for job in made] == ["OpenDrawer"]
    result = json.loads(out.read_text())
    assert result["tasks"]["OpenDrawer"]["success_rate"] is None  # what an older skill did is no result of this one
    assert result["tasks"]["TurnOnMicrowave"]["stages"] == [
        {"stage": "a b", "reached": 1, "done": 1, "attempts_mean": 2},
        {"stage": "c d", "reached": 1, "done": 0, "attempts_mean": 1},
    ]
    assert "|TurnOnMicrowave|2|c d|0/1|1|" in out.with_suffix(".md").read_text()
    sources.sources_of.cache_clear()


@pytest.mark.parametrize("words", [["--report"], []])
def test_a_result_is_not_emptied_of_trials_that_count_no_more(
    bench: ModuleType,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    words: list[str],
) -> None:
    trials = [_trial(bench, "OpenDrawer", "target", seed, True) for seed in (7, 8)]
    file, out = tmp_path / "trials.jsonl", tmp_path / "result.json"
    file.write_text(bench._lines(trials))
    monkeypatch.setattr(bench, "draw", lambda *_: None)
    monkeypatch.setattr(bench, "run", lambda *_: None)  # killed before the first has ended
    options = ["--tasks=OpenDrawer", "--first-seed=7", "--splits=target", f"--trials={file}", f"--out={out}"]
    assert bench.main(["--report", *options]) == 0
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    monkeypatch.setattr(bench, "is_current", lambda trial: trial.seed == 8)
    assert bench.main([*words, *options]) == 2
    assert "has 2 trials, of which 1 would be left" in capsys.readouterr().err
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before
    out.unlink()  # where none is there, those that count are a result
    assert bench.main([*words, *options]) == 0
    assert json.loads(out.read_text())["trials"] == 1


def test_whatever_goes_wrong_is_a_failed_trial(bench: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    def hangs(*_: Any, **__: Any) -> None:
        time.sleep(5.0)

    def breaks(*_: Any, **__: Any) -> None:
        raise IndexError("list index out of range")

    monkeypatch.setattr(bench, "LONGEST_S", 1)
    for replacement, reason in ((hangs, "TimeoutError: no end after 1 s"), (breaks, "IndexError: list index")):
        monkeypatch.setattr(bench, "record_episode", replacement)
        trial = bench.attempt(("CloseDrawer", "target", 0, 0.0, True), 1, "abc")
        assert not trial.success
        assert trial.reason.startswith(reason)
        assert trial.wall_s < 4.0


def test_published_lengths_are_those_of_the_facts(shared: Path) -> None:
    lines = (shared / "facts" / "tasks.csv").read_text().splitlines()
    column = lines[0].split(",").index("human_episode_seconds")
    facts = {fields[0]: float(fields[column]) for fields in (line.split(",") for line in lines[1:])}
    assert {name: facts_of(name).human_seconds for name in facts} == facts
