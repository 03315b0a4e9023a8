"""The page of all tasks: what it says, that it loads nothing, and how it behaves in a browser."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from browser import Browser, find_chromium

from robocasa_lerobot.benchmark.tasks import task_facts
from robocasa_lerobot.cli import main
from robocasa_lerobot.envs.tasks.registry import task_names
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.gallery.tasks.cards import Rate, cards, length_class, read_rates
from robocasa_lerobot.gallery.tasks.page import Entry, choices, write_page
from robocasa_lerobot.gallery.tasks.pictures import Shown, _made_of

CHROMIUM = find_chromium()
MAX_BYTES = 15_000_000
START, STRIP = b"\x00" * 11_000, b"\x01" * 17_000  # a little more than pictures have: 26 kB of a task
TINY = bytes.fromhex("524946463c000000574542505650382030000000d001009d012a0100010002003425a002743ad80000feeef3c800")


@pytest.fixture(scope="module")
def entries() -> list[Entry]:
    """All tasks, with pictures of their usual size where they are declared."""
    shown = Shown("target", 3, "Do it.", 12.25, ("first this", "then that"))
    rates = {"OpenDrawer": Rate(39, 40, 0.87, 0.996)}
    return [Entry(card, shown, START, STRIP) if card.declared else Entry(card) for card in cards(rates)]


def test_every_task_of_the_benchmark_has_a_card(entries: list[Entry]) -> None:
    assert [entry.card.name for entry in entries] == sorted(task_facts())
    for card in (entry.card for entry in entries):
        facts = task_facts()[card.name]
        assert card.declared == (card.name in task_names())
        assert (card.kind, card.human_s) == (facts.kind, facts.human_seconds)
        assert facts.sets <= set(card.sets)
        if card.declared:
            assert all((card.instruction, card.summary, card.goal, card.skills, card.fixtures))
            assert len(card.paraphrases) >= 4
            assert all(depth >= 0 and line for depth, line in card.goal)


def test_classes_of_length_have_no_gap() -> None:
    assert [length_class(s) for s in (1, 15, 15.5, 30, 31, 60, 61)] == [
        "up to 15 s", "up to 15 s", "15 to 30 s", "15 to 30 s", "30 to 60 s", "30 to 60 s", "over 60 s",
    ]  # fmt: skip


def test_the_page_loads_nothing_and_stays_small(tmp_path: Path, entries: list[Entry]) -> None:
    path = write_page(tmp_path / "tasks.html", entries)
    text = path.read_text()
    assert not re.search(r"<(script|link|img|iframe)[^>]+(src|href)=", text)
    assert text.count("<article") == len(task_facts())
    assert text.count('<script type="text/plain"') == 2 * len(task_names())
    assert "39 of 40 trials; 95 % interval 87 to 100 %" in text
    # All 365 declared, one as large as another.
    whole = len(text) + (len(task_facts()) - len(task_names())) * (len(START) + len(STRIP)) * 4 / 3
    assert whole < MAX_BYTES
    for choice in choices(entries):
        assert f'data-filter="{choice.name}"' in text
        for value in choice.values:
            assert f"<option>{value}</option>" in text


def test_rates_come_from_a_result_of_the_benchmark(tmp_path: Path) -> None:
    path = tmp_path / "rates.json"
    row = {"successes": 3, "trials": 4, "low": 0.3, "high": 0.95}
    path.write_text(json.dumps({"tasks": {"OpenDrawer": row, "PourIt": {"trials": 0}}}))
    assert read_rates(path) == {"OpenDrawer": Rate(3, 4, 0.3, 0.95)}
    path.write_text("[]")
    with pytest.raises(UserError, match=r"demonstrators\.py"):
        read_rates(path)
    with pytest.raises(UserError, match="No such file"):
        read_rates(tmp_path / "none.json")


@pytest.mark.render
def test_the_command_makes_what_is_missing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["gallery", "--show=tasks", "--tasks=CloseDrawer", "--seeds=100400", "--workers=1", f"--out={tmp_path}"]
    assert main(command) == 0
    said = json.loads((tmp_path / "tasks" / "CloseDrawer.json").read_text())
    assert said["failure"] == ""
    assert said["seconds"] > 0.5
    assert len(said["stages"]) == 1
    page = (tmp_path / "tasks.html").read_text()
    assert page.count('<script type="text/plain"') == 2
    before = {path: path.stat().st_mtime_ns for path in (tmp_path / "tasks").iterdir()}
    assert main(command) == 0
    assert {path: path.stat().st_mtime_ns for path in (tmp_path / "tasks").iterdir()} == before
    assert "tasks.html" in capsys.readouterr().out
    made = tmp_path / "tasks" / "CloseDrawer.json"
    said = json.loads(made.read_text())
    made.write_text(json.dumps(said | {"of": said["of"] | {"task": "as it was declared before"}}))
    assert main(command) == 0
    assert json.loads(made.read_text()) == said
    row = {"successes": 3, "trials": 4, "low": 0.3, "high": 0.95}
    for name, tasks in (("atomic", {"CloseDrawer": row}), ("more", {"AddIceCubes": row | {"successes": 2}})):
        (tmp_path / f"{name}.json").write_text(json.dumps({"tasks": tasks}))
    assert main([*command, f"--rates={tmp_path / 'atomic.json'},{tmp_path / 'more.json'}"]) == 0
    rated = (tmp_path / "tasks.html").read_text()
    assert [f"{count} of 4 trials" in text for text in (page, rated) for count in (2, 3)] == [False, False, True, True]
    for wrong in (["--tasks=CloseDraw"], ["--seeds=a"], ["--rates=none.json"], ["--show=task"]):
        assert main([*command, *wrong]) == 2


def test_pictures_of_other_tasks_stay_on_the_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "tasks").mkdir()
    said = {"asked": 0, "split": "target", "seed": 0, "instruction": "Open it.", "seconds": None}
    for name in ("CloseDrawer", "OpenDrawer"):
        of = _made_of(name)
        (tmp_path / "tasks" / f"{name}.json").write_text(json.dumps({**said, "of": of, "stages": [], "failure": ""}))
        (tmp_path / "tasks" / f"{name}_start.webp").write_bytes(TINY)
    assert main(["gallery", "--show=tasks", "--tasks=CloseDrawer", "--workers=1", f"--out={tmp_path}"]) == 0
    assert (tmp_path / "tasks.html").read_text().count('<script type="text/plain"') == 2


def test_a_task_that_raises_has_a_card_that_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object) -> None:
        raise IndexError("list index out of range")

    monkeypatch.setattr("robocasa_lerobot.gallery.tasks.pictures.record_episode", broken)
    (tmp_path / "tasks").mkdir()
    (tmp_path / "tasks" / "CloseDrawer_start.webp").write_bytes(TINY)  # of another seed
    command = ["gallery", "--show=tasks", "--tasks=CloseDrawer", "--workers=1", f"--out={tmp_path}"]
    for _ in range(2):  # the second finds what the first has made
        assert main(command) == 0
        page = (tmp_path / "tasks.html").read_text()
        assert "No pictures: IndexError: list index out of range (target, seed 0)" in page
        assert '<script type="text/plain"' not in page


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    shown = Shown("target", 0, "Do it.", 12.25, ("first this",))
    made = [Entry(card, shown, TINY, TINY) if card.declared else Entry(card) for card in cards()]
    return write_page(tmp_path_factory.mktemp("page") / "tasks.html", made)


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    if CHROMIUM is None:
        pytest.skip("no Chromium on this machine (set $CHROMIUM to its path)")
    with Browser(CHROMIUM) as running:
        yield running


SHOWN = "[...document.querySelectorAll('article')].filter(a => !a.hidden).map(a => a.id)"


def choose(browser: Browser, name: str, value: str) -> list[str]:
    """Names of what is shown after a choice."""
    browser.ask(
        f"(s => {{ s.value = {value!r}; s.dispatchEvent(new Event('change')) }})"
        f"(document.querySelector('select[data-filter={name}]'))"
    )
    shown: list[str] = browser.ask(SHOWN)
    return shown


@pytest.mark.render
def test_every_choice_shows_what_has_it(browser: Browser, page: Path) -> None:
    browser.open(page)
    known = cards()
    has = {
        "kind": lambda c: [c.kind], "family": lambda c: [c.family], "activity": lambda c: [c.activity],
        "skill": lambda c: c.skills, "fixture": lambda c: c.fixtures, "length": lambda c: [c.length],
        "set": lambda c: c.sets,
        "state": lambda c: ["demonstrated" if c.demonstrated else "declared" if c.declared else "to come"],
    }  # fmt: skip
    for choice in choices([Entry(card) for card in known]):
        for value in choice.values:
            expected = [card.name for card in known if value in has[choice.name](card)]
            assert choose(browser, choice.name, value) == expected, (choice.name, value)
        assert len(choose(browser, choice.name, "")) == len(known)
    choose(browser, "kind", "atomic")
    choose(browser, "family", "serving")
    assert browser.ask("document.getElementById('none').hidden") is False
    browser.ask("document.getElementById('clear-all').click()")
    assert browser.ask("document.getElementById('count').textContent") == str(len(known))
    assert browser.messages == []
    assert browser.requests == []


@pytest.mark.render
def test_search_links_and_keys(browser: Browser, page: Path) -> None:
    browser.open(page)
    browser.with_focus()
    browser.key("Slash", True, "/")
    browser.key("Slash", False, "/")
    assert browser.ask("document.activeElement.id") == "search"
    browser.ask("(s => { s.value = 'dishwasher rack'; s.dispatchEvent(new Event('input')) })(document.activeElement)")
    found = browser.ask(SHOWN)
    assert "SlideDishwasherRack" in found
    assert len(found) < 20
    link = browser.ask("location.href")
    browser.open("about:blank")
    browser.open(link)
    assert browser.ask(SHOWN) == found
    assert browser.ask("document.getElementById('search').value") == "dishwasher rack"


@pytest.mark.render
@pytest.mark.parametrize(("width", "dark"), [(1280, False), (390, True)])
def test_pictures_come_when_scrolled_to(browser: Browser, page: Path, width: int, dark: bool) -> None:
    browser.open(page, width, 800, dark)
    browser.until("document.querySelectorAll('img[src]').length > 0")
    first = browser.ask("document.querySelectorAll('main img[src]').length")
    assert first < browser.ask("document.querySelectorAll('main img').length") / 2
    browser.ask("window.scrollTo(0, document.body.scrollHeight)")
    browser.until(f"document.querySelectorAll('main img[src]').length > {first}")
    assert browser.ask("document.documentElement.scrollWidth <= window.innerWidth")
    assert browser.ask("document.querySelector('.more').open") is (width > 600)
    browser.ask("window.scrollTo(0, 0)")
    browser.ask("document.querySelector('.strip').click()")
    assert browser.ask("document.getElementById('large').open")
    browser.ask("document.querySelector('#large button').click()")
    assert not browser.ask("document.getElementById('large').open")
    light, ground = (browser.ask(f"getComputedStyle(document.body).{what}") for what in ("color", "backgroundColor"))
    bright = [sum(map(int, re.findall(r"\d+", colour)[:3])) for colour in (light, ground)]
    assert (bright[0] > bright[1]) is dark
    assert browser.messages == []
