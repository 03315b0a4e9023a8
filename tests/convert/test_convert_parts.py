"""The converter's parts: files named by MJCFs, mappings, the encoder, statistics; and the human demonstrations."""

from __future__ import annotations

import gzip
import shutil
from pathlib import Path
from typing import Any

import h5py
import mujoco
import numpy as np
import pytest
from convert_support import MESH, SCENE, TEXTURE, mujoco_quaternion, write_demos
from hypothesis import given
from hypothesis import strategies as st

from robocasa_lerobot import contract
from robocasa_lerobot.convert.action_range import out_of_range
from robocasa_lerobot.convert.mapping.robot_mapping import quaternion_xyzw
from robocasa_lerobot.convert.mapping.robots import choose_mapping
from robocasa_lerobot.convert.reading import mjcf
from robocasa_lerobot.convert.reading.demo_file import DemoFile, RejectedEpisodeError, SourceError
from robocasa_lerobot.convert.reading.mjcf import AssetFinder, MissingAssetsError, loadable
from robocasa_lerobot.convert.settings import ConversionSettings, make_plan
from robocasa_lerobot.convert.writing.encoder import (
    QUANTILES,
    channel_histogram,
    histogram_statistics,
)
from robocasa_lerobot.errors import UserError

LIFT_FRAMES = {"demo_1": 482, "demo_2": 510, "demo_3": 392}


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """An asset root with `robots/arm/link.stl`, and a file and a link that lead out of it."""
    folder = tmp_path / "assets"
    (folder / "robots" / "arm").mkdir(parents=True)
    (folder / "robots" / "arm" / "link.stl").write_bytes(b"mesh")
    (tmp_path / "secret.stl").write_bytes(b"secret")
    (folder / "link_out.stl").symlink_to(tmp_path / "secret.stl")
    return folder


@pytest.mark.parametrize(
    ("path", "found"),
    [
        ("/home/someone/robosuite/models/assets/robots/arm/link.stl", b"mesh"),
        ("/home/someone/assets/grippers/../robots/arm/link.stl", b"mesh"),
        ("C:\\Users\\someone\\assets\\robots\\arm\\link.stl", b"mesh"),
        ("robots/arm/link.stl", b"mesh"),
        ("/home/someone/other/hand.stl", None),
        ("../secret.stl", None),
        ("link_out.stl", None),
        ("", None),
    ],
)
def test_files_are_found_by_the_end_of_their_path_and_only_under_the_root(
    root: Path, path: str, found: bytes | None
) -> None:
    assert AssetFinder([root]).read(path) == found


def test_the_longest_matching_end_wins(root: Path) -> None:
    (root / "link.stl").write_bytes(b"another")
    assert AssetFinder([root]).read("/x/robots/arm/link.stl") == b"mesh"


def test_embedded_files_come_first_and_packages_are_known(root: Path) -> None:
    finder = AssetFinder([root], {"robots/arm/link.stl": b"embedded"}.get)
    assert finder.read("robots/arm/link.stl") == b"embedded"
    tile = finder.read(MESH)
    assert tile
    assert finder.read(f"/opt/env/site-packages/{MESH}") == tile
    with pytest.raises(UserError, match="not a folder"):
        AssetFinder([root / "nowhere"])


def test_missing_files_are_named_with_the_remedy(root: Path) -> None:
    with pytest.raises(MissingAssetsError, match=TEXTURE) as caught:
        loadable(SCENE, AssetFinder([root]))
    assert "--asset-root" in str(caught.value)


def test_folders_of_the_compiler_count_and_names_stay(root: Path) -> None:
    xml = (
        '<mujoco><compiler meshdir="robots/arm" strippath="true"/><asset><mesh file="/old/link.stl"/></asset></mujoco>'
    )
    text, assets = loadable(xml, AssetFinder([root]))
    assert list(assets.values()) == [b"mesh"]
    assert 'name="link"' in text
    assert "meshdir" not in text


@pytest.mark.parametrize(("tag", "attribute"), mjcf.REPAIRS)
def test_each_repair_is_needed_and_enough(tag: str, attribute: str) -> None:
    element = f'<{tag} {attribute}="0"/>'
    xml = f"<mujoco>{f'<option>{element}</option>' if tag == 'flag' else element}<worldbody/></mujoco>"
    with pytest.raises(ValueError, match=attribute):
        mujoco.MjModel.from_xml_string(xml)
    mujoco.MjModel.from_xml_string(*loadable(xml, AssetFinder([])))


@pytest.mark.parametrize(
    "xml",
    [
        '<!DOCTYPE x [<!ENTITY a "b">]><mujoco>&a;</mujoco>',
        '<mujoco><include file="/etc/passwd"/></mujoco>',
        '<mujoco><asset><model name="m" file="/etc/passwd"/></asset></mujoco>',
        "<mujoco>",
    ],
)
def test_hostile_scenes_are_rejected(xml: str) -> None:
    with pytest.raises(RejectedEpisodeError):
        loadable(xml, AssetFinder([]))


@given(st.lists(st.floats(-1, 1), min_size=4, max_size=4).filter(lambda q: np.linalg.norm(q) > 0.1))
def test_quaternion_is_that_of_mujoco(quat: list[float]) -> None:
    matrix = np.empty(9)
    mujoco.mju_quat2Mat(matrix, np.array(quat) / np.linalg.norm(quat))
    ours, theirs = quaternion_xyzw(matrix.reshape(3, 3)), mujoco_quaternion(matrix.reshape(3, 3))
    assert ours[3] >= 0
    if abs(ours[3]) < 1e-6:  # at a half turn both signs are right
        ours, theirs = ours * np.sign(ours @ theirs), theirs
    np.testing.assert_allclose(ours, theirs, atol=1e-9)


def test_features_are_the_contracts(tmp_path: Path) -> None:
    plan = make_plan([write_demos(tmp_path / "a.hdf5", (5,))], ConversionSettings())
    assert plan.features == contract.dataset_features()
    assert plan.fps == contract.CONTROL_HZ


def test_no_mapping_is_an_error_that_names_the_known_ones(tmp_path: Path) -> None:
    path = write_demos(tmp_path / "a.hdf5", (5,), proprioception=False)
    with h5py.File(path, "a") as file:
        file["data/demo_0"].attrs["model_file"] = "<mujoco><worldbody/></mujoco>"
    with DemoFile(path) as file, pytest.raises(SourceError, match=contract.ROBOT_TYPE):
        choose_mapping(file, file.demo("demo_0"))


@pytest.mark.parametrize(
    "fields",
    [{"image_size": 15}, {"image_size": 33}, {"image_size": 100_000}, {"cameras": ()}, {"instruction": " "}],
    ids=str,
)
def test_impossible_settings_are_refused(fields: dict[str, Any]) -> None:
    with pytest.raises(UserError):
        ConversionSettings(**fields)


def test_histogram_statistics_are_those_of_the_pixels() -> None:
    images = np.random.default_rng(0).integers(20, 230, (5, 16, 16, 3), dtype=np.uint8)
    histogram = np.sum([channel_histogram(image) for image in images], axis=0)
    stats = histogram_statistics(histogram, 5)
    pixels = images.reshape(-1, 3)
    assert np.array_equal(stats["min"], pixels.min(0))
    assert np.array_equal(stats["max"], pixels.max(0))
    np.testing.assert_allclose(stats["mean"], pixels.mean(0))
    np.testing.assert_allclose(stats["std"], pixels.std(0))
    for q in QUANTILES:
        expected = np.quantile(pixels, q, axis=0, method="inverted_cdf")
        assert np.array_equal(stats[f"q{round(q * 100):02d}"], expected)


def _shortened(shared: Path, path: Path, steps: int) -> Path:
    """The human demonstrations, each with its first steps only."""
    shutil.copy(shared / "real" / "robosuite_lift" / "demo.hdf5", path)
    with h5py.File(path, "a") as file:
        for demo in file["data"].values():
            for key in ("states", "actions"):
                values = demo[key][:steps]
                del demo[key]
                demo[key] = values
    return path


def test_human_demonstrations_are_understood(shared: Path) -> None:
    assets = shared / "real" / "robosuite_lift" / "assets"
    source = shared / "real" / "robosuite_lift" / "demo.hdf5"
    plan = make_plan([source], ConversionSettings(asset_roots=(str(assets),)))
    assert plan.num_frames == sum(LIFT_FRAMES.values()) == 1384
    assert plan.mapping.robot_type == "Panda"
    assert [camera.name for camera in plan.cameras] == ["agentview", "robot0_eye_in_hand", "frontview"]
    assert plan.features["action"]["shape"] == (7,)
    assert plan.features["observation.state"]["shape"] == (9,)
    with pytest.raises(MissingAssetsError, match="--asset-root"):
        make_plan([source], ConversionSettings())


@pytest.mark.render
def test_human_demonstrations_round_trip(shared: Path, tmp_path: Path) -> None:
    """Three steps of each demo at a small size; the whole file is a slow test."""
    from robocasa_lerobot.convert.pipeline import convert
    from robocasa_lerobot.convert.verify import verify

    source = _shortened(shared, tmp_path / "lift.hdf5", 3)
    settings = ConversionSettings(asset_roots=(str(shared / "real" / "robosuite_lift" / "assets"),), image_size=64)
    result = convert([source], tmp_path / "lift", settings)
    assert (result.num_episodes, result.num_frames) == (3, 9)
    report = verify(tmp_path / "lift", pictures_per_episode=1)
    assert report.passed, report.as_json()


@pytest.mark.slow
@pytest.mark.render
@pytest.mark.timeout(1800)
def test_all_human_demonstrations(shared: Path, tmp_path: Path) -> None:
    from robocasa_lerobot.convert.pipeline import convert
    from robocasa_lerobot.convert.verify import verify

    folder = shared / "real" / "robosuite_lift"
    convert([folder / "demo.hdf5"], tmp_path / "lift", ConversionSettings(asset_roots=(str(folder / "assets"),)))
    report = verify(tmp_path / "lift")
    assert report.passed, report.as_json()
    assert (report.num_episodes, report.num_frames) == (3, 1384)
    assert min(camera.minimum for camera in report.cameras) > 30


OLD_SCENE = (
    SCENE.replace(
        "</asset>", '<texture name="cube" type="cube" file="square.png"/><material name="c" texture="cube"/></asset>'
    )
    .replace('rgba="0.8 0.2 0.1 1"', 'material="c"')
    .replace('pos="1.5 0.2 0.5"', 'pos="[1.5, 0.2, 0.5]"')
)


@pytest.mark.render
def test_scenes_that_are_named_by_file_are_found_under_the_asset_roots(tmp_path: Path) -> None:
    """As in robosuite 1.0's demonstrations, which also have lists for vectors and one picture for six faces."""
    from robocasa_lerobot.convert.pipeline import convert
    from robocasa_lerobot.convert.verify import verify

    source = write_demos(tmp_path / "demo.hdf5", (4,))
    scenes = tmp_path / "models"
    scenes.mkdir()
    with h5py.File(source, "a") as file:
        file["data/demo_0"].attrs["model_file"] = "panda_wipe.xml"
        (scenes / "square.png").write_bytes(file[f"assets/{TEXTURE}"][:].tobytes())
    with pytest.raises(UserError, match=r"only a file's name, 'panda_wipe.xml'.*--asset-root"):
        convert([source], tmp_path / "none", ConversionSettings(image_size=32))
    (tmp_path / "panda_wipe.xml").write_text(OLD_SCENE)
    with h5py.File(source, "a") as file:
        file["data/demo_0"].attrs["model_file"] = "../panda_wipe.xml"
    settings = ConversionSettings(image_size=32, asset_roots=(str(scenes),))
    with pytest.raises(UserError, match="only a file's name"):
        convert([source], tmp_path / "none", settings)  # outside of the root
    (scenes / "panda_wipe.xml").write_text(OLD_SCENE)
    out = convert([source], tmp_path / "data", settings).root
    assert verify(out).passed
    kept = gzip.decompress((out / "extras" / "episode_000000" / "model.xml.gz").read_bytes()).decode()
    assert kept == OLD_SCENE


def test_actions_out_of_range_are_counted_the_same_in_any_runs(tmp_path: Path) -> None:
    mapping = make_plan([write_demos(tmp_path / "a.hdf5", (3,), images=16)], ConversionSettings()).mapping
    actions = np.random.default_rng(2).normal(size=(50, contract.ACTION_SIZE))
    whole = out_of_range(mapping, [actions])
    assert whole is not None
    outside = (np.abs(actions) > 1.05).any(axis=1)
    assert (whole["steps"], whole["share"]) == (int(outside.sum()), float(outside.mean()))
    assert whole["largest"] == np.abs(actions).max()
    assert out_of_range(mapping, np.split(actions, [1, 20, 33])) == whole
