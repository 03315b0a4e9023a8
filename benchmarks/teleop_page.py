"""Driving by hand with a page attached: does time keep up, what does a step cost, how old is what the operator sees?

The command that a user runs, in a full kitchen, and its page in a headless Chromium on the same machine, driven by a
gamepad that is moved by a script in the page: hand and base in turn, without a break.

    python benchmarks/teleop_page.py --seconds 60
"""

from __future__ import annotations

import argparse
import json
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import common

from robocasa_lerobot.errors import UserError

OUTPUT = common.RESULTS / "teleop_page.json"
TASK, SEED = "PickPlaceCounterToSink", 100_000
READY_S, SAMPLE_S = 120.0, 0.5
# Slow circles, so that the arm neither rests nor leaves its reach; every eight seconds the other mode.
HANDS = """
const buttons = Array.from({length: 17}, () => ({pressed: false, touched: false, value: 0}));
const pad = {id: "script", index: 0, connected: true, mapping: "standard", axes: [0, 0, 0, 0], buttons};
let moving = false;
window.begin = () => { moving = true; };
navigator.getGamepads = () => {
  const t = performance.now() / 1000;
  const on = moving ? 1 : 0;
  pad.axes = [on * Math.sin(2 * t), on * Math.cos(2 * t), on * 0.5 * Math.sin(t), on * 0.6 * Math.cos(3 * t)];
  buttons[2].pressed = moving && t % 8 < 0.2;
  return [pad, null, null, null];
};
"""
GAUGES = """
(number => ({
  real_time: number("g-real"), step_ms: number("g-cost"), age_ms: number("g-age"), step: number("g-step"),
  phase: document.body.dataset.phase,
}))(id => parseFloat(document.getElementById(id).textContent.replace("× ", "")) || null)
"""


def parse(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """The command's options."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=60.0, help="of driving (default 60)")
    parser.add_argument("--output", type=Path, default=OUTPUT, help="JSON file to write")
    return parser.parse_args(arguments)


def drive(address: str, seconds: float) -> list[dict[str, Any]]:
    """What the page's gauges say, twice a second, while it drives."""
    sys.path.insert(0, str(common.REPOSITORY / "tests" / "support"))
    from browser import Browser, find_chromium

    program = find_chromium()
    if program is None:
        raise UserError("no Chromium on this machine; $CHROMIUM may name one.")
    with Browser(program) as browser:
        browser.with_focus()
        browser.before_load(HANDS)
        browser.open(address)
        browser.until("document.body.dataset.phase === 'ready'", READY_S)
        browser.ask("begin()")
        browser.until("document.body.dataset.phase === 'running'", READY_S)
        time.sleep(3.0)  # the pace is that of the last two seconds
        samples, until = [], time.monotonic() + seconds
        while time.monotonic() < until:
            samples.append(browser.ask(GAUGES))
            time.sleep(SAMPLE_S)
        return samples


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print and write."""
    options = parse(arguments)
    others = common.busy_share()
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "robocasa_lerobot.cli", "teleop", f"--task={TASK}", f"--seed={SEED}"]
        command += ["--port=0", f"--out={folder}"]
        server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        try:
            assert server.stdout is not None
            found = re.search(r"open (\S+)", server.stdout.readline())
            if found is None:
                raise UserError("the command printed no address; run it by itself to see why.")
            samples = drive(found[1], options.seconds)
        finally:
            server.send_signal(signal.SIGINT)
            server.wait(60)
    driven = [s for s in samples if s["phase"] == "running"]
    if not driven:
        raise UserError(f"nothing was driven: {samples[-1]}")
    figures = {
        name: common.spread([s[name] for s in driven if s[name] is not None])
        for name in ("real_time", "step_ms", "age_ms")
    }
    steps = driven[-1]["step"] - driven[0]["step"]
    body = {
        "task": TASK,
        "seconds": options.seconds,
        "steps": steps,
        "share_running": len(driven) / len(samples),
        "ratios": {"real_time": figures["real_time"]["median"]},
        "figures": figures,
        "others_busy_share": others,
        "machine": common.machine(),
        "versions": common.versions("mujoco", "numpy", "aiohttp"),
    }
    common.write_result(options.output, "teleop_page", body)
    rows = [[name, *(f"{f[key]:.2f}" for key in ("min", "median", "max"))] for name, f in figures.items()]
    print(common.table(["", "min", "median", "max"], rows))
    print(json.dumps({key: body[key] for key in ("steps", "share_running", "others_busy_share")}))
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except UserError as error:
        sys.exit(f"{Path(__file__).name}: {error}")
