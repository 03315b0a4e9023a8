"""Filming a trial: pictures from the contract's cameras, large enough to look at, into a streamed video."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robocasa_lerobot import contract
from robocasa_lerobot.errors import LackingMachineError, UserError
from robocasa_lerobot.video import FILM_EVERY, FILM_SIZE, VideoWriter, side_by_side


class NoPicturesError(UserError):
    """An env that has nothing to film."""


class FilmError(LackingMachineError):
    """A film that cannot be written, which is no fault of its trial."""

    def __init__(self, path: Path, error: Exception) -> None:
        super().__init__(
            f"the film {path} cannot be written: {error}. Free disk space and give the command again, or give "
            "--videos=0. What has been recorded stays."
        )


class Film:
    """A video of one trial, in real time: every second picture, at half the control rate (10 fps in our kitchens).

    An env with `renderer_of_size`, as a kitchen, is filmed by one of the film's own size, so that a policy with small
    inputs still gets a film that shows something, and the env renders what the policy sees and no more. Of any other
    env the observation's pictures are filmed.
    """

    def __init__(self, path: Path, control_hz: float | None = None) -> None:
        self._path, self._writer = (
            path,
            VideoWriter(path, max(1, round((control_hz or contract.CONTROL_HZ) / FILM_EVERY))),
        )
        self._renderer: Any = None

    def shoot(self, env: Any, observation: dict[str, Any], step: int) -> None:
        """Film the present state; `env` is unwrapped, `step` counts from 0 at the reset."""
        if step % FILM_EVERY == 0:
            picture = side_by_side(self._pictures(env, observation))
            try:
                self._writer.write(picture)
            except Exception as error:  # PyAV raises errors of its own, most of them no OSError
                raise FilmError(self._path, error) from error

    def needs_observation(self, env: Any) -> bool:
        """Whether the env itself has to render at each step for the film."""
        return not hasattr(type(env), "renderer_of_size")

    def _pictures(self, env: Any, observation: dict[str, Any]) -> dict[str, NDArray[np.uint8]]:
        if self.needs_observation(env):
            pixels = observation.get("pixels")
            if pixels is None or len(pixels) == 0:
                raise NoPicturesError("the env shows no `pixels`: there is nothing to film. Give --videos=0.")
            return pixels if isinstance(pixels, dict) else {"picture": pixels}
        if self._renderer is None:
            self._renderer = env.renderer_of_size(FILM_SIZE, FILM_SIZE)
        pictures = self._renderer.pictures(env.data, contract.CAMERAS)  # together: the state is looked at once
        return dict(zip(contract.CAMERAS, pictures, strict=True))

    def __enter__(self) -> Film:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._renderer is not None:
            self._renderer.close()
        try:
            self._writer.close(keep=kind is None)
        except Exception as fault:
            raise FilmError(self._path, fault) from fault
