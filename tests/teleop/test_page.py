"""The operator's page in a real Chromium, with keys, mouse, fingers, a gamepad and a bad line, on a real session."""

from __future__ import annotations

import copy
import json
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from browser import Browser, find_chromium
from page_support import Page, driven_page, middle_of
from teleop_support import served, settings

from robocasa_lerobot.demos.motion import base_pose
from robocasa_lerobot.envs.rendering import SceneRenderer
from robocasa_lerobot.teleop.client import TeleopClient

pytestmark = [
    pytest.mark.render,
    pytest.mark.skipif(find_chromium() is None, reason="no Chromium on this machine ($CHROMIUM may name one)"),
]
STEPS = 16
KEYS_PAGE = Path(__file__).parents[2] / "docs" / "teleoperation_keys.md"
PIXELS = "[...document.querySelectorAll('.tile canvas')].map(c => c.getContext('2d').getImageData(9, 9, 30, 30).data)"

SWITCHES = {
    "KeyB": "#mode [data-value=base]",
    "KeyV": "#motion-frame [data-value=camera]",
    "Digit3": "#speed [data-value='1']",
}
# Words that are hard to read: contrast (WCAG 2) with the nearest ground below 4.5. Words on pictures have their own.
FAINT = """
(() => {
  const channels = (colour) => colour.match(/[\\d.]+/g).map(Number);
  const light = (colour) => channels(colour).slice(0, 3).map((c) => c / 255)
    .map((c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4))
    .reduce((sum, c, i) => sum + c * [0.2126, 0.7152, 0.0722][i], 0);
  const ground = (e) => (!e ? "rgb(255, 255, 255)" : (channels(getComputedStyle(e).backgroundColor)[3] ?? 1) > 0.99
    ? getComputedStyle(e).backgroundColor : ground(e.parentElement));
  const own = (e) => [...e.childNodes].some((n) => n.nodeType === 3 && n.textContent.trim());
  return [...document.querySelectorAll("body *")]
    .filter((e) => own(e) && e.checkVisibility() && !e.closest("figure, .veil, :disabled, .sr"))
    .map((e) => [e.textContent.trim(), light(getComputedStyle(e).color), light(ground(e))])
    .map(([words, a, b]) => [words, (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05)])
    .filter(([, contrast]) => contrast < 4.5);
})()
"""
NAMELESS = """
    [...document.querySelectorAll("button, select, input, #map")].filter((e) => e.checkVisibility()
    && !(e.textContent.trim() || e.ariaLabel || e.labels?.length || e.title)).map((e) => e.outerHTML)
"""


@pytest.fixture(scope="module")
def opened(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    out = tmp_path_factory.mktemp("page")
    with driven_page(settings(out)) as page:
        yield page


@pytest.fixture
def page(opened: Page) -> Page:
    opened.fresh()
    return opened


def test_it_shows_the_kitchen_and_asks_nobody_else(page: Page) -> None:
    browser, session = page.browser, page.session
    assert page.text("#instruction") == session.driven.info["instruction"]
    assert [len(set(data)) > 2 for data in browser.ask(f"{PIXELS}.map(d => [...d])")] == [True] * 4
    assert page.browser.ask("document.querySelectorAll('#terms li').length") == len(
        session.driven.info["success_terms"]
    )
    browser.until("document.querySelector('#map').getContext('2d').getImageData(5, 5, 1, 1).data[3] === 255")
    shown = [float(number) for number in page.text("#g-hand").split()]
    np.testing.assert_allclose(shown, page.hand, atol=0.006)
    assert all(
        request.startswith("http://127.0.0.1") or request.startswith("ws://127.0.0.1") for request in browser.requests
    )
    assert browser.messages == []
    assert len(session.driven) == 0  # nothing counts before the first input


def test_every_control_has_a_name_and_none_is_wider_than_the_window(page: Page) -> None:
    nameless = page.browser.ask(NAMELESS)
    assert nameless == []
    assert page.browser.ask("document.documentElement.scrollWidth <= innerWidth")


def test_words_stand_out_in_light_and_dark(page: Page) -> None:
    for dark in (False, True):
        page.browser.theme(dark)
        assert page.browser.ask("matchMedia('(prefers-color-scheme: dark)').matches") is dark
        assert page.browser.ask(FAINT) == []


def test_a_held_key_moves_the_hand_until_it_is_let_go(page: Page) -> None:
    before = page.hand
    page.hold_until("KeyR", lambda: page.hand[2] - before[2] > 0.04)
    moved = page.rest() - before
    assert 0.04 < moved[2] < 0.20
    assert np.abs(moved[:2]).max() < 0.03
    assert page.text("#g-input") == "keyboard"


def test_commands_by_key_and_another_layout(page: Page) -> None:
    browser = page.browser
    for code, selector in (
        ("KeyB", "#mode [data-value=base]"),
        ("KeyV", "#motion-frame [data-value=camera]"),
        ("Digit3", "#speed [data-value='1']"),
    ):
        browser.key(code, True)
        browser.key(code, False)
        browser.until(f"document.querySelector({selector!r}).ariaChecked === 'true'")
    before = base_pose(page.session.env.data)
    page.hold_until("KeyQ", lambda: base_pose(page.session.env.data)[1] - before[1] > 0.1)
    browser.ask("preset.value = 'robocasa', preset.dispatchEvent(new Event('change'))")
    assert page.text(".key[data-name=gripper]") == "Space"
    closed = page.session.driver.steering.closed
    page.hold_until("Space", lambda: page.session.driver.steering.closed != closed)
    browser.until(f"document.querySelector('#gripper').ariaPressed === '{str(not closed).lower()}'")
    # Give the key of one thing to another: the two change places.
    page.browser.ask("document.querySelector('.key[data-name=up]').click()")
    browser.key("KeyB", True)
    browser.key("KeyB", False)
    assert (page.text(".key[data-name=up]"), page.text(".key[data-name=mode]")) == ("B", ";")
    browser.ask("preset.value = 'wasd', preset.dispatchEvent(new Event('change'))")
    assert page.text(".key[data-name=up]") == "R"
    for kind, value in (("mode", "arm"), ("motion-frame", "base"), ("speed", "0.5")):
        page.click(f'#{kind} [data-value="{value}"]')


def test_the_keys_that_are_written_down_are_those_of_the_page(page: Page) -> None:
    rows = [line.split("|") for line in KEYS_PAGE.read_text(encoding="utf-8").splitlines() if line.startswith("| ")]
    for column, preset in ((2, "robocasa"), (1, "wasd")):
        page.browser.ask(f"preset.value = '{preset}', preset.dispatchEvent(new Event('change'))")
        shown = page.browser.ask("[...document.querySelectorAll('.key')].map(key => key.textContent)")
        written = {word for row in rows[1:] for word in row[column + 1].split()}
        assert {"Backspace" if key == "⌫" else key for key in shown} == written


def test_a_lost_focus_lets_everything_go(page: Page) -> None:
    browser = page.browser
    browser.key("KeyR", True)
    page.steps(4)
    browser.ask("window.dispatchEvent(new Event('blur'))")
    page.until("paused")
    assert page.session.pause == "focus"
    assert page.session.driver._held.moves is False
    count = len(page.session.driven)
    browser.key("KeyR", True, repeat=True)  # still down: it says so again and again
    time.sleep(0.4)
    assert (page.phase, len(page.session.driven)) == ("paused", count)
    browser.key("KeyR", False)
    page.click("#pause")
    page.until("running")


def test_backspace_goes_back_and_a_key_goes_on(page: Page) -> None:
    page.hold("KeyR", 2 * STEPS)
    low, before = page.hand[2], len(page.session.driven)
    page.hold_until("KeyR", lambda: page.hand[2] > low + 0.08 and len(page.session.driven) >= before + STEPS)
    high, steps = page.hand[2], len(page.session.driven)
    page.browser.key("Backspace", True, "Backspace")
    page.browser.until("Number(document.querySelector('#g-step').textContent.split(' ')[0]) <= " + str(steps - 30))
    page.wait(lambda: page.hand[2] < high - 0.05)
    page.browser.key("Backspace", False, "Backspace")
    page.until("paused")
    kept = len(page.session.driven)
    assert kept <= steps - 30
    assert page.hand[2] < high - 0.05
    assert page.session.driven.undos == 1
    page.hold("KeyF", 3)
    assert len(page.session.driven) >= kept + 3
    page.until("running")


def test_late_pictures_stop_the_robot_until_they_come_again(page: Page) -> None:
    browser = page.browser
    browser.key("KeyR", True)
    page.steps(4)
    page.line.delay_s = 1.5
    try:
        browser.until("document.body.dataset.locked === 'stale'")
        page.until("paused")
        assert page.session.pause == "stale"
        browser.until("document.querySelector('#veil-title').textContent.includes('late')")
        seen_until = time.monotonic() + 3.0
        while time.monotonic() < seen_until:
            assert not page.offers_to_go_on  # time would stop again at once
    finally:
        page.line.delay_s = 0.0
    page.go_on()
    page.steps(1)
    height = page.hand[2]
    page.steps(8)  # the key is still down, and counts again only once it was up
    assert abs(page.hand[2] - height) < 0.02
    browser.key("KeyR", False)


def test_a_lost_line_is_taken_up_again_with_nothing_held(page: Page) -> None:
    browser = page.browser
    browser.key("KeyR", True)
    page.steps(4)
    page.line.cut()
    browser.until("document.querySelector('#veil-title').textContent === 'No line to the kitchen'")
    page.until("paused")
    assert page.session.pause == "disconnected"
    page.click("#veil-button")
    page.until("running")
    page.steps(3)
    height = page.hand[2]
    page.steps(8)
    assert abs(page.hand[2] - height) < 0.02
    browser.key("KeyR", False)
    browser.messages.clear()


def test_a_gamepad_drives_base_and_hand(page: Page) -> None:
    before = page.hand
    page.gesture(lambda: page.pad([0, 0, 0, -1]), page.pad, lambda: page.hand[2] - before[2] > 0.04)
    page.pad([0, 0.08, 0, 0])  # inside the dead zone
    assert 0.04 < page.rest()[2] - before[2] < 0.20
    page.pad(b2=1)
    page.browser.until("document.querySelector('#mode [data-value=base]').ariaChecked === 'true'")
    start = np.array(base_pose(page.session.env.data)[0])

    def gone() -> bool:
        return bool(np.linalg.norm(np.array(base_pose(page.session.env.data)[0]) - start) > 0.05)

    page.gesture(lambda: page.pad([0, 1, 0, 0]), page.pad, gone)
    assert page.text("#g-input") == "gamepad"
    page.browser.ask("pad.connected = false")
    page.click("#mode [data-value=arm]")


def test_dragging_in_a_picture_and_turning_the_wheel(page: Page) -> None:
    browser = page.browser
    left, top, width, height = browser.box("[data-camera=robot0_agentview_left] canvas")
    x, y = left + width / 2, top + height / 2
    before = page.hand

    def drag() -> None:
        browser.mouse("mousePressed", x, y)
        browser.mouse("mouseMoved", x, y - 45)

    page.gesture(drag, lambda: browser.mouse("mouseReleased", x, y - 45), lambda: page.hand[2] - before[2] > 0.03)
    page.rest()
    count = len(page.session.driven)

    def by_mouse() -> bool:
        return any(origin.device == "mouse" for origin in page.session.driven.origins[count:])

    page.gesture(lambda: browser.mouse("mouseWheel", x, y, deltaX=0, deltaY=-100), lambda: None, by_mouse)
    assert page.text("#motion-frame [aria-checked=true]") == "robot"  # a drag's frame is its own


@pytest.mark.parametrize("pixels", [108, 155])
def test_a_straight_drag_commands_no_more_than_everything(page: Page, pixels: int) -> None:
    """Of these lengths the quotient is a hair above 1, which the kitchen refuses together with the page."""
    browser = page.browser
    left, top, width, height = browser.box("[data-camera=robot0_agentview_left] canvas")
    x, y = left + width / 2, top + height / 2
    browser.mouse("mousePressed", x, y)
    browser.mouse("mouseMoved", x, y - pixels)
    page.steps(4)
    browser.mouse("mouseReleased", x, y - pixels)
    page.steps(2)
    assert not page.session.pause


def test_a_discard_that_was_thought_better_of_discards_nothing(page: Page) -> None:
    """Though the one before was meant: a dialog that is closed by Escape says what it said the last time."""
    ask = page.browser.ask
    page.hold("KeyR", 3)
    ask("document.querySelector('#discard-dialog').returnValue = 'ok'")
    page.click("#discard")
    page.browser.until("document.querySelector('#discard-dialog').open")
    ask("document.querySelector('#discard-dialog').close()")
    page.browser.until("!document.querySelector('#discard-dialog').open")
    page.hold("KeyR", 3)
    assert page.session.phase == "running"


def test_a_click_on_the_map_drives_there(page: Page) -> None:
    steps = "document.querySelector('#g-step').textContent"
    start = np.array(base_pose(page.session.env.data)[0])
    spot = page.session.map
    yaw = base_pose(page.session.env.data)[1]
    goal = start[:2] - 0.25 * np.array([np.cos(yaw), np.sin(yaw)])  # backwards, away from the counter
    left, top, width, _ = page.browser.box("#map")
    scale = width / spot.width / spot.metres_per_pixel
    at = left + (goal[0] - spot.left) * scale, top + (spot.top - goal[1]) * scale
    for kind in ("mousePressed", "mouseReleased"):
        page.browser.mouse(kind, *at)
    page.browser.until(f"{steps} !== '0 / {page.session.env.horizon}'")
    page.browser.until(
        f"!document.querySelector('#stop-assist').checkVisibility() && Number({steps}.split(' ')[0]) > 5"
    )
    assert np.linalg.norm(np.array(base_pose(page.session.env.data)[0])[:2] - goal) < 0.08
    assert any(origin.assisted for origin in page.session.driven.origins)


def test_a_click_in_a_picture_asks_for_what_is_there(page: Page) -> None:
    """One place that shows the robot, and one that shows something else: each has its own answer."""
    camera, env = "robot0_agentview_right", page.session.env
    renderer = SceneRenderer(env.model, 64, 64)
    try:
        geoms = renderer.geometry(copy.copy(env.data), camera)[1]
    finally:
        renderer.close()
    bodies = env.model.geom_bodyid[geoms]
    robot = env.scene.subtree(env.robot.names.base)[bodies] & (geoms >= 0)
    loose = np.any([env.scene.subtree(name)[bodies] for name in env.scene.objects] or [robot], axis=0)
    left, top, width, height = page.browser.box(f"[data-camera={camera}] canvas")
    answers = "[...document.querySelectorAll('#notes p')].map(p => p.textContent).filter(t => /above|itself/.test(t))"
    before = page.browser.ask(f"{answers}.at(-1)")
    for seen in (robot, ~robot & ~loose & (geoms >= 0)):
        row, column = middle_of(seen)
        root = env.model.body(int(env.model.body_rootid[bodies[row, column]])).name
        x, y = left + (column + 0.5) / 64 * width, top + (row + 0.5) / 64 * height

        expected = "that is the robot itself" if seen is robot else f"reaching above {root}"
        said = page.answer(x, y, f"{answers}.at(-1) !== {json.dumps(before)} && {answers}.at(-1)")
        assert said == expected
        before = said
    page.hold("KeyR", 2)  # any input ends it
    page.browser.until("!document.querySelector('#stop-assist').checkVisibility()")


def test_fingers_on_the_sticks(page: Page) -> None:
    browser = page.browser
    browser.open(browser.ask("location.href"), 390, 844)
    page.until("ready")
    before = page.hand
    left, top, width, height = browser.box("#stick-right")
    x, y = left + width / 2, top + height / 2

    def push() -> None:
        browser.touch("touchStart", (x, y))
        browser.touch("touchMove", (x, y - 60))

    page.gesture(push, lambda: browser.touch("touchEnd"), lambda: page.hand[2] - before[2] > 0.04)
    assert 0.04 < page.rest()[2] - before[2] < 0.20
    assert page.text("#g-input") == "touch"
    assert browser.ask("document.documentElement.scrollWidth <= innerWidth")


@pytest.mark.slow
def test_a_second_page_watches_until_it_can_take_over(tmp_path: Path) -> None:
    program = find_chromium()
    assert program is not None
    with Browser(program) as browser, served(settings(tmp_path)) as session:
        with TeleopClient(session.address) as operator:
            operator.until_phase("ready")
            browser.with_focus()
            browser.open(session.address)
            browser.until("document.body.dataset.phase === 'ready' && role.textContent === 'watching'")
            for code in ("KeyW", "Space"):
                browser.key(code, True)
                browser.key(code, False)
            assert browser.ask(
                "[...document.querySelectorAll('.transport button')].every(b => b.disabled || !b.checkVisibility())"
            )
            assert not browser.ask("take.checkVisibility()")
            operator.send("input", device="keyboard", arm=[0, 0, 1, 0, 0, 0])
            browser.until("document.body.dataset.phase === 'running'")
        browser.until("take.checkVisibility()")
        browser.ask("take.click()")
        browser.until("role.textContent === 'you drive'")


@pytest.mark.slow
def test_a_policy_is_shown_taken_over_from_and_given_back_to(tmp_path: Path) -> None:
    with driven_page(settings(tmp_path), policy="demonstrator") as page:
        state = "document.querySelector('#policy-state').textContent"
        assert page.text("#policy-name") == "demonstrator"
        page.click("#policy-start")
        page.until("running")
        page.browser.until(f"{state} === 'autonomous'")
        page.hold("KeyR", 3)
        page.browser.until(f"{state} === 'correcting'")
        assert page.text("#interventions") == "1 intervention"
        page.browser.key("KeyP", True)
        page.browser.key("KeyP", False)
        page.browser.until(f"{state} === 'autonomous'")
