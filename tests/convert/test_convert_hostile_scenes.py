"""Scenes that name files outside the asset roots, nest without end, or lack their meshes."""

from __future__ import annotations

import os
from pathlib import Path

import h5py
import pytest
from convert_support import SCENE, leftovers, write_demos

from robocasa_lerobot import contract
from robocasa_lerobot.convert.pipeline import convert
from robocasa_lerobot.convert.reading import hdf5
from robocasa_lerobot.convert.reading.demo_file import DemoFile, RejectedEpisodeError
from robocasa_lerobot.convert.reading.mjcf import AssetFinder, loadable
from robocasa_lerobot.convert.reading.mjcf_limits import MAX_DEPTH
from robocasa_lerobot.convert.settings import ConversionSettings
from robocasa_lerobot.errors import UserError

SETTINGS = ConversionSettings()
STEPS = 6
CAMERA = f"obs/{contract.CAMERAS[0]}_image"


def _mjcf(inside: str) -> str:
    return f"<mujoco>{inside}<worldbody/></mujoco>"


_NESTED = f"<mujoco><worldbody>{'<body>' * 20_000}{'</body>' * 20_000}</worldbody></mujoco>"
_LAUGHS = '<!DOCTYPE l [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;">]>'
SCENES: dict[str, tuple[str, str]] = {
    "entities that multiply": (f"{_LAUGHS}<mujoco model='&b;'/>", "entities"),
    "an entity that is a file": ('<!DOCTYPE x [<!ENTITY a SYSTEM "file:///etc/passwd">]><mujoco>&a;</mujoco>', "entit"),
    "include": ('<mujoco><include file="/etc/passwd"/></mujoco>', "<include>"),
    "include without a file": ("<mujoco><include/></mujoco>", "<include>"),
    "attached model": (_mjcf('<asset><model name="m" file="/etc/passwd"/></asset>'), "<model>"),
    "attach": (_mjcf('<worldbody><attach model="m" prefix="p"/></worldbody>'), "<attach>"),
    "plugin": (_mjcf('<extension><plugin plugin="mujoco.elasticity.cable"/></extension>'), "<extension>"),
    "flexible body from a file": (
        _mjcf('<worldbody><flexcomp name="f" file="/etc/passwd"/></worldbody>'),
        "<flexcomp>",
    ),
    "any element with a file": (_mjcf('<statistic file="/etc/passwd"/>'), "<statistic>"),
    "endless nesting": (_NESTED, f"{MAX_DEPTH} deep"),
    "endless text": ("<mujoco>" + " " * (hdf5.MAX_TEXT_BYTES + 1) + "</mujoco>", "characters"),
    "endless elements": ("<mujoco>" + "<a/>" * 3_000_000 + "</mujoco>", "characters"),
    "huge texture": (_mjcf('<asset><texture name="t" builtin="flat" width="99999" height="99999"/></asset>'), "absurd"),
    "huge height field": (
        _mjcf('<asset><hfield name="h" nrow="99999" ncol="99999"/></asset>'),
        "absurd",
    ),
    "huge numbers": (_mjcf('<custom><numeric name="n" size="2000000000"/></custom>'), "absurd"),
    "huge user data": (_mjcf('<size nuser_body="2000000000"/>'), "absurd"),
    "huge shadows": (_mjcf('<visual><quality shadowsize="1000000"/></visual>'), "absurd"),
    "not a number of shadows": (_mjcf('<visual><quality shadowsize="inf"/></visual>'), "absurd"),
    "copies of copies": (
        _mjcf(f"<worldbody>{'<replicate count="1000">' * 3}{'</replicate>' * 3}</worldbody>"),
        "multiplies",
    ),
    "huge cloth": (_mjcf('<worldbody><composite type="cable" count="99999 9 9"/></worldbody>'), "multiplies"),
    "no MJCF": ("<robot/>", "expected MJCF"),
    "no XML": ("hello", "not XML"),
}


@pytest.mark.parametrize("case", SCENES)
def test_hostile_scene_is_refused_before_mujoco_sees_it(case: str) -> None:
    xml, message = SCENES[case]
    with pytest.raises(RejectedEpisodeError, match=message):
        loadable(xml, AssetFinder([]))


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """An asset root with `arm/link.stl`, beside a secret that links in it point to."""
    folder = tmp_path / "assets"
    (folder / "arm").mkdir(parents=True)
    (folder / "arm" / "link.stl").write_bytes(b"mesh")
    (tmp_path / "secret.stl").write_bytes(b"secret")
    (folder / "out.stl").symlink_to(tmp_path / "secret.stl")
    (folder / "up").symlink_to(tmp_path)
    (folder / "circle.stl").symlink_to(folder / "circle.stl")
    os.mkfifo(folder / "pipe.stl")
    return folder


@pytest.mark.parametrize(
    "name",
    [
        "/etc/passwd",
        "../secret.stl",
        "arm/../../secret.stl",
        "out.stl",
        "up/secret.stl",
        "circle.stl",
        "pipe.stl",  # opening it would wait forever
        "arm",
        "x" * 300,
        "a/" * 5000 + "link.stl",
        "arm/li\0nk.stl",
        "file:///etc/passwd",
        "/proc/self/environ",
        "~/.ssh/id_rsa",
    ],
    ids=lambda name: repr(name[:24]),
)
def test_nothing_outside_the_asset_roots_is_read(name: str, root: Path) -> None:
    assert AssetFinder([root]).read(name) is None
    assert AssetFinder([root]).read("arm/link.stl") == b"mesh"


@pytest.mark.parametrize("folder", ["..", "/etc", "x" * 100_000], ids=["up", "absolute", "long"])
def test_folders_of_the_compiler_lead_nowhere_else(folder: str, root: Path) -> None:
    xml = f'<mujoco><compiler meshdir="{folder}"/><asset><mesh file="secret.stl"/></asset><worldbody/></mujoco>'
    with pytest.raises(UserError, match="not found"):
        loadable(xml, AssetFinder([root]))


def test_buffers_are_of_the_size_of_the_pictures() -> None:
    text, _ = loadable(
        _mjcf('<visual><global offwidth="99999" offheight="99999"/></visual><size memory="900G"/>'), AssetFinder([])
    )
    assert "99999" not in text
    assert "900G" not in text


def test_files_inside_the_hdf5_file_have_the_same_bounds(tmp_path: Path) -> None:
    source = write_demos(tmp_path / "a.hdf5", (2,))
    (tmp_path / "other.hdf5").write_bytes(source.read_bytes())
    with h5py.File(source, "a") as file:
        assets = file["assets"]
        assets["linked.png"] = h5py.ExternalLink("other.hdf5", "/assets/textures/checks.png")
        assets.create_dataset("huge.png", (2**40,), "u1", chunks=(2**20,))
        assets["text.png"] = "hello"
    with DemoFile(source) as file:
        assert file.asset("textures/checks.png")
        assert file.asset("text.png") is None
        for name, message in (("linked.png", "another file"), ("huge.png", "absurd")):
            with pytest.raises(RejectedEpisodeError, match=message):
                file.asset(name)


@pytest.mark.render
def test_missing_meshes_of_one_demo_reject_only_it(tmp_path: Path) -> None:
    source = write_demos(tmp_path / "a.hdf5", (3, 4))
    with h5py.File(source, "a") as file:
        file["data/demo_0"].attrs["model_file"] = SCENE.replace("textures/checks.png", "/home/someone/textures/no.png")
    result = convert([source], tmp_path / "out", ConversionSettings(image_size=32))
    assert result.num_frames == 4
    assert "/home/someone/textures/no.png" in result.rejected[0]["reason"]
    assert "--asset-root" in result.rejected[0]["reason"]
    with h5py.File(source, "a") as file:
        del file["assets"]
    with pytest.raises(UserError, match="--asset-root"):
        convert([source], tmp_path / "none", ConversionSettings(image_size=32))
    assert leftovers(tmp_path / "none") == []


@pytest.mark.render
def test_a_state_beyond_all_bounds_is_rejected(tmp_path: Path) -> None:
    source = write_demos(tmp_path / "a.hdf5", (3, 4), proprioception=False)
    with h5py.File(source, "a") as file:
        file["data/demo_0/states"][1, 1:4] = 1e300
    result = convert([source], tmp_path / "out", ConversionSettings(image_size=32))
    assert [line["source_demo"] for line in result.rejected] == ["demo_0"]
    assert result.num_frames == 4
