"""What is typed after `convert`, `render`, `export` and `verify` is what they do: each option, and a run of some."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import av
import h5py
import numpy as np
import pytest
import yaml
from convert_support import INSTRUCTION, write_demos
from lerobot.datasets.lerobot_dataset import LeRobotDataset

from robocasa_lerobot import cli, contract
from robocasa_lerobot.convert import export as exporting
from robocasa_lerobot.convert import pipeline
from robocasa_lerobot.convert import verify as verifying
from robocasa_lerobot.convert.export import ExportSettings
from robocasa_lerobot.convert.mapping.custom import EXAMPLE, read_mapping
from robocasa_lerobot.convert.rerender import work
from robocasa_lerobot.convert.rerender.plan import RenderSettings
from robocasa_lerobot.convert.settings import ConversionSettings
from robocasa_lerobot.convert.writing.statistics import column
from robocasa_lerobot.errors import UserError

OTHER = "shut the drawer"


class CalledError(UserError):
    """The command has come to its work."""


def asked(monkeypatch: pytest.MonkeyPatch, module: Any, name: str) -> Callable[..., list[Any]]:
    """Runs a command up to the call of a function, whose positional arguments it gives."""
    calls: list[list[Any]] = []

    def note(*arguments: Any) -> None:
        calls.append(list(arguments))
        raise CalledError("as far as this test goes")

    monkeypatch.setattr(module, name, note)

    def run(*line: str) -> list[Any]:
        assert cli.main(list(line)) == 2
        return calls.pop()

    return run


def usual_fields(given: Any) -> list[str]:
    """Fields that have their defaults: which a test would leave out."""
    own, usual = vars(given), vars(type(given)())
    return [name for name, value in own.items() if value == usual[name]]


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = write_demos(tmp_path_factory.mktemp("source") / "demos.hdf5", (6, 5, 4), images=32)
    with h5py.File(path, "r+") as file:
        file["mask/some"] = np.array([b"demo_0", b"demo_2"])
        for demo in file["data"].values():
            demo["obs/extra"] = np.arange(len(demo["actions"]), dtype=np.float32)[:, None]
    return path


def test_convert_takes_every_option(tmp_path: Path, source: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    mapping, out = tmp_path / "mapping.yaml", tmp_path / "out"
    mapping.write_text(EXAMPLE)
    convert = asked(monkeypatch, pipeline, "convert")
    files, place, settings, workers, overwrite, _ = convert(
        "convert", str(source), f"--out={out}", "--asset-root=a", "--asset-root=b", "--cameras=one, two",
        "--image-size=48", f"--instruction={OTHER}", "--video-codec=av1", "--render-preset=quality", "--reencode",
        "--max-gop=3", "--replace-instruction", "--filter-key=some", "--demos=2", "--demos-seed=5",
        "--extra-columns=obs/extra,obs/other", f"--mapping={mapping}", "--workers=1", "--overwrite",
    )  # fmt: skip
    assert settings == ConversionSettings(
        ("a", "b"), ("one", "two"), 48, OTHER, "av1", "quality", True, 3, True, "some", "2", 5,
        extra_columns=("obs/extra", "obs/other"), mapping=read_mapping(mapping),
    )  # fmt: skip
    assert usual_fields(settings) == ["action_key"]  # which a mapping names itself
    absolute = convert("convert", str(source), f"--out={out}", "--action-key=actions_abs")[2]
    assert absolute == ConversionSettings(action_key="actions_abs")
    assert (files, place, workers, overwrite) == ([source], out, 1, True)
    assert convert("convert", str(source), f"--out={out}")[2:5] == [ConversionSettings(), None, False]


def test_render_export_and_verify_take_every_option(
    tmp_path: Path, source: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    data, out = tmp_path / "data", tmp_path / "out"
    assert cli.main(["convert", str(source), f"--out={data}", "--demos=demo_2", "--workers=1"]) == 0
    cameras = tmp_path / "cameras.yaml"
    cameras.write_text(yaml.safe_dump({"robot0_frontview": {"camera_attribs": {"fovy": 70}}}))
    render = asked(monkeypatch, work, "render_dataset")
    _, _, settings, workers, overwrite, _ = render(
        "render", str(data), f"--out={out}", "--cameras=one,two", "--image-size=48", "--render-preset=quality",
        f"--cam-configs={cameras}", "--video-codec=hevc", "--asset-root=a", "--workers=1", "--overwrite",
    )  # fmt: skip
    moved = settings.cam_configs
    assert "70" in moved
    assert settings == RenderSettings(("one", "two"), 48, "quality", "hevc", moved, ("a",))
    assert usual_fields(settings) == []
    assert (workers, overwrite) == (1, True)

    export = asked(monkeypatch, exporting, "export")
    line = ["export", str(data), f"--out={out}", "--task=OpenDrawer", "--compression=lzf", "--overwrite"]
    chosen = ExportSettings(("one", "two"), True, "OpenDrawer", "lzf")
    assert export(*line, "--cameras=one,two") == [data, out, chosen, True]
    assert export(*line, "--no-images")[2] == ExportSettings(None, False, "OpenDrawer", "lzf")

    verify = asked(monkeypatch, verifying, "verify")
    line = ["--source", "a", "b", "--asset-root=c", "--pictures-per-episode=all", "--min-psnr=31.5", "--workers=2"]
    assert verify("verify", str(data), *line) == [data, [Path("a"), Path("b")], ["c"], None, 31.5, 2]
    assert verify("verify", str(data)) == [data, [], [], 8, 25.0, None]


def test_a_conversion_with_options_does_what_they_say(
    tmp_path: Path, source: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    options = ["--filter-key=some", "--replace-instruction", f"--instruction={OTHER}", "--extra-columns=obs/extra"]
    assert cli.main(["convert", str(source), f"--out={out}", *options, "--video-codec=hevc", "--workers=1"]) == 0
    said = capsys.readouterr().out
    assert "2 episodes have the instruction that was given, whatever they record" in said
    assert "record no instruction" not in said
    np.testing.assert_array_equal(column(out, "extra.obs.extra"), [*range(6), *range(4)])  # demo_1 is left out
    dataset = LeRobotDataset("local/out", root=out, video_backend="pyav")
    assert {dataset[index]["task"] for index in (0, 9)} == {OTHER} != {INSTRUCTION}
    (video, *_) = sorted((out / "videos" / contract.IMAGE_KEYS[0]).rglob("*.mp4"))
    with av.open(str(video)) as container:
        assert container.streams.video[0].codec_context.name == "hevc"

    assert cli.main(["verify", str(out), "--min-psnr=20", "--workers=1"]) == 0
    assert cli.main(["verify", str(out), "--min-psnr=90", "--workers=1"]) == 1

    file = tmp_path / "again.hdf5"
    assert cli.main(["export", str(out), f"--out={file}", "--compression=lzf"]) == 0
    with h5py.File(file) as exported:
        assert exported["data/demo_0/actions"].compression == "lzf"
        assert {json.loads(demo.attrs["ep_meta"])["lang"] for demo in exported["data"].values()} == {OTHER}
