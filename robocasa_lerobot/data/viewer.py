"""LeRobot's dataset viewer, for datasets with stages too.

    python -m robocasa_lerobot.data.viewer --repo-id local/data --root data/ --episode-index 0

`lerobot-dataset-viz` of LeRobot 0.6 puts frames into batches by torch's own rules, which know no None, and rows of its
`language_persistent` have fields that are None. Here they stay lists; everything else is its own.
"""

from __future__ import annotations

import argparse
import importlib.util
from pathlib import Path
from typing import Any


def main() -> None:
    """Run the viewer with the arguments of this process.

    Raises:
        SystemExit: `--root` is no dataset, which LeRobot would create and look for on the hub, or rerun is missing.
    """
    parser = argparse.ArgumentParser(add_help=False, allow_abbrev=False)
    parser.add_argument("--root", type=Path)
    root = parser.parse_known_args()[0].root
    if root is not None and not (root / "meta" / "info.json").is_file():
        raise SystemExit(f"--root {root}: found no meta/info.json there, expected the folder of a LeRobotDataset v3.0.")
    if root is not None and importlib.util.find_spec("rerun") is None:
        raise SystemExit("rerun is missing: uv pip install --python .venv/bin/python 'rerun-sdk>=0.24,<0.34'")
    from lerobot.scripts import lerobot_dataset_viz

    allow_none()
    lerobot_dataset_viz.main()


def allow_none() -> None:
    """Have torch's batches of this process keep None as lists (extending its table is what torch documents)."""
    from torch.utils.data._utils.collate import default_collate_fn_map

    default_collate_fn_map[type(None)] = _as_list


def _as_list(batch: list[None], *, collate_fn_map: Any = None) -> list[None]:
    return batch


if __name__ == "__main__":
    main()
