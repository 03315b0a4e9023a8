"""MJCF texts of demonstrations made loadable here: files found again, attributes that MuJoCo dropped taken out.

Demonstrations hold the whole MJCF with the file paths of the machine that recorded them. MuJoCo never opens those:
every file is looked up in the places the user named and handed over in memory.
"""

from __future__ import annotations

import importlib.util
import posixpath
import re
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from robocasa_lerobot.convert.reading.hdf5 import MAX_ASSET_BYTES, MAX_TEXT_BYTES, RejectedEpisodeError
from robocasa_lerobot.convert.reading.mjcf_limits import check_limits, parse_mjcf
from robocasa_lerobot.errors import UserError

# Packages whose installed folder is an asset root for paths that contain the package's name.
ASSET_PACKAGES = ("gymnasium_robotics",)

_CUBE_FACES = ("fileright", "fileleft", "fileup", "filedown", "filefront", "fileback")
# Elements that name files, with the compiler attribute of the folder such names are relative to.
_FILE_ATTRIBUTES: dict[str, tuple[str, tuple[str, ...]]] = {
    "mesh": ("meshdir", ("file",)),
    "texture": ("texturedir", ("file", *_CUBE_FACES)),
    "hfield": ("assetdir", ("file",)),
    "skin": ("assetdir", ("file",)),
}
# Attributes of older MuJoCo versions that 3.17 refuses. All of them are about physics: no picture depends on them.
REPAIRS: tuple[tuple[str, str], ...] = (
    ("compiler", "convexhull"),
    ("compiler", "exactmeshinertia"),
    ("compiler", "setmass"),
    ("option", "collision"),
    ("option", "apirate"),
    ("option", "mpr_tolerance"),
    ("option", "mpr_iterations"),
    ("flag", "passive"),
    ("flag", "sensornoise"),
)
# Numbers as Python prints a list, which MuJoCo took when robosuite 1.0 wrote them.
_LISTED = re.compile(r"\s*\[([-+0-9.eE,\s]*)\]\s*")
_MAX_PATH = 4096  # characters; longer ones no file system has


class MissingAssetsError(UserError):
    """Files that an MJCF names were found in none of the places to look."""


class AssetFinder:
    """Finds the files an MJCF names: in the HDF5 file, under the roots, in installed packages.

    Under a root the longest suffix of the path that exists is taken, so `/home/x/robosuite/models/assets/robots/a.stl`
    is found as `robots/a.stl` where the root is a copy of that `assets` folder. Nothing outside the roots is read.
    """

    def __init__(self, roots: Sequence[Path], embedded: Callable[[str], bytes | None] = lambda _: None) -> None:
        for root in roots:
            if not root.is_dir():
                raise UserError(f"--asset-root {root} is not a folder.")
        self._roots = [root.resolve() for root in roots]
        self._embedded = embedded
        self.leading_out: list[Path] = []  # links that were met whose files lie outside of the roots

    def read(self, name: str) -> bytes | None:
        """Bytes of the file that the path `name` stands for, or None."""
        path = posixpath.normpath(name.replace("\\", "/"))
        if len(path) > _MAX_PATH or "\0" in path:
            return None
        found = self._embedded(path)
        if found is not None:
            return found
        parts = [part for part in path.split("/") if part not in ("", "..", ".")]
        for root in self._roots:
            for start in range(len(parts)):
                file = _inside(root, parts[start:], self.leading_out)
                if file is not None:
                    return _content(file)
        for package in ASSET_PACKAGES:
            if package in parts:
                last = len(parts) - 1 - parts[::-1].index(package)
                folder = _package_folder(package)
                file = _inside(folder, parts[last + 1 :]) if folder else None
                if file is not None:
                    return _content(file)
        return None


def names_model(text: str) -> bool:
    """Whether a `model_file` is the name of an MJCF file, as in robosuite's first files, instead of its text."""
    return len(text) <= _MAX_PATH and "<" not in text and text.strip().lower().endswith((".xml", ".mjcf"))


def read_model(name: str, roots: Sequence[Path]) -> str:
    """The MJCF text of a file that an episode names, found by the end of its path under one of the roots.

    Raises:
        RejectedEpisodeError: it is not there, too long, or no text.
    """
    content = AssetFinder(roots).read(name.strip())
    if content is None:
        raise RejectedEpisodeError(
            f"its model_file is only a file's name, {name.strip()!r}, not the scene (MJCF) itself, as in robosuite's "
            "first files. Give the folder that holds this file with --asset-root DIR, besides that of its meshes."
        )
    try:
        text = content.decode("utf-8")
    except UnicodeDecodeError:
        raise RejectedEpisodeError(f"its model_file {name.strip()!r} is a file that is no text.") from None
    if len(content) > MAX_TEXT_BYTES:
        raise RejectedEpisodeError(f"its model_file {name.strip()!r} is a file of {len(content)} bytes.")
    return text


@dataclass(frozen=True)
class SceneNames:
    """Names of the elements of an MJCF, in document order."""

    cameras: tuple[str, ...]
    sites: frozenset[str]
    bodies: frozenset[str]
    joints: tuple[str, ...]


def scene_names(xml: str) -> SceneNames:
    """The names in an MJCF.

    Raises:
        RejectedEpisodeError: it is not XML or declares entities.
    """
    root = parse_mjcf(xml)

    def names(tag: str) -> tuple[str, ...]:
        return tuple(element.get("name", "") for element in root.iter(tag) if element.get("name"))

    joints = tuple(e.get("name", "") for e in root.iter() if e.tag in ("joint", "freejoint") and e.get("name"))
    return SceneNames(names("camera"), frozenset(names("site")), frozenset(names("body")), joints)


def loadable(xml: str, finder: AssetFinder) -> tuple[str, dict[str, bytes]]:
    """The MJCF with repaired attributes and its files in memory under flat names: what `MjModel.from_xml_string` takes.

    Raises:
        MissingAssetsError: some files were found nowhere; the message names the first ones and the remedy.
        RejectedEpisodeError: it is not XML, declares entities, or would make MuJoCo open files by itself.
    """
    root = parse_mjcf(xml)
    check_limits(root, tuple(_FILE_ATTRIBUTES))
    for element in root.iter():
        for tag, attribute in REPAIRS:
            if element.tag == tag:
                element.attrib.pop(attribute, None)
        for attribute, value in element.attrib.items():
            listed = _LISTED.fullmatch(value)
            if listed:
                element.set(attribute, listed[1].replace(",", " "))
    folders = _take_folders(root)
    assets: dict[str, bytes] = {}
    flat: dict[str, str] = {}
    missing: list[str] = []
    for element, attribute, path in _files(root, folders):
        if path not in flat:
            content = finder.read(path)
            if content is None:
                missing.append(path)
                continue
            # The file's own name stays at the end: MuJoCo chooses the decoder by its extension.
            flat[path] = f"{len(flat)}_{posixpath.basename(path)}"
            assets[flat[path]] = content
        if attribute == "file" and not element.get("name"):
            element.set("name", posixpath.splitext(posixpath.basename(path))[0])  # MuJoCo's own default name
        element.set(attribute, flat[path])
    if missing:
        shown = "".join(f"\n  {path}" for path in dict.fromkeys(missing[:3]))
        raise MissingAssetsError(
            f"{len(set(missing))} mesh or texture files of the scene were not found, the first:{shown}\n"
            "Give the folder that holds them with --asset-root DIR (repeatable): a file counts as found when the end "
            "of its path exists under DIR, e.g. .../robosuite/models/assets."
            + (
                f" {finder.leading_out[0]} is there, but as a link that leads out of this folder, which is not "
                "followed: give a folder with the files themselves (`cp -rL`)."
                if finder.leading_out
                else ""
            )
        )
    return ET.tostring(root, encoding="unicode"), assets


def _take_folders(root: ET.Element) -> dict[str, str]:
    folders = {"assetdir": "", "meshdir": "", "texturedir": ""}
    for compiler in root.iter("compiler"):
        asset_dir = compiler.attrib.pop("assetdir", None)
        if asset_dir is not None:
            folders = dict.fromkeys(folders, asset_dir)
        for key in ("meshdir", "texturedir"):
            folders[key] = compiler.attrib.pop(key, folders[key])
        if compiler.attrib.pop("strippath", "false") == "true":
            for _, attribute, element in _file_attributes(root):
                element.set(attribute, posixpath.basename(element.get(attribute, "").replace("\\", "/")))
    return folders


def _file_attributes(root: ET.Element) -> Iterator[tuple[str, str, ET.Element]]:
    for tag, (folder, attributes) in _FILE_ATTRIBUTES.items():
        for element in root.iter(tag):
            for attribute in attributes:
                if element.get(attribute):
                    yield folder, attribute, element


def _files(root: ET.Element, folders: dict[str, str]) -> Iterator[tuple[ET.Element, str, str]]:
    for folder, attribute, element in list(_file_attributes(root)):
        path = element.get(attribute, "").replace("\\", "/")
        yield element, attribute, path if posixpath.isabs(path) else posixpath.join(folders[folder], path)


def _inside(root: Path, parts: Sequence[str], leading_out: list[Path] | None = None) -> Path | None:
    """The file below a root, or None; a link that points out of it is noted in `leading_out`, and not followed."""
    if not parts:
        return None
    file = root.joinpath(*parts)
    try:
        if not file.is_file():
            return None
        if file.resolve().is_relative_to(root):
            return file
        if leading_out is not None:
            leading_out.append(file)
        return None
    except OSError:  # a name that is too long, a folder that may not be entered
        return None


def _content(file: Path) -> bytes:
    try:
        if file.stat().st_size > MAX_ASSET_BYTES:
            raise RejectedEpisodeError(f"its scene names {file}, which has {file.stat().st_size} bytes.")
        return file.read_bytes()
    except OSError as error:
        raise UserError(f"{file}, which a scene names, cannot be read: {error}") from None


def _package_folder(package: str) -> Path | None:
    spec = importlib.util.find_spec(package)
    locations = spec.submodule_search_locations if spec else None
    return Path(next(iter(locations))).resolve() if locations else None
