"""Ours beside the published tables: which policy stands in which cell, and that none is lost or taken for another."""

from __future__ import annotations

import collections
import csv
import dataclasses
import fnmatch
import json
import re
from pathlib import Path
from typing import Any

import pytest
import synthetic_runs
import yaml

from robocasa_lerobot.benchmark import published
from robocasa_lerobot.benchmark.tasks import published_task_sets, task_facts
from robocasa_lerobot.cli import main
from robocasa_lerobot.evaluation.records.results import UNPERTURBED
from robocasa_lerobot.evaluation.report import places
from robocasa_lerobot.evaluation.report.gather import gather
from robocasa_lerobot.evaluation.report.places import named_experiments
from robocasa_lerobot.evaluation.report.policies import PolicyResult, ReportData
from robocasa_lerobot.evaluation.report.sections import beside_published, data_efficiency, kinds, lifelong
from robocasa_lerobot.training.config.experiment import load_experiment

CONFIGS = Path(__file__).parents[2] / "configs/experiments"
SPLITS = ("atomic", "composite_seen", "composite_unseen")


def expected_columns() -> dict[tuple[str, str], list[tuple[str, tuple[str, ...]]]]:
    """For each published column the experiment and phases whose trials belong there, written out by hand."""

    def split(experiment: str, share: int) -> tuple[str, tuple[str, ...]]:
        return experiment, tuple(f"{name}_{share}" for name in SPLITS)

    full, none = ("foundation",), ("target_only",)
    found: dict[tuple[str, str], list[tuple[str, tuple[str, ...]]]] = {
        ("foundation", "pretraining"): [(name, ("pretrain",)) for name in full],
        ("foundation", "target_30"): [split("target_only", 30)],
        ("foundation", "both_30"): [split("foundation", 30)],
        ("multi_task", "diffusion_policy"): [("multitask_diffusion_policy", ("multitask",))],
        ("multi_task", "pi0"): [("multitask_pi0", ("multitask",))],
        ("multi_task", "pi05"): [("multitask_pi05", ("multitask",))],
        ("multi_task", "gr00t"): [("multitask_gr00t", ("multitask",))],
        ("low_rank", "full"): [("multitask_gr00t", ("multitask",))],
        ("low_rank", "lora"): [("multitask_gr00t_lora", ("multitask",))],
        ("joint_cotraining", "gr00t"): [("joint_cotraining", ("joint",))],
    }
    for share in (10, 100):
        found["foundation", f"target_{share}"] = [split(name, share) for name in none]
        found["foundation", f"both_{share}"] = [split(name, share) for name in full]
        found["pretraining_composition", f"none_{share}"] = [split(name, share) for name in none]
        found["pretraining_composition", f"human300_mg60_{share}"] = [split(name, share) for name in full]
        for name in ("human50", "human300"):
            found["pretraining_composition", f"{name}_{share}"] = [split(f"composition_{name}", share)]
    return found


@pytest.fixture(scope="module")
def everything(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[dict[str, str]]]:
    """The runs of all experiment files of the benchmark, reported by the command, and the report's cells.

    `composition_none` and `composition_human300_mg60` are phases of other files: their runs are named twice.
    """
    folder = tmp_path_factory.mktemp("everything")
    names = sorted(path.stem for path in synthetic_runs.EXPERIMENTS.glob("*.yaml"))
    runs = [run for name in names for run in synthetic_runs.experiment(name, folder, count=2)]
    assert main(["report", *map(str, runs), "--out", str(folder / "report.html"), "--no-videos"]) == 0
    return folder, read_cells(folder / "report_tables.csv")


def read_cells(path: Path) -> list[dict[str, str]]:
    with path.open() as file:
        return list(csv.DictReader(file))


def percent_of(files: list[Path], tasks: set[str], perturbation: str = UNPERTURBED) -> float:
    """The mean over tasks, in percent, of the successes in trials.jsonl, read line by line."""
    found: dict[str, list[bool]] = collections.defaultdict(list)
    for file in files:
        for line in file.read_text().splitlines():
            values = json.loads(line)
            if values["kind"] == "trial" and values["task"] in tasks and values["perturbation"] == perturbation:
                found[values["task"]].append(values["success"])
    assert set(found) == tasks
    return 100 * sum(sum(own) / len(own) for own in found.values()) / len(found)


def tasks_of(row: str) -> set[str]:
    sets = published_task_sets()
    return set(sets["target50" if row == "average" else row])


def of(cells: list[dict[str, str]], table: str, row: str, column: str) -> dict[str, dict[str, str]]:
    """The policies in a cell by experiment."""
    own = [cell for cell in cells if (cell["table"], cell["row"], cell["column"]) == (table, row, column)]
    return {cell["experiment"]: cell for cell in own if cell["policy"]}


def test_every_number_of_ours_is_in_its_row_and_published_column(
    everything: tuple[Path, list[dict[str, str]]],
) -> None:
    folder, cells = everything
    seen = 0
    for (table, column), policies in expected_columns().items():
        for row in (*published.GROUPS, "average"):
            found = of(cells, table, row, column)
            assert set(found) == {experiment for experiment, _ in policies}, (table, row, column)
            for experiment, phases in policies:
                evaluation = "paper" if table in ("multi_task", "low_rank") else "foundation"
                files = [folder / experiment / phase / "evaluations" for phase in phases]
                files = [next(f for f in (e / evaluation, e / "leaderboard") if f.is_dir()) for e in files]
                ours = percent_of([file / "trials.jsonl" for file in files], tasks_of(row))
                cell = found[experiment]
                assert float(cell["ours"]) == pytest.approx(ours, abs=1e-3), (table, row, column, experiment)
                assert float(cell["published"]) == published.table(table).value(row, column)
                assert (cell["partial"], cell["tasks"]) == ("", cell["of_tasks"])
                seen += 1
    claimed = {(c["table"], c["column"]) for c in cells if c["policy"]}
    others = {"lifelong", "robustness", "scene_diversity", "per_task"}
    assert {pair for pair in claimed if pair[0] not in others} == set(expected_columns())
    assert seen == 4 * sum(map(len, expected_columns().values()))


def test_lifelong_robustness_scenes_and_single_tasks_are_in_their_cells(
    everything: tuple[Path, list[dict[str, str]]],
) -> None:
    folder, cells = everything
    for k in range(1, 5):
        for j in range(1, 5):
            found = of(cells, "lifelong", str(k), f"lifelong_phase{j}")
            assert set(found) == ({"lifelong"} if j <= k else set())
            if j <= k:
                file = folder / f"lifelong/phase{k}/evaluations/lifelong/trials.jsonl"
                ours = percent_of([file], set(published_task_sets()[f"lifelong_phase{j}"]))
                assert float(found["lifelong"]["ours"]) == pytest.approx(ours, abs=1e-3)
    for row in ("composite_seen", "composite_unseen"):
        for column in ("none", "language", "camera", "joint", "base"):
            found = of(cells, "robustness", row, column)
            assert set(found) == {"foundation"}
            file = folder / f"foundation/{row}_100/evaluations/robustness/trials.jsonl"
            ours = percent_of([file], tasks_of(row), column)
            assert float(found["foundation"]["ours"]) == pytest.approx(ours, abs=1e-3)
    for scenes in ("5", "25", "2500"):
        for row, phase in (("zero_shot", "pretrain"), ("target_10", "atomic_10")):
            found = of(cells, "scene_diversity", row, scenes)
            assert set(found) == {f"scene_diversity_{scenes}"}
            file = folder / f"scene_diversity_{scenes}/{phase}/evaluations/foundation/trials.jsonl"
            ours = percent_of([file], set(published_task_sets()["diversity17"]))
            assert float(found[f"scene_diversity_{scenes}"]["ours"]) == pytest.approx(ours, abs=1e-3)
    found = of(cells, "per_task", "WashLettuce", "best")
    assert set(found) == {"foundation"}
    file = folder / "foundation/composite_seen_100/evaluations/foundation/trials.jsonl"
    assert float(found["foundation"]["ours"]) == pytest.approx(percent_of([file], {"WashLettuce"}), abs=1e-3)
    # Of a real robot there are numbers, and none of ours.
    real = [cell for cell in cells if cell["table"] == "real_robot"]
    assert len(real) == 10
    assert not any(cell["policy"] for cell in real)


def test_the_page_has_every_table_and_the_datasets(everything: tuple[Path, list[dict[str, str]]]) -> None:
    html = (everything[0] / "report.html").read_text()
    for name in beside_published.TRANSPOSED:
        assert f'id="beside-{name}"' in html
    for name in ("beside-robustness", "lifelong-published", "published-data", "kinds-family", "kinds-mobile"):
        assert f'id="{name}"' in html
    assert "Measured on a real robot" in html
    assert "1,615" in html
    assert "220 and 145 by the paper&#39;s text and 232 and 133 by the published list of attributes" in html


def test_each_experiment_file_has_its_place() -> None:
    names = {}
    for path in sorted(CONFIGS.glob("*/*.yaml")):
        if path.parent.name in ("robocasa365", "small", "study"):
            experiment = load_experiment(path)
            names[experiment.name] = any(phase.evaluations for phase in experiment.phases)
    known = named_experiments()
    assert [pattern for pattern in known if not fnmatch.filter(names, pattern)] == []
    evaluated = [name for name, tried in names.items() if tried]
    assert [name for name in evaluated if not any(fnmatch.fnmatchcase(name, one) for one in known)] == []


@pytest.fixture(scope="module")
def foundation(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[Path]]:
    folder = tmp_path_factory.mktemp("foundation")
    return folder, synthetic_runs.foundation(folder, count=10)


def test_the_curve_has_all_tasks_at_each_point_and_the_worth_of_each_split(
    foundation: tuple[Path, list[Path]],
) -> None:
    data = gather(foundation[1])
    only, pretrained = data_efficiency.curves(data)
    assert (list(only), list(pretrained)) == ([50, 150, 500], [0, 50, 150, 500])
    assert all(len(policy.tasks) == 50 for policy in (*only.values(), *pretrained.values()))
    section = data_efficiency.section(data)
    assert section is not None
    *figures, worth = section.parts
    titles = ["Average", "Atomic", "Composite, seen", "Composite, unseen"]
    assert [figure.title for figure in figures] == titles  # type: ignore[union-attr]
    rows = {(row[0].text, row[1].text): row for row in worth.rows}  # type: ignore[union-attr]
    assert set(rows) == {(title, demos) for title in titles for demos in ("0", "50", "150", "500")}
    for title, factor in (("Average", "3.7×"), ("Atomic", "6.4×"), ("Composite, unseen", "2.2×")):
        assert rows[title, "50"][-1].text == factor
        assert rows[title, "50"][-2].interval, "no interval"
    assert "on the average over 50 tasks" in str(data_efficiency.sentence(data))


def test_other_data_than_the_benchmarks_are_counted_in_shares(foundation: tuple[Path, list[Path]]) -> None:
    data = gather(foundation[1])
    assert "as if 100 %" not in " ".join(data_efficiency.section(data).text)  # type: ignore[union-attr]
    assert str(data_efficiency.sentence(data)).startswith("With 50 target demonstrations per task")
    own = [
        dataclasses.replace(
            policy,
            headers=tuple(dataclasses.replace(header, registry="parts/kitchens.yaml") for header in policy.headers),
        )
        for policy in data.policies
    ]
    data = dataclasses.replace(data, policies=tuple(own))
    assert "as if 100 % were 500 of each task" in " ".join(data_efficiency.section(data).text)  # type: ignore[union-attr]
    said = str(data_efficiency.sentence(data))
    assert said.startswith("With 10 % of the target demonstrations the pretrained policy does as well as")
    assert "50 target" not in said
    interval = re.search(r"\(95 % interval (.*?)\)", said)
    assert interval is not None, "in shares, too"
    assert interval[1].endswith(" %")


def test_two_trainings_of_one_experiment_stay_apart_and_are_both_shown(
    foundation: tuple[Path, list[Path]], tmp_path: Path
) -> None:
    again = [run for run in synthetic_runs.foundation(tmp_path, count=10) if "atomic_10" in run.parts]
    data = gather([*foundation[1], *again])
    table = beside_published.beside_table(data, "foundation")
    assert table is not None
    tens = [row for row in table.rows if row[0].text == "pretraining + target, 10 %"]
    assert len(tens) == 2
    # The second has trials of the atomic tasks only: no average of 50.
    assert [row[7].text == "–" for row in tens] == [False, True]
    assert tens[1][7].interval == "partial: 18 of 50 tasks"
    labels = [policy.label for policy in data.policies]
    assert len(set(labels)) == len(labels)
    section = data_efficiency.section(data)
    assert section is not None
    assert any("Further policies" in text for text in section.text)


def test_the_output_of_a_training_stands_for_its_evaluations(foundation: tuple[Path, list[Path]]) -> None:
    folder, runs = foundation
    outputs = [folder / "foundation", folder / "target_only"]
    named, found = gather(runs), gather([*outputs, runs[0]])
    assert {policy.label for policy in found.policies} == {policy.label for policy in named.policies}
    assert len(found.single) == len(runs)


@pytest.mark.costly
def test_an_average_over_missing_tasks_is_not_given(foundation: tuple[Path, list[Path]], tmp_path: Path) -> None:
    folder, runs = foundation
    without = [run for run in runs if run.relative_to(folder).parts[:2] != ("foundation", "composite_unseen_10")]
    out = tmp_path / "report.html"
    assert main(["report", *map(str, without), "--out", str(out), "--no-videos"]) == 0
    cells = read_cells(tmp_path / "report_tables.csv")
    average = of(cells, "foundation", "average", "both_10")["foundation"]
    assert (average["ours"], average["tasks"], average["of_tasks"]) == ("", "34", "50")
    assert float(average["partial"]) > 0
    assert of(cells, "foundation", "composite_unseen", "both_10") == {}
    assert of(cells, "foundation", "composite_seen", "both_10")["foundation"]["ours"]
    assert "partial: 34 of 50 tasks" in out.read_text()
    # The curve of the average has its other points, and says which it lacks.
    section = data_efficiency.section(gather(without))
    assert section is not None
    assert any("Average: without foundation, pretraining + target, 10 %" in text for text in section.text)


def labelled(folder: Path, experiment: str | None = None, type: str = "mine", **labels: Any) -> PolicyResult:
    """The result of one policy on the 18 atomic tasks, with labels of a user."""
    tasks = list(published_task_sets()["atomic_seen"])
    about = synthetic_runs.policy("mine", experiment=experiment, type=type, **labels)
    head = synthetic_runs.header("foundation", [about], tasks)
    records = synthetic_runs.trials(head, "mine", dict.fromkeys(tasks, 0.5), 2)
    return gather([synthetic_runs.write(folder, head, records)]).policies[0]


@pytest.mark.parametrize(
    ("labels", "places"),
    [
        ({}, set()),
        ({"demo_fraction": 0.1}, set()),
        ({"demo_fraction": 0.2, "training_data": "target only"}, set()),
        (
            {"demo_fraction": 0.1, "training_data": "Target only"},
            {("foundation", "target_10"), ("pretraining_composition", "none_10")},
        ),
        ({"demo_fraction": 0.1, "training_data": "Human50"}, {("pretraining_composition", "human50_10")}),
        ({"demo_fraction": 0.1, "training_data": "2,500 scenes"}, {("scene_diversity", "2500")}),
        ({"training_data": "joint co-training"}, {("joint_cotraining", "gr00t")}),
        # A named experiment is what it is, whatever its labels say.
        (
            {"experiment": "composition_human50", "demo_fraction": 1.0, "training_data": "pretraining + target"},
            {("pretraining_composition", "human50_100")},
        ),
        ({"experiment": "scene_diversity_5", "demo_fraction": 0.1, "phase": "atomic_10"}, {("scene_diversity", "5")}),
        (
            {"experiment": "my_own", "demo_fraction": 1.0, "training_data": "pretraining + target"},
            {("foundation", "both_100"), ("pretraining_composition", "human300_mg60_100"), ("per_task", "best")},
        ),
    ],
)
def test_labels_place_a_users_policy_and_names_those_of_the_benchmark(
    labels: dict[str, Any], places: set[tuple[str, str]], tmp_path: Path
) -> None:
    policy = labelled(tmp_path / "run", **labels)
    assert {(place.table, place.column) for place in policy.places} == places


def test_lifelong_phases_of_other_tasks_have_a_matrix_and_no_published_numbers(tmp_path: Path) -> None:
    sets = {"lifelong_phase1": ["OpenDrawer", "CloseDrawer"], "lifelong_phase2": ["TurnOnStove"]}
    runs = []
    for k in (1, 2):
        own = dict(list(sets.items())[:k])
        tasks = [task for members in own.values() for task in members]
        label = f"small_lifelong_atomic/phase{k}-002000"
        about = synthetic_runs.policy(label, experiment="small_lifelong_atomic", phase=f"phase{k}", lifelong_phase=k)
        head = synthetic_runs.header("lifelong", [about], tasks, task_sets=own, split="pretrain", registry="own.yaml")
        rates = {task: 0.6 if task in sets[f"lifelong_phase{k}"] else 0.2 for task in tasks}
        runs.append(synthetic_runs.write(tmp_path / f"{k}", head, synthetic_runs.trials(head, label, rates, 10)))
    data = gather(runs)
    matrix = lifelong.matrix(data)
    assert matrix is not None
    assert {k: set(row) for k, row in matrix.matrix.items()} == {1: {1}, 2: {1, 2}}
    section = lifelong.section(data)
    assert section is not None
    assert [part.id for part in section.parts] == ["lifelong-matrix", "lifelong-summary"]  # type: ignore[union-attr]
    assert any("other tasks than the published ones" in text for text in section.text)
    heads = [column.label for column in section.parts[0].columns]  # type: ignore[union-attr]
    assert heads[1:3] == ["Phase 1: atomic (2 of 65)", "Phase 2 (1 other task)"]


def test_two_lifelong_trainings_have_a_matrix_each(tmp_path: Path) -> None:
    runs = [run for name in ("lifelong", "lifelong_replay") for run in synthetic_runs.experiment(name, tmp_path, 2)]
    section = lifelong.section(gather(runs))
    assert section is not None
    ids = [part.id for part in section.parts]  # type: ignore[union-attr]
    assert ids == [f"lifelong-{kind}-{n}" for n in (1, 2) for kind in ("matrix", "summary")] + ["lifelong-published"]
    published_rows = section.parts[-1].rows  # type: ignore[union-attr]
    assert [row[0].interval.split("/")[0] for row in published_rows] == ["ours: lifelong"] * 4


def test_kinds_of_tasks_are_means_over_their_tasks(foundation: tuple[Path, list[Path]]) -> None:
    data: ReportData = gather(foundation[1])
    section = kinds.section(data)
    assert section is not None
    tables = {table.id: table for table in section.parts}  # type: ignore[union-attr]
    assert set(tables) == {"kinds-stages", "kinds-mobile", "kinds-family"}
    mobile = {row[0].text: row for row in tables["kinds-mobile"].rows}  # type: ignore[union-attr]
    last = data.policies[-1]
    facts = task_facts()
    chosen = [result for result in last.tasks if facts[result.task].mobile]
    assert mobile["mobile"][1].value == len(chosen) == 21
    assert mobile["mobile"][-1].value == pytest.approx(sum(r.rate.rate for r in chosen) / len(chosen))


def test_a_small_report_has_none_of_these_sections(tmp_path: Path) -> None:
    tasks = ["OpenDrawer", "CloseDrawer"]
    about = synthetic_runs.policy("demo/finetune-000300", experiment="demo", phase="finetune", step=300)
    head = synthetic_runs.header("quick", [about], tasks, task_sets={})
    run = synthetic_runs.write(
        tmp_path / "run", head, synthetic_runs.trials(head, about.label, dict.fromkeys(tasks, 0.5), 4)
    )
    assert main(["report", str(run), "--no-videos"]) == 0
    html = (run / "report.html").read_text()
    for name in ("beside", "groups", "kinds", "data-efficiency", "lifelong", "robustness"):
        assert f'<section id="{name}"' not in html
    assert "stages" in html  # of the two tasks


def test_horizons_of_a_release_are_told_where_the_published_ones_are_shorter(tmp_path: Path) -> None:
    policy = labelled(tmp_path / "run")
    protocol = published.table("foundation").protocol
    longer = dataclasses.replace(policy.header, horizon_version="1.0.1")
    told = beside_published.differences([dataclasses.replace(policy, headers=(longer,))], protocol)
    assert any("1.5 times as long" in sentence for sentence in told)
    older = dataclasses.replace(policy.header, horizon_version="1.0.0")
    assert not any(
        "1.5 times" in sentence
        for sentence in beside_published.differences([dataclasses.replace(policy, headers=(older,))], protocol)
    )


def test_places_are_data_that_yaml_reads_as_it_looks() -> None:
    text = (Path(places.__file__).parent / "places.yaml").read_text()
    tables = yaml.safe_load(text)
    assert set(tables) == {*published.TABLES, "per_task", "unpublished"} - {"real_robot"}
