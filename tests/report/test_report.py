"""The report: one file without outside references whose numbers are those of trials.jsonl."""

from __future__ import annotations

import base64
import collections
import csv
import dataclasses
import json
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from evaluation_records import header, record, write_results

from robocasa_lerobot.benchmark.published import table
from robocasa_lerobot.cli import main
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.records import results, trials_file
from robocasa_lerobot.evaluation.records.results import TermSummary
from robocasa_lerobot.evaluation.report.formats import film_strip, latex, markdown
from robocasa_lerobot.evaluation.report.formats.charts import (
    MAX_POINTS,
    Line,
    learning_curve,
    line_chart,
    running_mean,
    thin_out,
)
from robocasa_lerobot.evaluation.report.gather import gather, summarize
from robocasa_lerobot.evaluation.report.numbers import (
    bare,
    bare_interval,
    count,
    interval,
    listed,
    p_value,
    percent,
    points,
    published,
)
from robocasa_lerobot.evaluation.report.policies import same_trials
from robocasa_lerobot.evaluation.report.sections.beside_published import differences
from robocasa_lerobot.evaluation.report.training import TrainingPhase, find_trainings, read_demonstrator, read_training
from robocasa_lerobot.evaluation.statistics import Estimate, success_rate
from robocasa_lerobot.video import VideoWriter, frames_and_rate

# Elements without an end tag.
VOID = {"meta", "link", "img", "br", "hr", "input", "wbr"}
EVIL = "<script>alert('x')</script> & |pipes|"


class Page(HTMLParser):
    """What a browser would load, the ids, each table's rows by its id; and checks that tags balance."""

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.references: list[str] = []
        self.tables: dict[str, list[list[str]]] = {}
        self.ids: collections.Counter[str] = collections.Counter()
        self.pointed: set[str] = set()
        self.tags: collections.Counter[str] = collections.Counter()
        self.open: list[str] = []
        self._table = ""
        self._cell = False
        self.feed(text)
        self.close()
        assert self.open == [], f"tags left open: {self.open}"

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.handle_endtag(tag)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags[tag] += 1
        if tag not in VOID:
            self.open.append(tag)
        values = {name: value or "" for name, value in attrs}
        self.references += [values[name] for name in ("src", "href", "xlink:href", "srcset", "data") if name in values]
        self.pointed |= set(values.get("aria-labelledby", "").split())
        self.pointed |= {values["href"][1:]} if values.get("href", "").startswith("#") else set()
        if "id" in values:
            self.ids[values["id"]] += 1
        if tag == "table":
            self._table = values["id"]
            self.tables[self._table] = []
        if tag == "tr":
            self.tables[self._table].append([])
        if tag in ("td", "th"):
            self.tables[self._table][-1].append("")
            self._cell = True
            assert tag == "td" or values.get("scope") in ("row", "col"), "a heading of nothing"
        if tag == "img":
            assert values.get("alt"), "a picture without a description"
        if tag == "video":
            assert values.get("aria-label"), "a film without a description"
            assert "controls" in values

    def handle_endtag(self, tag: str) -> None:
        assert self.open, f"</{tag}> closes nothing"
        assert self.open.pop() == tag
        if tag in ("td", "th"):
            self._cell = False

    def handle_data(self, data: str) -> None:
        if self._cell:
            self.tables[self._table][-1][-1] += data


def film(path: Path, frames: int = 21) -> None:
    with VideoWriter(path, fps=10) as writer:
        for index in range(frames):
            writer.write(np.full((128, 384, 3), 10 * index % 256, np.uint8))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Two policies on two tasks, with films, an error, and text that must be escaped."""
    trials: list[dict[str, Any]] = []
    for label, step, solved in (("untrained", 0, 0), ("finetune-000400", 400, 7)):
        policy = {"path": "p", "type": "diffusion_transformer", "fingerprint": label, "phase": "finetune", "step": step}
        for trial in range(10):
            success = trial < solved
            changes = {
                "label": label,
                "trial": trial,
                "policy": policy,
                "success": success,
                "first_success_step": 50 + trial if success else None,
                "terms": {
                    "drawer_open": TermSummary(50 + trial if success else None, 0.1 * success, success),
                    "gripper_far": TermSummary(1, 0.5, trial % 2 == 0),
                },
                "instruction": EVIL,
                "video": f"videos/{label}/{trial}.mp4" if trial in (0, 8) else None,
            }
            if changes["video"]:
                film(tmp_path / "results" / str(changes["video"]))
            trials.append(changes)
        error = {"error": f"Traceback {EVIL}", "outcome": "crashed", "terms": {}, "first_success_step": None}
        trials.append({"label": label, "task": "CloseDrawer", "policy": policy, "success": False, **error})
    (tmp_path / "results").mkdir(exist_ok=True)
    return write_results(tmp_path / "results", trials)


@pytest.fixture
def training(tmp_path: Path) -> Path:
    for phase, steps in (("pretrain", 500), ("finetune", 30)):
        lines = [json.dumps({"step": s, "loss": 1 / s, "lr": 1e-3}) for s in range(1, steps + 1)]
        (tmp_path / "training" / phase).mkdir(parents=True)
        (tmp_path / "training" / phase / "metrics.jsonl").write_text("\n".join(lines) + "\n" + '{"step": 99')
    (tmp_path / "training/experiment.yaml").write_text(f"name: {EVIL!r}\n")
    return tmp_path / "training"


@pytest.fixture
def demos(tmp_path: Path) -> Path:
    path = tmp_path / "OpenDrawer.hdf5"
    with h5py.File(path, "w") as file:
        file.create_group("data").attrs.update({"env": "OpenDrawer", "episodes_tried": 21, "episodes_failed": 1})
    return path


def make_report(folder: Path, *arguments: object) -> tuple[str, str]:
    assert main(["report", str(folder), *map(str, arguments)]) == 0
    return (folder / "report.html").read_text(), (folder / "report.md").read_text()


def test_numbers_shown_are_those_of_the_trials_in_all_four_files(folder: Path) -> None:
    html, text = make_report(folder)
    lines = [json.loads(line) for line in (folder / results.TRIALS_FILE).read_text().splitlines()]
    counts: dict[tuple[str, str], list[bool]] = {}
    for line in lines:
        if line["kind"] == "trial":
            counts.setdefault((line["label"], line["task"]), []).append(line["success"])
    assert len(counts) == 4
    head, *rows = Page(html).tables["task-rates"]
    tex = (folder / "report.tex").read_text()
    with (folder / "report.csv").open() as file:
        tidy = {(row["policy"], row["task"]): row for row in csv.DictReader(file) if row["task"]}
    assert set(tidy) == set(counts)
    for (label, task), successes in counts.items():
        rate = success_rate(sum(successes), len(successes))
        column = next(i for i, name in enumerate(head) if name.startswith(label))
        cell = next(row for row in rows if row[0] == task)[column]
        shown = f"{percent(rate.rate)}{interval(rate)} · {rate.successes}/{rate.trials}"
        assert cell.startswith(shown)
        assert f"{percent(rate.rate)} ({interval(rate)} · {rate.successes}/{rate.trials}" in text
        assert latex.escape(f"({interval(rate)} · {rate.successes}/{rate.trials}") in tex
        row = tidy[label, task]
        assert (int(row["successes"]), int(row["trials"])) == (rate.successes, rate.trials)
        assert float(row["low"]) == pytest.approx(rate.low, abs=1e-6)
    # OpenDrawer 7 of 10, CloseDrawer 0 of 1: the mean over tasks is 35 %, that of the trials would be 64 %.
    assert f"{percent(0.35)} of trials" in html
    assert "untrained 0.0" in html


def test_the_page_loads_nothing_and_every_reference_has_its_target(folder: Path, training: Path, demos: Path) -> None:
    html, _ = make_report(folder, "--training", training, "--demos", demos)
    page = Page(html)
    # Pictures come with the page; what starts with # points into it.
    assert [r for r in page.references if not r.startswith(("data:", "#"))] == []
    assert not re.search(r"url\((?!#)|@import|https?://(?!www\.w3\.org/)", html)
    assert page.tags["iframe"] == 0
    assert page.tags["html"] == page.tags["main"] == page.tags["h1"] == page.tags["nav"] == page.tags["script"] == 1
    assert [name for name, times in page.ids.items() if times > 1] == []
    assert page.pointed <= set(page.ids)
    # A success and a failure of OpenDrawer, six frames and a film each.
    pictures = [r for r in page.references if r.startswith("data:image/jpeg;base64,")]
    assert len(pictures) == 12
    assert all(base64.b64decode(p.partition(",")[2])[:2] == b"\xff\xd8" for p in pictures)
    assert len([r for r in page.references if r.startswith("data:video/mp4;base64,")]) == 2
    # Two learning curves, and success against time; each is titled and described, with its numbers in a table.
    assert page.tags["svg"] == page.tags["desc"] == 3
    assert len(html) < 1_000_000


def test_films_can_be_left_out(folder: Path) -> None:
    html, _ = make_report(folder, "--no-videos")
    assert "data:video" not in html
    assert "data:image/jpeg" in html


def test_everything_asked_for_is_in_both_files(folder: Path, training: Path, demos: Path) -> None:
    html, text = make_report(folder, "--training", training, "--demos", demos, "--title", "A <title>")
    for one in (html, text):
        assert "OpenDrawer" in one
        assert "70\N{NO-BREAK SPACE}%" in one  # published
        assert "other kitchens" in one
        assert "20/21" in one  # the demonstrator
        assert "pretrain" in one
        assert "gripper far" in one
        assert "exact McNemar" in one
        assert "not in a git checkout" in one
    assert "<title>A &lt;title&gt;</title>" in html
    assert "experiment.yaml" in html
    assert "Traceback &lt;script&gt;" in html
    assert "<script>alert" not in html
    assert "videos/untrained/8.mp4" in text


def test_two_results_folders_and_equal_labels_are_told_apart_and_compared(folder: Path, tmp_path: Path) -> None:
    other = write_results(
        tmp_path / "other",
        [{"label": "untrained", "trial": t, "success": False, "first_success_step": None} for t in range(3)],
    )
    data = gather([folder, other])
    assert {p.label for p in data.policies} == {"untrained (results)", "untrained (other)", "finetune-000400"}
    first, trained, second = data.policies
    # Three trials are the same ones: same task, number, seed and horizon.
    assert {task: a.tolist() for task, (a, _) in same_trials(trained, second).items()} == {"OpenDrawer": [True] * 3}
    assert len(same_trials(first, trained)["OpenDrawer"][0]) == 10
    longer = write_results(tmp_path / "longer", [{"label": "long", "trial": t, "horizon": 200} for t in range(3)])
    assert same_trials(gather([longer]).policies[0], trained) == {}


def test_terms_of_failures_are_counted_without_errors(folder: Path) -> None:
    records = [r for r in results.read_results(folder).trials if r.label == "finetune-000400"]
    result = summarize("OpenDrawer", [r for r in records if r.task == "OpenDrawer"])
    assert (result.failed, result.errors, result.median_seconds) == (3, 0, 53 / 20)
    assert [(t.name, t.never, t.lost) for t in result.terms] == [("drawer_open", 3, 0), ("gripper_far", 0, 2)]
    broken = summarize("CloseDrawer", [r for r in records if r.task == "CloseDrawer"])
    assert (broken.rate.trials, broken.failed, broken.errors, broken.terms) == (1, 0, 1, ())


def test_the_training_is_found_from_the_checkpoints_place(tmp_path: Path, training: Path) -> None:
    checkpoint = training / "finetune/checkpoints/000400/pretrained_model"
    checkpoint.mkdir(parents=True)
    policy = {"path": str(checkpoint), "type": "t", "fingerprint": "f", "phase": "finetune", "step": 400}
    found = find_trainings(gather([write_results(tmp_path / "r", [{"policy": policy}])]).policies)
    assert found == [training.resolve()]
    assert [phase.name for phase in read_training(found[0]).phases] == ["pretrain", "finetune"]


def test_the_results_file_stands_for_its_folder(folder: Path) -> None:
    assert main(["report", str(folder / results.TRIALS_FILE)]) == 0
    assert (folder / "report.html").is_file()
    assert (folder / "report.md").is_file()


def test_bad_input_is_a_clear_error(tmp_path: Path, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["report", str(tmp_path / "nothing")]) == 2
    assert "no such file; expected the trials.jsonl" in capsys.readouterr().err
    empty = tmp_path / "empty"
    empty.mkdir()
    (empty / results.TRIALS_FILE).touch()
    with pytest.raises(UserError, match="no trials in"):
        gather([empty])
    with pytest.raises(UserError, match=r"no metrics\.jsonl"):
        read_training(tmp_path / "nothing")
    (tmp_path / "text.hdf5").write_text("no HDF5")
    with pytest.raises(UserError, match="not an HDF5 file"):
        read_demonstrator(tmp_path / "text.hdf5")
    assert main(["report", str(folder), "--out", str(tmp_path / "report.pdf")]) == 2
    assert "expected .html" in capsys.readouterr().err


def test_long_learning_curves_are_thinned_by_means() -> None:
    steps, losses = list(range(10_000)), [float(i % 2) for i in range(10_000)]
    x, y = thin_out(steps, losses)
    assert len(x) == len(y) <= MAX_POINTS
    assert y == pytest.approx(np.full(len(y), 0.5), abs=0.02)
    assert running_mean(np.array([1.0, 2.0, 6.0]), 3) == pytest.approx([1.5, 3.0, 4.0])
    svg = learning_curve(TrainingPhase("pre", tuple(steps), tuple(losses)))
    assert svg.startswith("<svg")
    assert "var(--series-1)" in svg
    assert "#0a0b00" not in svg
    assert "<metadata>" not in svg
    for one in ((1,), ()):
        learning_curve(TrainingPhase("short", one, tuple(0.5 for _ in one)))


def test_charts_share_no_ids_and_keep_their_descriptions() -> None:
    line = Line("a <b>", 0, (0.0, 50.0, 500.0), (1.0, 2.0, 3.0), (0.5, 1.0, 2.0), (2.0, 3.0, 4.0), errorbars=True)
    charts = [line_chart(name, "T <t>", "D", [line], "x", "y", "symlog", (0, 100)) for name in ("one", "two")]
    ids = [re.findall(r' id="([^"]+)"', chart) for chart in charts]
    assert not set(ids[0]) & set(ids[1])
    assert '<title id="one-title">T &lt;t&gt;</title>' in charts[0]
    for chart in charts:
        assert set(re.findall(r"url\(#([^)]+)\)", chart)) <= set(re.findall(r' id="([^"]+)"', chart))


def test_a_long_film_is_sped_up_to_its_end_and_not_cut(tmp_path: Path) -> None:
    film(tmp_path / "film.mp4", frames=600)
    uri, speed = film_strip.clip(tmp_path / "film.mp4")
    assert speed == pytest.approx(5.0, rel=0.02)
    small = tmp_path / "small.mp4"
    small.write_bytes(base64.b64decode(uri.partition(",")[2]))
    assert frames_and_rate(small) == (120, 10.0)
    frames = film_strip.make_frames(tmp_path / "film.mp4")
    assert [frame.seconds for frame in frames] == pytest.approx([0, 12, 24, 36, 48, 59.9], abs=0.11)


def test_films_stay_within_their_budget(folder: Path) -> None:
    data = gather([folder])
    films = film_strip.choose_films(data)
    assert [f.success for f in films] == [True, False]
    size = sum(len(frame.uri) for f in films for frame in f.frames)
    without = film_strip.choose_films(data, budget=size + 10)
    assert [f.video for f in without] == [None, None]
    assert film_strip.choose_films(data, budget=10) == []


def test_numbers_are_written_the_same_everywhere() -> None:
    assert percent(0.12345) == "12.3\N{NO-BREAK SPACE}%"
    assert (points(0.0721), points(-0.0721), points(-0.0001)) == ("+7.2", "\N{MINUS SIGN}7.2", "0.0")
    assert (bare(0.0721), bare(-0.0301), bare(-1e-17)) == ("7.2", "\N{MINUS SIGN}3.0", "0.0")
    assert bare_interval(Estimate(0.03, -0.012, 0.074)) == "\N{MINUS SIGN}1.2 to 7.4"
    assert [p_value(p) for p in (0.00001, 0.0123, 0.5, 1.0)] == ["< 0.001", "0.012", "0.50", "1.00"]
    assert [published(v) for v in (1.25, 15.0)] == ["1.25\N{NO-BREAK SPACE}%", "15.0\N{NO-BREAK SPACE}%"]
    assert [count(1, "task"), count(2500, "trial")] == ["1 task", "2,500 trials"]
    assert [listed([]), listed(["a"]), listed(["a", "b", "c"])] == ["", "a", "a, b and c"]
    assert listed(list("abcdefgh")) == "a, b, c, d, e and 3 more"


@pytest.mark.parametrize("text", ["a|b", "<i>", "`x`", "[a](b)", "#1", "a_b*c"])
def test_text_is_escaped_for_markdown_and_latex(text: str) -> None:
    bare = re.sub(r"\\(.)", "", markdown.escape(text))
    assert not set(bare) & set("|<>`[]#_*")
    assert not set(re.sub(r"\\[&%$#_{}]|\$[<>|]\$", "", latex.escape(text))) & set("&%#_<>|")


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({}, []),
        ({"split": "pretrain"}, ["Scenes differ: ours are pretraining scenes, published are target scenes."]),
        ({"horizon_multiplier": 1.5}, ["Horizons differ: ours are 1.5 times each task's own."]),
        (
            {"horizon_rule": "fixed"},
            ["Horizons differ: ours are a fixed horizon of 100 steps, published are each task's own."],
        ),
        (
            {"success_rule": "hold", "success_hold_steps": 10},
            ["Success differs: ours when the goal held for 10 steps in a row, published at any step."],
        ),
    ],
)
def test_what_differs_from_the_published_protocol_is_said(
    changes: dict[str, Any], said: list[str], tmp_path: Path
) -> None:
    one = dataclasses.replace(header(), **changes)
    for item in (one, *(record(run=one.id, trial=t, seed=t) for t in range(30))):
        trials_file.append(tmp_path / results.TRIALS_FILE, item)
    policies = gather([tmp_path]).policies
    assert differences(policies, table("foundation").protocol) == said
    html, text = make_report(tmp_path)
    for sentence in (*said, "Ours are other kitchens"):
        assert sentence.replace("'", "&#39;") in html
        assert sentence in text
    fewer = {**table("foundation").protocol, "trials_per_task": 50}
    assert differences(policies, fewer)[: len(said) + 1].count("Trials per task differ: ours 30, published 50.") == 1
