"""What a file does not say, or says in its own way, is told or refused, and never guessed without a word."""

from __future__ import annotations

import json
from pathlib import Path

import h5py
import numpy as np
import pytest
from convert_support import write_demos

from robocasa_lerobot import cli, contract
from robocasa_lerobot.convert.pipeline import convert
from robocasa_lerobot.convert.reading.mjcf import AssetFinder, MissingAssetsError, loadable
from robocasa_lerobot.convert.record_files import META_FOLDER
from robocasa_lerobot.convert.settings import ConversionSettings
from robocasa_lerobot.jsonl import read_jsonl

CAMERA = contract.CAMERAS[0]
MAPPING = """
robot_type: arm
fps: 20
state: {state: {key: states}}
action: {action: {key: actions}}
cameras: {front: obs/robot0_agentview_left_image}
instruction: {attribute: words}
"""


def _mapping(folder: Path) -> Path:
    path = folder / "mapping.yaml"
    path.write_text(MAPPING)
    return path


def _instructions(root: Path) -> list[str]:
    return [line["instruction"] for line in read_jsonl(root / META_FOLDER / "episodes.jsonl")]


@pytest.mark.parametrize(
    ("recorded", "expected"),
    [
        (np.bytes_("pick up the cup"), "pick up the cup"),
        ("pick up the cup", "pick up the cup"),
        (np.array([b"pick up", b"the cup"]), "pick up the cup"),
        (np.array(["pick up", "the cup"], dtype=h5py.string_dtype()), "pick up the cup"),
    ],
)
def test_instructions_in_attributes_of_any_kind_of_text(recorded: object, expected: str, tmp_path: Path) -> None:
    source = write_demos(tmp_path / "a.hdf5", (5,), images=16, instruction=None)
    with h5py.File(source, "a") as file:
        file["data/demo_0"].attrs["words"] = recorded
    assert cli.main(["convert", str(source), "--out", str(tmp_path / "out"), "--mapping", str(_mapping(tmp_path))]) == 0
    assert _instructions(tmp_path / "out") == [expected]


def test_the_same_motion_with_other_words_is_another_demonstration(tmp_path: Path) -> None:
    source = write_demos(tmp_path / "a.hdf5", (5,), images=16, instruction=None)
    with h5py.File(source, "a") as file:
        file["data/demo_0"].attrs["words"] = "pick up the cup"
        for name, words in (("demo_1", "lift the mug"), ("demo_2", "lift the mug")):
            file["data"].copy("demo_0", name)
            file[f"data/{name}"].attrs["words"] = words
    assert cli.main(["convert", str(source), "--out", str(tmp_path / "out"), "--mapping", str(_mapping(tmp_path))]) == 0
    assert _instructions(tmp_path / "out") == ["pick up the cup", "lift the mug"]
    (line,) = read_jsonl(tmp_path / "out" / META_FOLDER / "rejected.jsonl")
    assert "copy of demo_1" in line["reason"]


def test_an_assumed_rate_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = write_demos(tmp_path / "a.hdf5", (5,), images=16)
    arguments = ["convert", str(source), "--out", str(tmp_path / "told")]
    assert cli.main(arguments) == 0
    assert "Hz are assumed" not in capsys.readouterr().out
    with h5py.File(source, "a") as file:
        file["data"].attrs["env_args"] = json.dumps({"env_name": "OpenDrawer", "type": 1, "env_kwargs": {}})
    assert cli.main([*arguments[:-1], str(tmp_path / "recorded")]) == 0  # by the states' times
    assert "Hz are assumed" not in capsys.readouterr().out
    with h5py.File(source, "a") as file:
        del file["data/demo_0/states"]
    assert cli.main([*arguments[:-1], str(tmp_path / "assumed")]) == 0
    assert "tells no rate: 20 Hz are assumed" in capsys.readouterr().out
    assert cli.main(["inspect", str(source)]) == 0
    assert "20 Hz (assumed: the file does not say)" in capsys.readouterr().out
    assert cli.main(["inspect", str(source), "--draft-mapping", str(tmp_path / "draft.yaml")]) == 0
    assert "fps: 20  # assumed" in (tmp_path / "draft.yaml").read_text()


def test_pictures_of_another_size_are_not_squeezed_without_a_word(tmp_path: Path) -> None:
    source = write_demos(tmp_path / "a.hdf5", (5, 4), images=16)
    with h5py.File(source, "a") as file:
        del file[f"data/demo_1/obs/{CAMERA}_image"]
        file[f"data/demo_1/obs/{CAMERA}_image"] = np.zeros((4, 24, 32, 3), np.uint8)
    result = convert([source], tmp_path / "out", ConversionSettings())
    (line,) = result.rejected
    assert line["source_demo"] == "demo_1"
    assert f"its pictures of {CAMERA} are 24x32, those of other episodes 16x16" in line["reason"]
    assert convert([source], tmp_path / "resized", ConversionSettings(image_size=16)).rejected == []


def test_a_draft_of_episodes_whose_actions_are_called_action(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source = write_demos(tmp_path / "a.hdf5", (5, 4), images=16)
    with h5py.File(source, "a") as file:
        for demo in file["data"].values():
            demo.move("actions", "action")
    draft = tmp_path / "draft.yaml"
    assert cli.main(["inspect", str(source), "--draft-mapping", str(draft)]) == 0
    assert "key: action" in draft.read_text()
    capsys.readouterr()
    assert cli.main(["convert", str(source), "--out", str(tmp_path / "out"), "--mapping", str(draft)]) == 0
    assert "2 episodes" in capsys.readouterr().out


def test_assets_behind_links_are_told(tmp_path: Path) -> None:
    elsewhere, root = tmp_path / "blobs", tmp_path / "assets"
    elsewhere.mkdir()
    root.mkdir()
    (elsewhere / "1").write_bytes(b"solid")
    (root / "part.stl").symlink_to(elsewhere / "1")
    xml = '<mujoco><asset><mesh name="m" file="part.stl"/></asset><worldbody/></mujoco>'
    with pytest.raises(MissingAssetsError, match=r"part\.stl is there, but as a link that leads out of this folder"):
        loadable(xml, AssetFinder([root]))
    with pytest.raises(MissingAssetsError) as missing:
        loadable(xml, AssetFinder([elsewhere]))
    assert "link" not in str(missing.value)
