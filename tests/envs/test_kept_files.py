"""Textures and shapes of objects are made once on a machine, and are the same wherever they come from."""

from __future__ import annotations

import dataclasses
import io
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from robocasa_lerobot.envs.kept_files import CACHE_VARIABLE, stamp
from robocasa_lerobot.envs.kitchens import textures
from robocasa_lerobot.envs.kitchens.textures import GENERATORS, TEXTURE_SIZE, TextureRecord, texture_png
from robocasa_lerobot.envs.objects import catalogue
from robocasa_lerobot.envs.objects.draft import FORMS, Draft, Model
from robocasa_lerobot.envs.objects.mesh import lathe
from robocasa_lerobot.envs.objects.model_bytes import from_bytes, to_bytes
from robocasa_lerobot.envs.objects.solids import Solid

_WOOD = TextureRecord("wood", (0.5, 0.4, 0.3), (0.3, 0.2, 0.1), 7)
# What another process does where all has to come from the disk.
_WITHOUT_MAKING = """
import sys
from robocasa_lerobot.envs.kitchens import textures
from robocasa_lerobot.envs.kitchens.textures import TextureRecord, texture_png
from robocasa_lerobot.envs.objects import catalogue
from robocasa_lerobot.envs.objects.draft import Draft

def refuse(*arguments):
    raise AssertionError("made anew")

textures.draw = Draft.model = refuse
apple = catalogue.model_of(catalogue.instance(catalogue.CATEGORIES["apple"], 3))
sys.stdout.buffer.write(apple.png + texture_png(TextureRecord("wood", (0.5, 0.4, 0.3), (0.3, 0.2, 0.1), 7)))
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path / "cache"))
    texture_png.cache_clear()
    catalogue._model.cache_clear()
    return tmp_path / "cache" / "textures"


def _same(one: Model, other: Model) -> bool:
    def numbers(solid: Solid) -> tuple[object, ...]:
        return solid.kind, solid.size, solid.pos, solid.quat, solid.points.tolist()

    solids = [[numbers(solid) for solid in model.solids] for model in (one, other)]
    rest = [dataclasses.replace(model, solids=()) for model in (one, other)]
    return solids[0] == solids[1] and rest[0] == rest[1] and list(one.meshes) == list(other.meshes)


@pytest.mark.parametrize("kind", sorted(GENERATORS))
def test_a_texture_from_the_disk_is_the_one_that_was_drawn(kind: str, folder: Path) -> None:
    record = TextureRecord(kind, (0.5, 0.4, 0.3), (0.3, 0.2, 0.1), 7)
    drawn = texture_png(record)
    texture_png.cache_clear()
    (file,) = folder.iterdir()
    file.with_name("other").write_bytes(b"")  # what else lies there is left alone
    assert texture_png(record) == drawn == file.read_bytes()[:-4] == textures.draw(record)
    assert np.asarray(Image.open(io.BytesIO(drawn))).shape == (TEXTURE_SIZE, TEXTURE_SIZE, 3)


@pytest.mark.parametrize("name", sorted(catalogue.CATEGORIES))
def test_a_shape_from_the_disk_is_the_one_that_was_drawn(name: str, folder: Path) -> None:
    item = catalogue.instance(catalogue.CATEGORIES[name], 7)
    drawn = catalogue.model_of(item)
    catalogue._model.cache_clear()
    (file,) = (folder.parent / "objects").iterdir()
    content = file.read_bytes()
    read = catalogue.model_of(item)
    assert read is not drawn
    assert _same(read, drawn)
    assert _same(from_bytes(to_bytes(drawn)), drawn)
    assert file.read_bytes() == content


def test_another_process_makes_nothing_anew(folder: Path) -> None:
    made = catalogue.model_of(catalogue.instance(catalogue.CATEGORIES["apple"], 3)).png + texture_png(_WOOD)
    again = subprocess.run([sys.executable, "-c", _WITHOUT_MAKING], capture_output=True, check=True)
    assert again.stdout == made
    for kind in ("objects", "textures"):
        for file in (folder.parent / kind).iterdir():
            file.unlink()
        failed = subprocess.run([sys.executable, "-c", _WITHOUT_MAKING], capture_output=True)
        assert b"AssertionError: made anew" in failed.stderr
        catalogue._model.cache_clear()
        catalogue.model_of(catalogue.instance(catalogue.CATEGORIES["apple"], 3))


def test_shapes_of_somebody_elses_forms_are_drawn_each_time(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def brick(draft: Draft) -> None:
        draft.body(lathe([(0.0, 0.0), (0.03, 0.0), (0.03, 0.05), (0.0, 0.05)], 8))

    monkeypatch.setitem(FORMS, "brick", brick)
    category = dataclasses.replace(catalogue.CATEGORIES["apple"], shape="brick")
    assert len(catalogue._model(category, 0).solids) == 1
    assert not folder.parent.exists()


def test_records_that_differ_have_files_of_their_own(folder: Path) -> None:
    nearly = TextureRecord("wood", (0.5, 0.4005, 0.3), (0.3, 0.2, 0.1), 7)
    assert nearly.file == _WOOD.file  # colours are rounded to bytes in a file's name
    assert texture_png(nearly) != texture_png(_WOOD)
    assert len(list(folder.iterdir())) == 2


def test_what_other_code_has_made_is_not_taken(tmp_path: Path) -> None:
    code, record, notes = tmp_path / "code.py", tmp_path / "records.yaml", tmp_path / "notes.md"
    stamps = []
    for file in (code, record, notes):
        file.write_text("one")
        stamp.cache_clear()
        stamps.append(stamp(tmp_path))
        file.write_text("another")
        stamp.cache_clear()
        stamps.append(stamp(tmp_path))
    assert len(set(stamps)) == 4  # notes make nothing
    assert stamps[-1] == stamps[-3]


def test_a_file_that_was_cut_is_made_anew(folder: Path) -> None:
    drawn = texture_png(_WOOD)
    (file,) = folder.iterdir()
    content = file.read_bytes()
    for cut in (b"", content[:3], content[:1000], content[:-1]):
        file.write_bytes(cut)
        texture_png.cache_clear()
        assert texture_png(_WOOD) == drawn
        assert file.read_bytes() == content


def test_where_nothing_can_be_written_each_process_makes_its_own(folder: Path) -> None:
    folder.parent.parent.joinpath("cache").write_text("a file where the folder would be")
    assert texture_png(_WOOD) == textures.draw(_WOOD)
    assert folder.parent.read_text() == "a file where the folder would be"
