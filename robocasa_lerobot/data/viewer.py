"""LeRobot's dataset viewer, for datasets with stages too.

    python -m robocasa_lerobot.data.viewer --repo-id local/data --root data/ --episode-index 0

`lerobot-dataset-viz` of LeRobot 0.6 puts frames into batches by torch's own rules, which know no None, and rows of its
`language_persistent` have fields that are None. Here they stay lists; everything else is its own.
"""

from __future__ import annotations

from typing import Any


def main() -> None:
    """Run the viewer with the arguments of this process."""
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
