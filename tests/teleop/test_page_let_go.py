"""What the page lets go of and what it holds on to: drags, a held undo, an enlarged picture, a running episode."""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np
import pytest
from browser import find_chromium
from page_support import Page, driven_page
from teleop_support import WAIT_S, settings

pytestmark = [
    pytest.mark.render,
    pytest.mark.skipif(find_chromium() is None, reason="no Chromium on this machine ($CHROMIUM may name one)"),
]
STEPS = 16
PICTURE = "[data-camera=robot0_agentview_left]"
LAID_OUT = "[...document.querySelectorAll('.tiles.one-large .tile.large')].map(tile => tile.dataset.camera)"


@pytest.fixture(scope="module")
def opened(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    with driven_page(settings(tmp_path_factory.mktemp("page"))) as page:
        yield page


@pytest.fixture
def page(opened: Page) -> Page:
    opened.fresh()
    return opened


def middle(page: Page, selector: str) -> tuple[float, float]:
    left, top, width, height = page.browser.box(selector)
    return left + width / 2, top + height / 2


def stands(page: Page) -> None:
    """Steps go on, and the hand stays where it is."""
    page.steps(6)
    at_rest = page.hand
    page.steps(6)
    assert np.abs(page.hand - at_rest).max() < 0.01


def until_scene(page: Page, count: int) -> None:
    deadline = time.monotonic() + WAIT_S
    while page.session.scenes < count or page.phase != "ready":
        assert time.monotonic() < deadline, f"no further kitchen: {page.phase}"
        time.sleep(0.05)


@pytest.mark.parametrize("lost", ["window.dispatchEvent(new Event('blur'))", "pointer"])
def test_a_drag_ends_where_everything_is_let_go(page: Page, lost: str) -> None:
    browser = page.browser
    x, y = middle(page, f"{PICTURE} canvas")
    browser.mouse("mousePressed", x, y)
    browser.mouse("mouseMoved", x, y - 45)
    page.steps(4)
    if lost == "pointer":  # it went up where the page could not see it
        browser.ask(
            f"document.querySelector({PICTURE + ' canvas'!r}).dispatchEvent("
            f"new PointerEvent('pointermove', {{buttons: 0, clientX: {x}, clientY: {y - 60}}}))"
        )
    else:
        browser.ask(lost)
        page.until("paused")
        browser.ask("document.querySelector('#pause').click()")  # the mouse is still down
        page.until("running")
    for away in (60, 70, 80):
        browser.mouse("mouseMoved", x, y - away)
        page.steps(2)
    stands(page)
    browser.mouse("mouseReleased", x, y - 80)


def test_undo_is_held_in_the_review_for_as_long_as_its_button(page: Page) -> None:
    page.hold("KeyR", 3 * STEPS)
    page.click("#end")
    page.until("review")
    steps = len(page.session.driven)
    x, y = middle(page, "#review-undo")
    page.browser.mouse("mousePressed", x, y)
    page.browser.until("Number(document.querySelector('#g-step').textContent.split(' ')[0]) <= " + str(steps - 30))
    assert page.phase == "rewinding"
    page.browser.mouse("mouseReleased", x, y)
    page.until("paused")
    assert len(page.session.driven) <= steps - 30
    assert page.browser.ask("document.querySelector('#undo').checkVisibility()")


@pytest.mark.parametrize("button", ["redo", "finish"])
def test_a_running_episode_is_not_lost_at_one_click(page: Page, button: str) -> None:
    page.hold("KeyR", 3)
    scenes = page.session.scenes
    page.click(f"#{button}")
    page.browser.until("document.querySelector('#leave-dialog').open")
    page.until("paused")  # nobody can drive now
    page.click("#leave-dialog [value=cancel]")
    page.until("running")
    page.browser.until("document.activeElement === document.body")  # Space is the robot's, not that button's
    page.hold("KeyR", 3)
    page.until("running")
    assert page.session.scenes == scenes
    page.click("#end")
    page.until("review")
    page.browser.ask("seek.value = 0, seek.dispatchEvent(new Event('input'))")  # its first step is shown
    page.browser.until("document.querySelector('#g-step').textContent.startsWith('0 ')")
    page.click("#review-redo")
    page.click("#leave-ok")
    page.until("ready")
    assert page.session.scenes == scenes + 1
    page.click("#redo")  # nothing is lost by it
    until_scene(page, scenes + 2)


def test_a_picture_stays_large_when_the_line_is_there_again(page: Page) -> None:
    browser = page.browser
    browser.ask(f"document.querySelector({PICTURE + ' .tile-large'!r}).click()")
    assert browser.ask(LAID_OUT) == ["robot0_agentview_left"]
    browser.ask("document.querySelector('.tile').dataset.old = 'yes'")
    page.line.cut()
    browser.until("document.querySelector('.tile') && !document.querySelector('.tile').dataset.old")
    assert browser.ask(LAID_OUT) == ["robot0_agentview_left"]
    browser.ask(f"document.querySelector({PICTURE + ' .tile-large'!r}).click()")
    assert not browser.ask("document.querySelector('.one-large')")
    browser.messages.clear()


def test_words_that_are_selected_and_dragged_leave_the_mouse_to_the_page(page: Page) -> None:
    """The browser's own drag of them would end every gesture."""
    browser = page.browser
    browser.ask("window.ended = 0, addEventListener('pointercancel', () => window.ended++, true)")
    browser.ask("getSelection().selectAllChildren(document.querySelector('#instruction'))")
    left, top, _, height = browser.box("#instruction")
    x, y = left + 20, top + height / 2
    browser.mouse("mousePressed", x, y)
    for away in (2, 5, 15, 40, 80):
        browser.mouse("mouseMoved", x + away, y + away)
        time.sleep(0.05)
    browser.mouse("mouseReleased", x + 80, y + 80)
    assert browser.ask("ended") == 0
    page.click("#mode [data-value=base]")
    browser.until("document.querySelector('#mode [data-value=base]').ariaChecked === 'true'")
    page.click("#mode [data-value=arm]")
    browser.until("document.querySelector('#mode [data-value=arm]').ariaChecked === 'true'")


def test_a_second_click_on_the_button_over_the_pictures_sends_the_hand_nowhere(page: Page) -> None:
    page.hold("KeyR", 3)
    page.click("#pause")
    page.until("paused")
    reached = page.browser.ask(
        """
        (async () => {
          const button = document.querySelector("#veil-button");
          const { x, y, width, height } = button.getBoundingClientRect();
          const at = { clientX: x + width / 2, clientY: y + height / 2, pointerId: 1, bubbles: true };
          button.click();
          while (button.checkVisibility()) await new Promise(requestAnimationFrame);
          const behind = document.elementFromPoint(at.clientX, at.clientY);
          for (const kind of ["pointerdown", "pointerup"]) behind.dispatchEvent(new PointerEvent(kind, at));
          return behind.tagName;
        })()
        """
    )
    assert reached == "CANVAS"
    page.steps(6)
    assert not any(origin.assisted for origin in page.session.driven.origins)
