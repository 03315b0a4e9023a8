"""Stored results: each says what was measured, when and where, and the README's figures are those of the results."""

from __future__ import annotations

import gzip
import importlib
import json
import re
from functools import cache
from pathlib import Path
from typing import Any

import pytest

REPOSITORY = Path(__file__).parents[2]
RESULTS = REPOSITORY / "benchmarks" / "results"
STORED = sorted(path.name for path in RESULTS.glob("*.json"))
README = (REPOSITORY / "README.md").read_text(encoding="utf-8")

# Results whose commit does not say by itself what was measured. New ones have none of it: measure at a commit. One that
# is measured again goes from the list.
_CHANGED = "files differed from the commit that it names"
NO_PLAIN_COMMIT = {
    "between_commits_pictures.json": _CHANGED,
    "evaluation_speed.json": _CHANGED,
    "gpu_training.json": "measured on a machine without the repository's history; it says in words what was changed",
    "grasps.json": _CHANGED,
    "scaling.json": _CHANGED,
    "task_scenes.json": _CHANGED,
}
NO_MACHINE = {("convert_speed.json", "small"): "measured again before sections said where"}


@cache
def stored(name: str) -> Any:
    return json.loads((RESULTS / name).read_text(encoding="utf-8"))


def at(name: str, path: str) -> float:
    """A number of a result by the keys that lead to it; by `*` the sum over all that are there."""
    found = [stored(name)]
    for key in path.split("/"):
        found = [inner for one in found for inner in (one.values() if key == "*" else [one[key]])]
    return float(sum(found))


@pytest.mark.parametrize("name", STORED)
def test_a_stored_result_says_what_was_measured_when_and_where(name: str) -> None:
    result = stored(name)
    assert isinstance(result["benchmark"], str)
    assert re.match(r"20\d\d-\d\d-\d\dT", result["date"])
    assert result["machine"]["cpu"]
    assert isinstance(result["ratios"], dict)
    plain = re.fullmatch(r"[0-9a-f]{12}", result["versions"]["commit"]) is not None
    assert plain != (name in NO_PLAIN_COMMIT), "see the list"
    for section, again in result.get("measured_again", {}).items():
        assert {"date", "versions"} <= again.keys()
        assert ("machine" in again) != ((name, section) in NO_MACHINE), "see the list"


def test_exceptions_are_results_that_exist() -> None:
    assert {*NO_PLAIN_COMMIT, *(name for name, _ in NO_MACHINE)} <= set(STORED)


_SIM, _CONVERT = "steps_per_second", "frames_per_second"
# Of tables of the README: a word of the first line, the result, and for each row where the numbers of its cells stand,
# cell after cell.
TABLES: dict[str, tuple[str, dict[str, list[str]]]] = {
    "control steps per second": (
        "sim_speed.json",
        {
            row: [f"{_SIM}/{side}/{key}/median" for side in ("robosuite", "ours")]
            for row, key in {
                "no cameras": "steps_no_cameras",
                "three cameras of 256x256, base and torso driven at every step": "steps_three_cameras",
                "three cameras of 256x256, the base standing": "steps_three_cameras_standing",
            }.items()
        },
    ),
    "steps per second": (
        "convert_speed.json",
        {
            row: [f"{_CONVERT}/{key}/median" for key in keys.split()]
            for row, keys in {
                "pictures in the file": "images_ours_1 images_ours_2 images_lerobot images_encoder_1",
                "states only, our kitchens": (
                    "states_ours_1 states_ours_2 states_lerobot states_renderer_1 states_scenes_1"
                ),
                "the same, in 64 pixels": "small_ours_1 small_ours_2",
                "states only, robosuite's Lift": "lift_ours_1 lift_ours_2 lift_official",
                "the same, with shadows as the official tool draws them": "lift_ours_quality lift_official",
            }.items()
        },
    ),
}
# Of its text: sentences with a group for each number, the result, and where the numbers stand.
SENTENCES: list[tuple[str, str, list[str]]] = [
    (r"we were ([\d.]+) times as fast", "convert_speed.json", ["ratios/lift_quality_vs_official"]),
    (
        r"first\), (\d+) MiB for these (\d+) demonstrations, where ours are .{,30} of (\d+) MiB",
        "convert_speed.json",
        ["dataset_mib/images_lerobot", "effort/episodes", "dataset_mib/images_ours_1"],
    ),
    (
        r"([\d.]+) times as many samples a second with .{,20}, ([\d.]+) times with ours, and ([\d.]+) times where",
        "training_speed.json",
        [f"ratios/demo_of_64_{how}" for how in ("same_loader", "decoding", "cached")],
    ),
    (
        r"default batches of 8 ([\d.]+), ([\d.]+) and ([\d.]+) times",
        "training_speed.json",
        [f"ratios/demo_{how}" for how in ("same_loader", "decoding", "cached")],
    ),
    (
        r"([\d.]+) times as many trials an hour with films, ([\d.]+) times without",
        "evaluation_speed.json",
        ["ratios/demo, with films", "ratios/demo, without films"],
    ),
    (r"([\d,]+) of ([\d,]+) trials", "demonstrators_300.json", ["tasks/*/successes", "trials"]),
    (
        r"of the first (\d+) of them, made again on .{,20}, \[(\d+) succeeded",
        "demonstrators_300_again.json",
        ["trials", "tasks/*/successes"],
    ),
    (r"CloseBlenderLid, in (\d+) of 40", "demonstrators.json", ["tasks/CloseBlenderLid/successes"]),
    (r"took \[(\d+) minutes", "every_task.json", ["minutes/*"]),
]


def check(said: str, name: str, path: str) -> None:
    """Whether a number in the README is the result's, as far as it goes."""
    number = at(name, path)
    assert said == f"{number:,.{len(said.partition('.')[2])}f}", (
        f"the README says {said}, where {name} has {number} at {path}. After a new measurement put its figure into the "
        "README, and into other pages that quote it (`git grep` finds the old one), and look whether the words around "
        "it still hold; if nothing was measured, the README's figure is the mistake."
    )


@pytest.mark.parametrize("first", TABLES)
def test_a_table_of_the_readme_has_the_figures_of_its_result(first: str) -> None:
    name, rows = TABLES[first]
    (lines,) = re.findall(rf"^\| {first}.*\n\|[-:|]+\n((?:\|.*\n)+)", README, re.MULTILINE)
    found = {}
    for line in lines.splitlines():
        row, *cells = (cell.strip() for cell in line.strip("|").split("|"))
        found[row] = re.findall(r"\d+(?:,\d{3})*(?:\.\d+)?", " ".join(cells))
    assert found.keys() == rows.keys(), "a row that comes or goes does so in the test as well"
    for row, paths in rows.items():
        for said, path in zip(found[row], paths, strict=True):
            check(said, name, path)


@pytest.mark.parametrize(("pattern", "name", "paths"), SENTENCES)
def test_a_sentence_of_the_readme_has_the_figures_of_its_result(pattern: str, name: str, paths: list[str]) -> None:
    (found,) = re.finditer(pattern, " ".join(README.replace("](", " (").split()))
    for said, path in zip(found.groups(), paths, strict=True):
        check(said, name, path)


def test_atomic_demonstrators_of_the_readme_are_those_of_the_result() -> None:
    atomic = [task for task in stored("demonstrators.json")["tasks"].values() if task["kind"] == "atomic"]
    solved, tried = (sum(task[key] for task in atomic) for key in ("successes", "trials"))
    assert f"in [{solved:,} of {tried:,}](benchmarks/results/demonstrators.md)" in " ".join(README.split())


@pytest.mark.parametrize("name", ["demonstrators", "demonstrators_300"])
def test_rates_of_earlier_code_are_said_to_be(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    """As long as no stored trial counts as one of today's code, pages that quote the rates name their commits."""
    monkeypatch.syspath_prepend(REPOSITORY / "benchmarks")
    bench = importlib.import_module("demonstrators")
    lines = gzip.decompress((RESULTS / f"{name}{bench.KEPT}").read_bytes()).decode().splitlines()
    some = [bench._trial(json.loads(line)) for line in lines[:: len(lines) // 3]]
    if any(bench.is_current(trial) for trial in some):
        pytest.skip("measured with today's code, or with some of it")
    for page in ("README.md", "docs/demonstrations.md"):
        text = (REPOSITORY / page).read_text(encoding="utf-8")
        for commit in stored(f"{name}.json")["commits"]:
            assert commit[:8] in text, f"{page} quotes rates that were measured at {commit}, and does not say so"
