"""Kitchens that are kept: a copy is what would be built, nothing reaches back into it, and few are kept."""

from __future__ import annotations

from robocasa_lerobot.envs.kitchens.appliances.kinds.blender import Blender
from robocasa_lerobot.envs.kitchens.layout import Layout, load_layout
from robocasa_lerobot.envs.scene import kept_kitchens
from robocasa_lerobot.envs.scene.assembly import bare_kitchen
from robocasa_lerobot.envs.scene.kept_kitchens import KEPT_KITCHENS, kitchen


def _notes(layout: Layout) -> dict[str, dict[str, object]]:
    return {name: dict(vars(fixture)) for name, fixture in layout.fixtures.items()}


def test_a_kitchen_that_comes_again_is_what_would_be_built() -> None:
    built = load_layout(2)
    spec, palette = bare_kitchen(built)
    xml, added, notes = spec.to_xml(), palette.added, _notes(built)
    assert notes != _notes(load_layout(2)), "fixtures note nothing: this would prove little"
    for _ in range(4):
        layout = load_layout(2)
        spec, palette = kitchen(layout)
        assert spec.to_xml() == xml
        assert (palette.added, _notes(layout)) == (added, notes)
        # What is added to one is in no other.
        spec.worldbody.add_body(name="intruder")
        spec.assets["intruder"] = b""
        palette.plain((0.1, 0.2, 0.3, 1.0))
        next(iter(spec.geoms)).rgba = [1.0, 0.0, 0.0, 1.0]


def test_another_state_or_look_is_another_kitchen() -> None:
    for _ in range(3):
        usual, _ = kitchen(load_layout(3))
        layout = load_layout(3)
        blender = next(fixture for fixture in layout.fixtures.values() if isinstance(fixture, Blender))
        blender.with_lid = False
        bare, _ = kitchen(layout)
        fine, _ = kitchen(load_layout(3), "quality")
        assert len(bare.bodies) < len(usual.bodies)
        assert fine.visual.quality.offsamples > usual.visual.quality.offsamples


def test_few_kitchens_are_kept_and_none_that_came_once() -> None:
    for number in range(11, 11 + KEPT_KITCHENS + 2):
        kitchen(load_layout(number, 11))
    places = kept_kitchens._place.cache_info()
    assert places.currsize == places.maxsize == KEPT_KITCHENS
    # The oldest has been given up, and comes for the first time again.
    oldest = load_layout(11, 11)
    spec, _ = kitchen(oldest)
    assert spec.to_xml() == bare_kitchen(oldest)[0].to_xml()


def test_fixtures_that_cannot_be_compared_are_built_each_time() -> None:
    for _ in range(3):
        layout = load_layout(4)
        vars(next(iter(layout.fixtures.values())))["own"] = lambda: None
        assert kitchen(layout)[0].to_xml() == bare_kitchen(layout)[0].to_xml()
