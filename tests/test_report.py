"""The report: one file without outside references whose numbers are those of trials.jsonl."""

from __future__ import annotations

import base64
import collections
import json
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from test_evaluation_records import header, record

from robocasa_lerobot.cli import main
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation import results, trials_file
from robocasa_lerobot.evaluation.charts import MAX_POINTS, learning_curve, running_mean, thin_out
from robocasa_lerobot.evaluation.report import interval, percent
from robocasa_lerobot.evaluation.report_data import TrainingPhase, gather, summarize
from robocasa_lerobot.evaluation.results import TermSummary
from robocasa_lerobot.evaluation.statistics import success_rate
from robocasa_lerobot.evaluation.video import VideoWriter

# Elements without an end tag.
VOID = {"meta", "link", "img", "br", "hr", "input"}
EVIL = "<script>alert('x')</script> & |pipes|"


class Page(HTMLParser):
    """Collects what a browser would load, the ids, the table rows with their data, and checks that tags balance."""

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.references: list[str] = []
        self.rows: list[dict[str, str]] = []
        self.cells: list[list[str]] = []
        self.ids: list[str] = []
        self.tags: collections.Counter[str] = collections.Counter()
        self.open: list[str] = []
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
        if tag == "tr":
            self.rows.append({name: value for name, value in values.items() if name.startswith("data-")})
            self.cells.append([])
        if tag == "td":
            self.cells[-1].append("")
            self._cell = True
        if tag == "img":
            assert values.get("alt"), "a picture without a description"

    def handle_endtag(self, tag: str) -> None:
        assert self.open, f"</{tag}> closes nothing"
        assert self.open.pop() == tag
        if tag == "td":
            self._cell = False

    def handle_data(self, data: str) -> None:
        if self._cell:
            self.cells[-1][-1] += data


def write_results(folder: Path, trials: list[dict[str, Any]]) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    for changes in trials:
        changes = dict(changes)
        one = header(str(changes.get("label", "finetune-000400")), **changes.pop("policy", {}))
        trials_file.append(folder / results.TRIALS_FILE, one)
        trials_file.append(folder / results.TRIALS_FILE, record(run=one.id, **changes))
    return folder


def film(path: Path, frames: int = 21) -> None:
    with VideoWriter(path, fps=10) as writer:
        for index in range(frames):
            writer.write(np.full((128, 384, 3), 10 * index, np.uint8))


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


def test_numbers_shown_are_those_of_the_trials(folder: Path) -> None:
    html, markdown = make_report(folder)
    lines = [json.loads(line) for line in (folder / results.TRIALS_FILE).read_text().splitlines()]
    lines = [line for line in lines if line["kind"] == "trial"]
    counts: dict[tuple[str, str], list[bool]] = {}
    for line in lines:
        counts.setdefault((line["task"], line["label"]), []).append(line["success"])
    page = Page(html)
    shown = {(row["data-task"], row["data-policy"]): row for row in page.rows if "data-task" in row}
    assert set(shown) == set(counts)
    for row, cells in zip(page.rows, page.cells, strict=True):
        if "data-task" not in row:
            continue
        successes = counts[row["data-task"], row["data-policy"]]
        rate = success_rate(sum(successes), len(successes))
        assert (int(row["data-successes"]), int(row["data-trials"])) == (rate.successes, rate.trials)
        assert cells[2:5] == [percent(rate.rate), interval(rate), f"{rate.successes}/{rate.trials}"]
        text = f"| {row['data-task']} | {row['data-policy']} | {percent(rate.rate)} | {interval(rate)} |"
        assert text in markdown
    assert "finetune-000400 solved 7 of 11 trials" in html
    assert "untrained 0 of 11 trials" in html


def test_the_page_loads_nothing_and_runs_nothing(folder: Path, training: Path, demos: Path) -> None:
    html, _ = make_report(folder, "--training", training, "--demos", demos)
    page = Page(html)
    # Pictures come with the page; what starts with # points into it.
    assert [r for r in page.references if not r.startswith(("data:", "#"))] == []
    assert page.tags["script"] == page.tags["iframe"] == 0
    assert not re.search(r"url\((?!#)|@import", html)
    assert page.tags["html"] == page.tags["main"] == page.tags["h1"] == 1
    # A success and a failure of OpenDrawer, six frames each.
    pictures = [r for r in page.references if r.startswith("data:image/jpeg;base64,")]
    assert len(pictures) == 12
    assert all(base64.b64decode(p.partition(",")[2])[:2] == b"\xff\xd8" for p in pictures)
    assert page.tags["svg"] == 2
    assert len(html) < 1_000_000


def test_everything_asked_for_is_in_both_files(folder: Path, training: Path, demos: Path) -> None:
    html, markdown = make_report(folder, "--training", training, "--demos", demos, "--title", "A <title>")
    for text in (html, markdown):
        assert "OpenDrawer" in text
        assert "70 %" in text  # published
        assert "not comparable one to one" in text
        assert "20/21" in text  # the demonstrator
        assert "pretrain" in text
        assert "gripper far" in text or "gripper_far" in text
    assert "<title>A &lt;title&gt;</title>" in html
    assert "experiment.yaml" in html
    assert "Traceback &lt;script&gt;" in html


def test_two_results_folders_and_equal_labels_are_told_apart(folder: Path, tmp_path: Path) -> None:
    other = write_results(
        tmp_path / "other",
        [{"label": "untrained", "trial": t, "success": False, "first_success_step": None} for t in range(3)],
    )
    html, _ = make_report(folder, other)
    labels = {row["data-policy"] for row in Page(html).rows if "data-policy" in row}
    assert labels == {"untrained (results)", "untrained (other)", "finetune-000400"}


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
    found = gather([write_results(tmp_path / "r", [{"policy": policy}])]).trainings
    assert [t.folder for t in found] == [training.resolve()]
    assert [phase.name for phase in found[0].phases] == ["pretrain", "finetune"]


def test_bad_input_is_a_clear_error(tmp_path: Path, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["report", str(tmp_path / "nothing")]) == 2
    assert "no such file; expected the trials.jsonl" in capsys.readouterr().err
    empty = tmp_path / "empty"
    empty.mkdir()
    (empty / results.TRIALS_FILE).touch()
    with pytest.raises(UserError, match="no trials in"):
        gather([empty])
    with pytest.raises(UserError, match=r"no metrics\.jsonl"):
        gather([folder], training=[tmp_path / "nothing"])
    (tmp_path / "text.hdf5").write_text("no HDF5")
    with pytest.raises(UserError, match="not an HDF5 file"):
        gather([folder], demos=[tmp_path / "text.hdf5"])
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
    assert "var(--accent)" in svg
    assert "<metadata>" not in svg
    for one in ((1,), ()):
        learning_curve(TrainingPhase("short", one, tuple(0.5 for _ in one)))
