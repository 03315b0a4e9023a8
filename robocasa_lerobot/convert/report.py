"""What a verification found: checks with their differences, and how close the pictures are."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

_MAX_DIFFERENCES = 20  # kept for each check


@dataclass
class Check:
    """One comparison: of how many values, and what differed."""

    name: str
    compared: int = 0
    num_differences: int = 0
    differences: list[str] = field(default_factory=list)

    @property
    def passed(self) -> bool:
        """Whether everything was equal and there was something to compare."""
        return self.num_differences == 0

    def fail(self, difference: str) -> None:
        """Note a difference."""
        self.num_differences += 1
        if len(self.differences) < _MAX_DIFFERENCES:
            self.differences.append(difference)

    def add(self, other: Check) -> None:
        """Add what another process found in the same comparison."""
        self.compared += other.compared
        self.num_differences += other.num_differences
        self.differences += other.differences[: _MAX_DIFFERENCES - len(self.differences)]

    def expect(self, equal: bool, difference: str) -> None:
        """Count one comparison."""
        self.compared += 1
        if not equal:
            self.fail(difference)


@dataclass
class CameraQuality:
    """Peak signal-to-noise ratio of decoded pictures against the true ones, in dB (infinite where equal)."""

    camera: str
    psnr_db: list[float] = field(default_factory=list)

    @property
    def minimum(self) -> float:
        """The worst picture."""
        return min(self.psnr_db, default=float("nan"))

    @property
    def mean(self) -> float:
        """Mean over the pictures."""
        return float(np.mean(self.psnr_db)) if self.psnr_db else float("nan")


@dataclass
class Report:
    """Outcome of a verification."""

    root: str
    num_episodes: int
    num_frames: int
    checks: list[Check]
    cameras: list[CameraQuality]

    def add(self, other: Report) -> None:
        """Take what another process found in a part of the same dataset.

        Raises:
            KeyError: it made a check that this one did not.
        """
        checks = {check.name: check for check in self.checks}
        cameras = {camera.camera: camera for camera in self.cameras}
        for check in other.checks:
            checks[check.name].add(check)
        for camera in other.cameras:
            cameras[camera.camera].psnr_db += camera.psnr_db

    @property
    def passed(self) -> bool:
        """Whether every check passed."""
        return all(check.passed for check in self.checks)

    def as_json(self) -> dict[str, Any]:
        """The report as plain data."""
        return {
            "root": self.root,
            "passed": self.passed,
            "num_episodes": self.num_episodes,
            "num_frames": self.num_frames,
            "checks": [
                {
                    "name": check.name,
                    "passed": check.passed,
                    "compared": check.compared,
                    "num_differences": check.num_differences,
                    "differences": check.differences,
                }
                for check in self.checks
            ],
            "cameras": [
                {"camera": c.camera, "pictures": len(c.psnr_db), "psnr_min_db": c.minimum, "psnr_mean_db": c.mean}
                for c in self.cameras
            ],
        }
