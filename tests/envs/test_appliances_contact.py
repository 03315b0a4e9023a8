"""Appliances by touch: parts driven through their ranges and states reached by contact forces alone."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from appliance_rig import Bench

from robocasa_lerobot.envs.kitchens.appliances.catalogue import categories, kinds, models_in, models_of

ALL = [record.model_id for category in categories() for record in models_in(category)]
# Of every kind one model of each split, and for those with several designs one more.
SAMPLE = [next(r.model_id for r in models_of(kind, split)) for kind in kinds() for split in ("pretrain", "target")]


def each(models, *prefixes):
    wanted = [m for m in models if not prefixes or m.rsplit("_", 1)[0] in prefixes]
    fast = [m for m in wanted if m in SAMPLE]
    slow = [pytest.param(m, marks=pytest.mark.slow) for m in wanted if m not in SAMPLE]
    return pytest.mark.parametrize("model_id", [*fast, *slow])


@each(ALL)
def test_at_rest_nothing_moves_and_nothing_penetrates(model_id):
    bench = Bench(model_id)
    bench.start()
    before = bench.data.qpos.copy()
    bench.step(20)
    assert np.abs(bench.data.qpos - before).max() < 1e-3
    assert not any(bench.data.contact.dist < -0.002)
    assert bench.it.is_closed(bench.data)
    for name, region in bench.it.regions.items():
        assert min(region.half) > 0.01, name


@each(ALL)
def test_doors_drawers_and_racks_open_and_close(model_id):
    bench = Bench(model_id)
    for part in bench.it.doors:
        bench.start()
        assert bench.push(part, 1.0), f"{part} does not open"
        assert bench.push(part, 0.0, tolerance=0.004), f"{part} does not close: {bench.share(part)}"
        half = 0.5
        bench.start(**{part: half})
        bench.step(20)
        assert bench.share(part) == pytest.approx(half, abs=0.02), f"{part} does not stay where it is left"
    sliding = (*getattr(bench.it, "racks", ()), *getattr(bench.it, "sliding", ()))
    for part in sliding:
        bench.start(**dict.fromkeys(bench.it.doors, 1.0))
        assert bench.push(part, 1.0), f"{part} does not come out"
        assert bench.push(part, 0.0), f"{part} does not go in: {bench.share(part)}"


def knobs_of(bench):
    model = bench.model
    names = [model.joint(j).name for j in range(model.njnt)]
    return [name[3:-6] for name in names if name.startswith("it_knob_")]


@each(ALL, "stove", "stove_wide", "stovetop", "oven", "toaster_oven", "stand_mixer")
def test_knobs_turn_through_their_range(model_id):
    bench = Bench(model_id)
    for knob in knobs_of(bench):
        bench.start()
        if bench.it.record.category == "toaster_oven":
            bench.it.memory(bench.data)[0] = 0
        assert bench.twist(knob, 0.5), f"{knob}: {bench.share(knob)}"
        assert bench.twist(knob, 1.0), f"{knob}: {bench.share(knob)}"
        assert bench.twist(knob, 0.0), f"{knob}: {bench.share(knob)}"


@each(ALL, "stove", "stove_wide", "stovetop")
def test_burners_follow_their_knobs(model_id):
    bench = Bench(model_id)
    it = bench.it
    location = next(iter(it.burners))
    bench.start()
    assert it.burner_level(bench.data, location) == "off"
    for degrees, level, shown in ((60.0, "low", 0.62), (150.0, "high", 1.0), (5.0, "off", 0.0)):
        share = np.radians(degrees) / (1.5 * np.pi)
        assert bench.twist(f"knob_{location}", share, tolerance=0.02)
        bench.step(1)
        assert it.burner_level(bench.data, location) == level
        assert bench.share(f"burner_{location}") == pytest.approx(shown)
        assert it.state(bench.data)[f"{location}_on"] == (level != "off")


@each(ALL, "microwave")
def test_microwave(model_id):
    bench = Bench(model_id)
    bench.start()
    assert not bench.state()["on"]
    assert bench.press("start_button")
    assert bench.state()["on"]
    bench.step(20)
    assert bench.state()["on"], "stays on"
    assert bench.press("stop_button")
    assert not bench.state()["on"]
    assert bench.press("start_button")
    assert bench.push("door", 1.0)
    assert not bench.state()["on"], "off with the door open"
    assert bench.press("start_button")
    assert not bench.state()["on"], "does not start with the door open"


@each(ALL, "coffee_machine")
def test_coffee_machine(model_id):
    bench = Bench(model_id)
    bench.start()
    assert not bench.state()["on"]
    assert bench.press("start_button")
    assert bench.state()["on"]
    assert bench.share("pour") == 1.0
    assert bench.press("start_button")
    bench.step(200)
    assert bench.state()["on"], "on for good"
    assert bench.share("pour") == 0.0


@each(ALL, "toaster")
def test_toaster(model_id):
    bench = Bench(model_id)
    for side in range(bench.it.sides):
        bench.start()
        assert bench.share(f"lever{side}") < 0.02
        assert bench.push(f"lever{side}", 1.0, tolerance=0.08)
        assert bench.state()[f"on{side}"]
        bench.step(20)
        assert bench.share(f"lever{side}") > 0.97, "held down"
        left = bench.it.memory(bench.data)[2 * side]
        assert 450 < left < 500
        bench.step(int(left) - 1)
        assert bench.state()[f"on{side}"]
        bench.step(1)
        assert not bench.state()[f"on{side}"]
        bench.step(20)
        assert bench.share(f"lever{side}") < 0.05, "popped"
        assert bench.push(f"lever{side}", 1.0, tolerance=0.08), "works again"
        assert bench.state()[f"on{side}"]


@each(ALL, "electric_kettle")
def test_electric_kettle(model_id):
    bench = Bench(model_id)
    bench.start()
    bench.step(20)
    assert bench.share("lid") < 0.01, "the lid is held"
    assert bench.press("lid_button")
    bench.step(30)
    assert bench.share("lid") > 0.95, "the lid sprang open"
    assert bench.push("lid", 0.0, tolerance=0.008)
    bench.step(10)
    assert bench.share("lid") < 0.01, "and is caught"
    assert bench.push("switch", 1.0, tolerance=0.04)
    assert bench.state()["on"]
    bench.step(20)
    assert bench.share("switch") > 0.95
    bench.step(490)
    assert not bench.state()["on"]
    assert bench.share("switch") < 0.1, "came up"


@each(ALL, "blender")
def test_blender(model_id):
    bench = Bench(model_id)
    bench.start()
    bench.step(20)
    assert bench.it.lid_on(bench.data)
    assert bench.push("button", 1.0, leave=False)
    assert not bench.state()["on"], "while it is pressed"
    bench.retreat()
    assert bench.state()["on"]
    assert bench.press("button")
    assert not bench.state()["on"]
    assert bench.press("button")
    assert bench.state()["on"]
    lift_lid(bench)
    assert not bench.it.lid_on(bench.data)
    assert not bench.state()["on"], "off without its lid"
    assert bench.press("button")
    assert not bench.state()["on"]


def lift_lid(bench):
    """Grip the lid's knob with the pincer and lift it."""
    body = bench.data.body(bench.it.lid)
    start = body.xpos + np.array([0, 0, 0.008 + 0.020])
    bench.grip(start, np.array([1.0, 0, 0, 0]))
    for height in np.linspace(0.0, 0.15, 40):
        bench.data.ctrl[bench.model.actuator("lift").id] = height
        bench.step()
    assert bench.data.body(bench.it.lid).xpos[2] > start[2] + 0.08, "the lid hangs in the pincer"


@each(ALL, "stand_mixer")
def test_stand_mixer(model_id):
    bench = Bench(model_id)
    bench.start()
    assert bench.push("head", 1.0, tolerance=0.008), bench.share("head")
    bench.step(20)
    assert bench.share("head") > 0.99, "stays up"
    assert bench.push("head", 0.0, tolerance=0.008)
    assert bench.press("head_lock")
    bench.step(5)
    assert bench.state()["locked"], "the lock stays in"
    assert not bench.push("head", 1.0, seconds=1.0), "and holds the head"
    assert bench.share("head") < 0.02
    assert bench.press("head_lock")
    bench.step(10)
    assert not bench.state()["locked"], "pressed again it comes out"
    assert bench.push("head", 1.0)


@each(ALL, "toaster_oven")
def test_toaster_oven(model_id):
    bench = Bench(model_id)
    bench.start(door=0.006)
    bench.step(3)
    assert bench.share("door") < 0.001, "snaps shut"
    assert bench.twist("knob_time", 0.4)
    assert bench.state()["on"]
    before = bench.share("knob_time")
    bench.step(300)
    assert bench.share("knob_time") == pytest.approx(before - 0.1, abs=0.006)
    bench.step(1000)
    assert bench.share("knob_time") == pytest.approx(0.0, abs=1e-3)
    assert not bench.state()["on"]


@each(ALL, "sink")
def test_sink(model_id):
    bench = Bench(model_id)
    it, data = bench.it, bench.data
    bench.start()
    assert not it.water_on(data)
    assert bench.state()["temperature"] == pytest.approx(0.4)
    assert bench.push("handle", 0.40), "the lever lifts"
    assert it.water_on(data)
    bench.step(1)
    shown = [s for s in ("cold_low", "cold_high", "hot_low", "hot_high") if it.lit(data, f"water_{s}")]
    assert shown == ["cold_low"]
    assert bench.push("handle", 0.9)
    assert bench.state()["high"]
    assert it.lit(data, "water_cold_high")
    assert bench.push("handle_temp", 1.0)
    assert bench.state()["hot"]
    assert it.lit(data, "water_hot_high")
    assert bench.push("handle_temp", 0.0)
    assert not bench.state()["hot"]
    assert bench.push("handle", 0.0)
    assert not it.water_on(data)
    assert not any(it.lit(data, f"water_{s}") for s in ("cold_low", "cold_high", "hot_low", "hot_high"))
    # Its range begins below zero, so that a share of 0 is the far right.
    assert bench.push("spout", 0.0, tolerance=0.1)
    assert it.spout_side(data) == "right"
    assert bench.push("spout", 1.0, tolerance=0.1)
    assert it.spout_side(data) == "left"


@each(ALL, "sink")
def test_water_falls_into_the_basin(model_id):
    bench = Bench(model_id)
    bench.start()
    it, data = bench.it, bench.data
    tip = data.site("it_water").xpos
    low = it.basin.world(data, (0, 0, -it.basin.half[2]))[2] + 0.03
    below = np.array([tip[0], tip[1], low])
    assert it.basin.contains(data, below)
    assert not it.under_water(data, below, 0.03)
    it.set_water(data, on=True)
    mujoco.mj_forward(bench.model, data)
    assert it.under_water(data, below, 0.03)
    assert not it.under_water(data, below + np.array([0.05, 0, 0]), 0.03)
    assert not it.under_water(data, tip + np.array([0, 0, 0.01]), 0.03)
