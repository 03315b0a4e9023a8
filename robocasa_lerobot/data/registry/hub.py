"""Datasets of a mixture that are named by their repository on the hub: fetched when training needs them, then kept."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from robocasa_lerobot.data.mixture_config import MixtureConfig
from robocasa_lerobot.data.registry.published import dataset_version
from robocasa_lerobot.errors import UserError


def fetch_missing(mixtures: Iterable[MixtureConfig]) -> list[Path]:
    """Fetch the missing members with a `repo_id`; gives the new folders.

    A folder appears complete or not at all; what a kill left is taken up.

    Raises:
        UserError: the hub has no such dataset, cannot be reached, or has it in another version than v3.0.
    """
    members = [member for mixture in mixtures for member in mixture.members if member.repo_id]
    fetched = []
    for root, name in dict.fromkeys((Path(member.root), str(member.repo_id)) for member in members):
        if not root.exists():
            _fetch(name, root)
            fetched.append(root)
    return fetched


def _fetch(name: str, root: Path) -> None:
    import huggingface_hub

    aside = root.with_name(f".{root.name}.fetching")
    aside.mkdir(parents=True, exist_ok=True)
    try:
        huggingface_hub.snapshot_download(name, repo_type="dataset", local_dir=str(aside))
    except Exception as error:  # of many kinds: no such repository, gated, no network, offline
        said = (str(error).strip().splitlines() or [type(error).__name__])[0]
        raise UserError(
            f"the dataset {name} could not be fetched from the hub: {said} Try `hf download {name} --repo-type dataset "
            f"--local-dir {root}` yourself (`hf auth login` for gated ones)."
        ) from error
    version = dataset_version(aside)
    if version != "v3.0":
        raise UserError(
            f"the dataset {name} is LeRobotDataset {version or 'of no version'}, v3.0 is needed: it lies at {aside}; "
            f"`robocasa-lerobot convert {aside} --out {root}` converts v2.1."
        )
    aside.rename(root)
