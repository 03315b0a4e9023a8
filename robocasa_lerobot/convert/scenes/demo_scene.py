"""Where the scene of a demonstration is found: enough for any process to read it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Self

from robocasa_lerobot.convert.reading.demo import Demo
from robocasa_lerobot.convert.reading.demo_file import DemoFile
from robocasa_lerobot.convert.reading.layout import Layout
from robocasa_lerobot.convert.reading.mjcf import AssetFinder, loadable
from robocasa_lerobot.convert.settings import Plan


@dataclass(frozen=True)
class DemoScene:
    """The scene of one demo; calling it gives the loadable MJCF and its files, as `loadable` does."""

    file: Path
    layout: Layout
    demo: str
    asset_roots: tuple[str, ...]

    @classmethod
    def of(cls, plan: Plan, file: Path, demo: str) -> Self:
        """Of a demo in a file, read as planned."""
        return cls(file, plan.settings.layout, demo, plan.settings.asset_roots)

    def __call__(self) -> tuple[str, dict[str, bytes]]:
        """Read it from the file, which stays open for the next one."""
        file = _opened(self.file, self.layout)
        return self.read(file, file.demo(self.demo))

    def read(self, file: DemoFile, demo: Demo) -> tuple[str, dict[str, bytes]]:
        """Read it from its demo, whose file is open.

        Raises:
            RejectedEpisodeError, MissingAssetsError: as `loadable`.
        """
        assert demo.model_xml is not None, "whoever asks has looked"
        return loadable(demo.model_xml, AssetFinder([Path(root) for root in self.asset_roots], file.asset))


@lru_cache(maxsize=1)
def _opened(path: Path, layout: Layout) -> DemoFile:
    return DemoFile(path, layout)
