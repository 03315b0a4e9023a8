"""What a policy solved alone, and where it was corrected, told from a file of corrections."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np

from robocasa_lerobot import contract


def correction_line(path: Path) -> str:
    """How many of a file's episodes were corrected, and for how many control steps at the median."""
    with h5py.File(path) as file:
        corrected = [int(demo[contract.INTERVENTION][()].sum()) for demo in file["data"].values()]
    lengths = [steps for steps in corrected if steps]
    alone = len(corrected) - len(lengths)
    if not lengths:
        return f"{path.stem}: the policy solved all {alone} episodes alone; there is nothing to learn from here"
    return (
        f"{path.stem}: {len(lengths)} of {len(corrected)} episodes corrected, for {np.median(lengths):.0f} control "
        f"steps at the median; the policy solved {alone} alone"
    )
