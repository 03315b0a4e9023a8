"""The package's own configuration files, by path or by name: in a checkout beside the package, in a wheel inside it."""

from __future__ import annotations

from pathlib import Path

from robocasa_lerobot.errors import UserError, suggest

_FOLDER = "configs"
_OF_NO_FOLDER = "experiments"  # files beside the folders are of this kind
_PARTS = "parts"  # folders of files that others are made of


def configs_folder() -> Path:
    """The folder with `experiments`, `evaluations`, `mixtures`, `policies` and `scales`."""
    inside = Path(__file__).parent / _FOLDER
    return inside if inside.is_dir() else Path(__file__).parents[1] / _FOLDER


def config_names(kind: str) -> list[str]:
    """Names of the package's files of a kind, such as `small/foundation` of `experiments`, sorted."""
    folder = configs_folder() / kind
    paths = (path.relative_to(folder) for path in folder.rglob("*.yaml"))
    return sorted(path.with_suffix("").as_posix() for path in paths if _PARTS not in path.parts)


def find_config(given: str | Path, kind: str) -> Path:
    """The file at a path or, where there is none, the package's file of that kind and name.

    `small/foundation`, `small/foundation.yaml` and `configs/experiments/small/foundation.yaml` are the same experiment
    wherever the package is installed.

    Raises:
        UserError: neither is there; the closest name is told.
    """
    folder, path = configs_folder(), Path(given)
    places = [path, folder / kind / f"{given}.yaml", folder / kind / path, folder.parent / path]
    if kind == _OF_NO_FOLDER:
        places += [folder / f"{given}.yaml"]  # `debug`
    found = next((place for place in places if place.is_file()), None)
    if found is not None:
        return found
    name = path.with_suffix("").as_posix().removeprefix(f"{_FOLDER}/{kind}/")
    beside = path.parent.glob("[!.]*.yaml") if path.parent.is_dir() and path.suffix else ()
    closest = suggest(path.name, [other.name for other in beside])
    if not closest.startswith("Did you mean"):
        closest = suggest(name, config_names(kind))
    raise UserError(f"no file {given}, and none of that name in {_FOLDER}/{kind}/. {closest}")
