"""A demonstration by hand: a drawer is opened with a gamepad, two seconds are undone, it is reviewed and saved."""

from __future__ import annotations

import json
from pathlib import Path

import h5py
import pytest
from browser import find_chromium
from gamepad_operator import Follower, Poses
from page_support import driven_page
from teleop_support import WAIT_S, settings

from robocasa_lerobot import contract
from robocasa_lerobot.demos.recorder import record_episode
from robocasa_lerobot.demos.replay import replay
from robocasa_lerobot.envs.kitchen_env import KitchenEnv

TASK, SPLIT, SEED = "OpenDrawer", "target", 100_001
UNDONE = 2 * contract.CONTROL_HZ
STEP = "Number(document.querySelector('#g-step').textContent.split(' ')[0])"


@pytest.mark.slow
@pytest.mark.render
@pytest.mark.skipif(find_chromium() is None, reason="no Chromium on this machine ($CHROMIUM may name one)")
def test_a_drawer_is_opened_two_seconds_are_undone_and_it_is_saved(tmp_path: Path) -> None:
    env = KitchenEnv(TASK, split=SPLIT, cameras=(), terminate_on_success=False)
    shown = record_episode(env, SEED)
    env.close()
    assert shown.success
    with driven_page(settings(tmp_path, task=TASK, split=SPLIT, seed=SEED, image_size=128)) as page:
        page.click("#speed [data-value='1']")
        page.browser.until("document.querySelector('#speed [data-value=\\'1\\']').ariaChecked === 'true'")
        operator = Follower(page, Poses.of(shown))
        page.pad([0, 0, 0, 0.3])  # begins
        page.until("running")
        operator.go(len(shown.actions) // 2)

        steps = len(page.session.driven)
        page.browser.key("Backspace", True, "Backspace")
        page.browser.until(f"{STEP} <= {steps - UNDONE}")
        page.browser.key("Backspace", False, "Backspace")
        page.until("paused")
        kept = len(page.session.driven)
        assert kept <= steps - UNDONE
        operator.back(kept)

        operator.go(len(shown.actions))
        page.until("review")
        assert page.browser.ask("document.querySelectorAll('#terms .on').length") == len(shown.term_names)
        page.click("#review-speed [data-value='4']")
        page.click("#play")
        page.browser.until("document.querySelector('#play').textContent === 'Pause'")
        page.browser.until("document.querySelector('#play').textContent === 'Play'")
        page.click("#save")
        page.browser.until("document.querySelector('#saved').textContent === '1'", WAIT_S)
        page.until("done")
    file = tmp_path / f"{TASK}.hdf5"
    found = replay(file, "demo_0")
    assert (found.actions, found.states, found.same_start, found.deviation) == (True, True, True, 0.0)
    with h5py.File(file) as opened:
        told = json.loads(opened["data/demo_0"].attrs["ep_meta"])["teleop"]
    assert (told["device"], told["undos"]) == ("gamepad", 1)
    assert told["undone_steps"] >= UNDONE
