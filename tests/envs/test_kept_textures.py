"""Textures are drawn once on a machine, and are the same wherever they come from."""

from __future__ import annotations

import io
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from robocasa_lerobot.envs.kitchens import kept_textures, textures
from robocasa_lerobot.envs.kitchens.kept_textures import CACHE_VARIABLE
from robocasa_lerobot.envs.kitchens.textures import GENERATORS, TEXTURE_SIZE, TextureRecord, texture_png

_WOOD = TextureRecord("wood", (0.5, 0.4, 0.3), (0.3, 0.2, 0.1), 7)
# What another process does whose textures all have to come from the disk.
_WITHOUT_DRAWING = """
import sys
from robocasa_lerobot.envs.kitchens import textures
from robocasa_lerobot.envs.kitchens.textures import TextureRecord, texture_png

def refuse(record):
    raise AssertionError("drawn")

textures.draw = refuse
sys.stdout.buffer.write(texture_png(TextureRecord("wood", (0.5, 0.4, 0.3), (0.3, 0.2, 0.1), 7)))
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path / "cache"))
    texture_png.cache_clear()
    return tmp_path / "cache" / "textures"


@pytest.mark.parametrize("kind", sorted(GENERATORS))
def test_a_texture_from_the_disk_is_the_one_that_was_drawn(kind: str, folder: Path) -> None:
    record = TextureRecord(kind, (0.5, 0.4, 0.3), (0.3, 0.2, 0.1), 7)
    drawn = texture_png(record)
    texture_png.cache_clear()
    (file,) = folder.iterdir()
    file.with_name("other").write_bytes(b"")  # what else lies there is left alone
    assert texture_png(record) == drawn == file.read_bytes() == textures.draw(record)
    assert np.asarray(Image.open(io.BytesIO(drawn))).shape == (TEXTURE_SIZE, TEXTURE_SIZE, 3)


def test_another_process_draws_nothing_anew(folder: Path) -> None:
    drawn = texture_png(_WOOD)
    assert subprocess.run([sys.executable, "-c", _WITHOUT_DRAWING], capture_output=True, check=True).stdout == drawn
    for file in folder.iterdir():
        file.unlink()
    failed = subprocess.run([sys.executable, "-c", _WITHOUT_DRAWING], capture_output=True)
    assert b"AssertionError: drawn" in failed.stderr


def test_records_that_differ_have_files_of_their_own(folder: Path) -> None:
    nearly = TextureRecord("wood", (0.5, 0.4005, 0.3), (0.3, 0.2, 0.1), 7)
    assert nearly.file == _WOOD.file  # colours are rounded to bytes in a file's name
    assert texture_png(nearly) != texture_png(_WOOD)
    assert len(list(folder.iterdir())) == 2


def test_other_code_that_draws_has_files_of_its_own(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    texture_png(_WOOD)
    texture_png.cache_clear()
    monkeypatch.setattr(kept_textures, "_stamp", lambda source: "of another version")
    texture_png(_WOOD)
    assert len(list(folder.iterdir())) == 2


def test_a_file_that_was_cut_is_drawn_anew(folder: Path) -> None:
    drawn = texture_png(_WOOD)
    (file,) = folder.iterdir()
    file.write_bytes(drawn[:1000])
    texture_png.cache_clear()
    assert texture_png(_WOOD) == drawn == file.read_bytes()


def test_where_nothing_can_be_written_each_process_draws(folder: Path) -> None:
    folder.parent.parent.joinpath("cache").write_text("a file where the folder would be")
    assert texture_png(_WOOD) == textures.draw(_WOOD)
    assert folder.parent.read_text() == "a file where the folder would be"
