"""The gallery's pages and sheets, and the viewer's message where there is no display."""

from __future__ import annotations

import re

import numpy as np
import pytest
from PIL import Image

from robocasa_lerobot.cli import main
from robocasa_lerobot.envs.kitchen_env import KitchenEnv
from robocasa_lerobot.envs.kitchens.footprints import Footprint
from robocasa_lerobot.envs.scene.roles import footprint
from robocasa_lerobot.errors import UnknownNameError
from robocasa_lerobot.gallery.page import write_page
from robocasa_lerobot.gallery.scene_pictures import visitor_camera
from robocasa_lerobot.gallery.sections import SECTIONS, Tile, tiles_of, write_sheets

TILES = [
    Tile(
        f"thing {i}",
        ("round", "square")[i % 2],
        ("target", "pretrain")[i % 3 == 0],
        np.full((20, 30, 3), 40 * i, np.uint8),
    )
    for i in range(5)
]


def test_a_page_loads_nothing_and_has_every_picture_and_choice(tmp_path) -> None:
    text = write_page(tmp_path / "gallery.html", {"objects": TILES}).read_text()
    assert not re.search(r"(src|href)=[\"']?(?!data:)[\w/.:]+", text)
    assert text.count("<figure") == text.count("data:image/jpeg;base64,") == len(TILES)
    for tile in TILES:
        assert f'data-category="{tile.category}" data-split={tile.split}' in text
        assert tile.title in text
    assert "<option>round</option><option>square</option>" in text


def test_contact_sheets_hold_all_pictures(tmp_path) -> None:
    columns = SECTIONS["appliances"][2]
    paths = write_sheets("appliances", TILES, tmp_path, rows=1)
    assert len(paths) == -(-len(TILES) // columns)
    assert Image.open(paths[0]).size == (30 * columns, 20 + 16 + 12)  # "thing", and its number below


def test_a_long_caption_stands_whole_below_its_picture(tmp_path) -> None:
    tiles = [Tile(title, "round", "target", np.full((20, 90, 3), 250, np.uint8)) for title in ("ox", "x" * 30)]
    short, long = np.split(np.asarray(Image.open(*write_sheets("appliances", tiles, tmp_path))), [90], axis=1)
    written = [np.nonzero((sheet[20:] < 128).any(axis=(1, 2)))[0] for sheet in (short, long)]
    assert np.ptp(written[0]) < 12 < 24 < np.ptp(written[1])  # one line, and three


@pytest.mark.render
def test_sections_are_filtered() -> None:
    toasters = list(tiles_of("appliances", ("target",), ("toaster",)))
    assert toasters
    assert {(tile.category, tile.split) for tile in toasters} == {("toaster", "target")}
    plans = list(tiles_of("layouts", ("target",), ("galley",)))
    assert [tile.title for tile in plans] == ["layout 5: galley"]
    height, width = plans[0].picture.shape[:2]
    inside = plans[0].picture[height // 3 : -height // 3, width // 4 : -width // 4]
    assert inside.std() > 20, "a plan shows a ceiling instead of the kitchen below"
    with pytest.raises(UnknownNameError, match="layouts"):
        list(tiles_of("layout"))


def test_a_visitor_stands_in_no_wall_cabinet() -> None:
    env = KitchenEnv("StackBowlsInSink", split="target", cameras=())
    env.reset(seed=132)  # a row of cabinets is where it would stand otherwise
    camera = visitor_camera(env.scene, env.data)
    away, down = np.radians([camera.azimuth, camera.elevation])
    back = camera.distance * np.array([np.cos(away) * np.cos(down), np.sin(away) * np.cos(down), np.sin(down)])
    x, y, z = camera.lookat - back
    eye = Footprint(float(x), float(y), 0.0, (0.1, 0.1))
    for fixture in env.scene.fixtures.values():
        if abs(z - fixture.pos[2]) < fixture.height / 2:
            assert not eye.overlaps(footprint(fixture)), fixture.name


@pytest.mark.render
def test_the_command_draws_starts_as_they_are_asked_for(tmp_path, capsys) -> None:
    asked = ["--tasks=OpenDrawer", "--seeds=1", "--image-size=48", "--overview-size=64x32"]
    written = {}
    for preset, form in (("fast", "png"), ("quality", "jpg")):
        out = tmp_path / preset
        assert main(["gallery", *asked, f"--preset={preset}", f"--format={form}", f"--out={out}"]) == 0
        paths = capsys.readouterr().out.split()
        assert sorted(paths) == sorted(str(path) for path in out.rglob("*.*"))
        assert {path.rpartition(".")[2] for path in paths} == {form}
        written[preset] = [Image.open(path) for path in paths]
        assert {picture.format for picture in written[preset]} == {{"png": "PNG", "jpg": "JPEG"}[form]}
        assert [picture.size for picture in written[preset]] == [(3 * 48, 48), (64, 32)]
    fast, quality = (np.asarray(written[preset][0].convert("RGB"), float) for preset in ("fast", "quality"))
    assert np.abs(fast - quality).mean() > 3, "the presets draw alike"


@pytest.mark.render
def test_the_command_makes_sheets_and_a_page_of_sections(tmp_path, capsys) -> None:
    options = ["--show=layouts,appliances", "--split=target", "--category=galley,toaster"]
    assert main(["gallery", *options, f"--out={tmp_path}"]) == 0
    paths = capsys.readouterr().out.split()
    assert sorted(paths) == sorted(str(path) for path in tmp_path.iterdir())
    page = (tmp_path / "gallery.html").read_text()
    assert "layout 5: galley" in page
    assert 'data-category="toaster" data-split=target' in page
    assert "data-split=pretrain" not in page
    sheets = {path.rpartition("/")[2].partition("_")[0].partition(".")[0] for path in paths}
    assert {"layouts", "appliances"} <= sheets
    for path in paths:
        assert path.endswith(".html") or np.asarray(Image.open(path)).std() > 20


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--category=toaster"], "--show"),
        (["--show=layouts", "--tasks=OpenDrawer"], "--show"),
        (["--show=layouts", "--category=island,galey"], "galley"),
        (["--seeds=-1"], "from 0"),
        (["--show=tasks", "--seeds=-1"], "from 0"),
        *(
            (["--overview-size", size], "expected WIDTHxHEIGHT in pixels, 4096 at most")
            for size in ("10", "0x9", "9x99999")
        ),
    ],
)
def test_what_does_not_apply_is_said_before_any_work(options, words, tmp_path, capsys) -> None:
    assert main(["gallery", *options, f"--out={tmp_path / 'out'}"]) == 2
    assert words in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_the_viewer_says_that_there_is_no_display(monkeypatch, capsys) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    assert main(["view", "--task", "OpenDrawer"]) == 2
    assert "gallery" in capsys.readouterr().err
    assert main(["view", "--layout", "3"]) == 2
    assert "--style" in capsys.readouterr().err
