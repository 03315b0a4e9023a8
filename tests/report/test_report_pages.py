"""Reports of the benchmark's kinds of run, from synthetic trials, as a browser shows them."""

from __future__ import annotations

import itertools
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import report_colours
import synthetic_runs
from browser import Browser, find_chromium

from robocasa_lerobot.evaluation.report.output import write_report

CHROMIUM = find_chromium()
needs_chromium = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on this machine (set $CHROMIUM to its path)")
KINDS = tuple(synthetic_runs.RUNS)
MAX_BYTES = 15_000_000
DESKTOP, PHONE = 1280, 390

# Elements that show text of their own, with the contrast of their colour to what is painted behind them.
CONTRASTS = """
(() => {
  const rgba = text => { const p = text.match(/[\\d.]+/g).map(Number); return p.length > 3 ? p : [...p, 1]; };
  const over = (top, under) => [0, 1, 2].map(i => top[3] * top[i] + (1 - top[3]) * under[i]);
  const light = c => { const [r, g, b] = c.slice(0, 3).map(v => { v /= 255;
    return v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4; }); return 0.2126 * r + 0.7152 * g + 0.0722 * b; };
  const behind = element => { const layers = [];
    for (let e = element; e; e = e.parentElement) layers.push(rgba(getComputedStyle(e).backgroundColor));
    return layers.reverse().reduce((under, top) => over(top, under), [255, 255, 255]); };
  const found = [];
  for (const element of document.querySelectorAll("body *")) {
    const own = [...element.childNodes].some(n => n.nodeType === 3 && n.textContent.trim());
    if (!own || ["SCRIPT", "STYLE", "title", "desc"].includes(element.tagName)) continue;
    if (!element.getClientRects().length) continue;
    const style = getComputedStyle(element), under = behind(element);
    const paint = element instanceof SVGElement ? style.fill : style.color;
    const colour = over(rgba(paint), under);
    const [a, b] = [light(colour), light(under)].sort((x, y) => y - x);
    const size = parseFloat(style.fontSize), large = size >= 24 || (size >= 18.66 && Number(style.fontWeight) >= 700);
    const ratio = (a + 0.05) / (b + 0.05);
    if (ratio < (large ? 3 : 4.5)) found.push(`${element.tagName}.${element.className} ${ratio.toFixed(2)} ` +
      element.textContent.trim().slice(0, 30));
  }
  return [...new Set(found)].slice(0, 20);
})()
"""
# What a screen reader and a keyboard need; each entry is a fault.
FAULTS = """
(() => {
  const all = selector => [...document.querySelectorAll(selector)], faults = [];
  const fault = (what, elements) => elements.slice(0, 3).forEach(
    e => faults.push(what + ": " + e.outerHTML.slice(0, 90)));
  const text = id => document.getElementById(id)?.textContent.trim();
  const named = e => { const ids = (e.getAttribute("aria-labelledby") || "").split(/\\s+/).filter(Boolean);
    return e.getAttribute("aria-label") || (ids.length && ids.every(text)) || e.textContent.trim(); };
  for (const [selector, count] of [["main", 1], ["header", 1], ["nav", 1], ["footer", 1], ["h1", 1]])
    if (all(selector).length !== count) faults.push(`${all(selector).length} of ${selector}`);
  if (document.documentElement.lang !== "en") faults.push("no language");
  fault("button without a name", all("button").filter(e => !named(e)));
  const shown = e => e.getClientRects().length > 0;
  fault("button too small to hit", all("button, summary").filter(e => shown(e) && e.offsetHeight < 20));
  fault("picture without a description", all("img").filter(e => !e.alt.trim()));
  fault("chart without title and description", all("svg").filter(e => e.getAttribute("role") !== "img" || !named(e) ||
    !e.querySelector("title") || !e.querySelector("desc")));
  fault("chart without its numbers", all("figure.chart").filter(e => !e.querySelector("details table tbody tr")));
  fault("table without a caption", all("table").filter(e => !e.caption || !e.caption.textContent.trim()));
  fault("heading of nothing", all("th").filter(e => !["row", "col"].includes(e.scope)));
  fault("row without a heading", all("tbody tr").filter(e => !e.querySelector('th[scope="row"]')));
  fault("sortable column without aria-sort", all("th .sort").filter(e => !e.closest("th").hasAttribute("aria-sort")));
  fault("scrolling region not reachable", all(".scroll").filter(e => e.tabIndex !== 0 || !named(e)));
  fault("section without a heading", all("section").filter(e => !named(e)));
  fault("film without a description", all("video").filter(e => !e.getAttribute("aria-label") || !e.controls));
  fault("link to nowhere", all('a[href^="#"]').filter(e => !document.getElementById(e.getAttribute("href").slice(1))));
  let level = 0;
  for (const e of all("h1, h2, h3, h4")) { const now = Number(e.tagName[1]);
    if (now > level + 1) fault("skipped heading level", [e]); level = now; }
  return faults;
})()
"""


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The report of each kind of run, with films in the first."""
    folder, out = tmp_path_factory.mktemp("reports"), {}
    for kind, make in synthetic_runs.RUNS.items():
        out[kind] = folder / kind / "report.html"
        write_report(make(folder / kind, count=2 if kind == "ablations" else 6), out=out[kind])
    return out


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    assert CHROMIUM is not None
    with Browser(CHROMIUM) as one:
        yield one


@needs_chromium
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("width", [DESKTOP, PHONE])
def test_a_page_opens_quietly_fits_and_loads_nothing(
    kind: str, width: int, pages: dict[str, Path], browser: Browser
) -> None:
    browser.open(pages[kind], width)
    assert browser.messages == []
    assert browser.requests == []
    assert browser.ask("document.documentElement.scrollWidth") <= width
    assert browser.ask("document.querySelector('.synthetic').getBoundingClientRect().top") == 0
    assert browser.ask("[...document.images].every(i => i.complete && i.naturalWidth > 0)")
    titles = {"multi_task": "Leaderboard", "lifelong": "Lifelong", "robustness": "Robustness"}
    assert browser.ask("document.title").startswith(titles.get(kind, "Evaluation on 50 tasks"))


@pytest.mark.parametrize("kind", KINDS)
def test_a_page_is_small_and_says_that_its_trials_are_synthetic(kind: str, pages: dict[str, Path]) -> None:
    assert pages[kind].stat().st_size < MAX_BYTES
    for suffix in (".md", ".tex"):
        assert "Synthetic trials" in pages[kind].with_suffix(suffix).read_text()
    head, *rows = pages[kind].with_suffix(".csv").read_text().splitlines()
    assert head.endswith(",synthetic")
    assert all(row.endswith(",1") for row in rows)


@needs_chromium
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("dark", [False, True])
def test_text_stands_out_in_both_themes(kind: str, dark: bool, pages: dict[str, Path], browser: Browser) -> None:
    browser.open(pages[kind], DESKTOP, dark=dark)
    browser.ask("document.querySelectorAll('details').forEach(d => { d.open = true; })")
    assert browser.ask("getComputedStyle(document.body).backgroundColor") == (
        "rgb(18, 21, 24)" if dark else "rgb(250, 250, 247)"
    )
    assert browser.ask(CONTRASTS) == []


@needs_chromium
@pytest.mark.parametrize("kind", KINDS)
def test_a_page_is_made_for_screen_reader_and_keyboard(kind: str, pages: dict[str, Path], browser: Browser) -> None:
    browser.open(pages[kind], DESKTOP)
    assert browser.ask(FAULTS) == []
    # The first stop of the keyboard jumps over the navigation.
    first = "[...document.querySelectorAll('a, button, summary, [tabindex=\"0\"]')][0]"
    assert browser.ask(f"{first}.getAttribute('href')") == "#main"


@needs_chromium
def test_the_checks_of_this_file_find_faults(pages: dict[str, Path], browser: Browser) -> None:
    browser.open(pages["lifelong"], DESKTOP)
    browser.ask("document.querySelector('.lead').style.color = '#bbbbbb'")
    browser.ask("document.querySelector('caption').remove()")
    browser.ask("document.querySelector('.theme button').textContent = ''")
    assert any("P.lead" in text for text in browser.ask(CONTRASTS))
    found = browser.ask(FAULTS)
    assert any(text.startswith("table without a caption") for text in found)
    assert any(text.startswith("button without a name") for text in found)
    browser.ask("console.error('seen')")
    assert any("error" in message for message in browser.messages)


@needs_chromium
def test_a_table_sorts_by_its_column(pages: dict[str, Path], browser: Browser) -> None:
    browser.open(pages["multi_task"], DESKTOP)
    column = "[...document.querySelectorAll('#task-rates tbody tr')].map(r => r.cells[1].dataset.sort).map(Number)"
    names = "[...document.querySelectorAll('#task-rates tbody tr')].map(r => r.cells[0].textContent)"
    state = "[...document.querySelectorAll('#task-rates thead th')].map(h => h.getAttribute('aria-sort'))"
    click = "document.querySelectorAll('#task-rates thead button')[{}].click()"
    before = browser.ask(column)
    browser.ask(click.format(1))
    assert browser.ask(column) == sorted(before, reverse=True)
    assert browser.ask(state)[:3] == ["none", "descending", "none"]
    browser.ask(click.format(1))
    assert browser.ask(column) == sorted(before)
    assert browser.ask(state)[1] == "ascending"
    browser.ask(click.format(0))
    assert browser.ask(names) == sorted(browser.ask(names), key=str.lower)
    assert browser.ask(state)[:2] == ["ascending", "none"]


@needs_chromium
@pytest.mark.parametrize("system_dark", [False, True])
def test_the_theme_follows_the_system_until_it_is_chosen(
    system_dark: bool, pages: dict[str, Path], browser: Browser
) -> None:
    browser.open(pages["robustness"], DESKTOP, dark=system_dark)
    browser.ask("document.querySelector('[data-theme-choice=auto]').click()")
    paper = "getComputedStyle(document.documentElement).getPropertyValue('--paper').trim()"
    themes = {name: values["paper"] for name, values in report_colours.themes().items()}
    assert browser.ask(paper) == themes["dark" if system_dark else "light"]
    for choice in ("light", "dark"):
        browser.ask(f"document.querySelector('[data-theme-choice={choice}]').click()")
        assert browser.ask(paper) == themes[choice]
        pressed = "[...document.querySelectorAll('[aria-pressed=true]')].map(b => b.dataset.themeChoice)"
        assert browser.ask(pressed) == [choice]
    # The choice outlives the page. Chromium loads a page in another process now and then, which on a busy machine still
    # sees the choice before the last (6 of 150 reloads, and the page keeps what it saw), so a page is opened again.
    until = time.monotonic() + 5.0
    while time.monotonic() < until:
        browser.open(pages["robustness"], DESKTOP, dark=system_dark)
        if (kept := browser.ask(paper)) == themes["dark"]:
            break
    assert kept == themes["dark"]
    browser.ask("document.querySelector('[data-theme-choice=auto]').click()")


def test_both_ways_to_the_dark_theme_have_the_same_colours() -> None:
    themes = report_colours.themes()
    assert themes["dark"] == themes["system dark"]
    assert set(themes["light"]) - {"sans", "mono"} == set(themes["dark"])


@pytest.mark.parametrize("theme", report_colours.THEMES)
def test_colours_have_contrast_and_series_differ_for_the_colour_blind(theme: str) -> None:
    colours = report_colours.themes()[theme]
    series = [colours[f"series-{number}"] for number in range(1, 9)]
    for background in (colours["paper"], colours["card"]):
        for text in ("ink", "soft", "accent"):
            assert report_colours.contrast(colours[text], background) >= 4.5
        for graphic in (*series, colours["loss"]):
            assert report_colours.contrast(graphic, background) >= 3
    assert report_colours.contrast(colours["note"], colours["warn"]) >= 4.5
    assert report_colours.contrast(colours["ink"], colours["heat"]) >= 4.5
    # Lines differ in dash and marker as well; the first four are told apart by colour alone.
    for blindness in (None, *report_colours.BLINDNESS):
        for a, b in itertools.combinations(range(8), 2):
            assert report_colours.difference(series[a], series[b], blindness) > (12 if max(a, b) < 4 else 9), (a, b)


def test_reference_values_of_the_colour_measures() -> None:
    # WCAG 2.2: black on white is 21; #767676 on white is the lightest grey that reaches 4.5.
    assert report_colours.contrast("#000000", "#ffffff") == pytest.approx(21)
    assert report_colours.contrast("#767676", "#ffffff") == pytest.approx(4.54, abs=0.005)
    assert report_colours.difference("#ffffff", "#000000") == pytest.approx(100, abs=0.1)
