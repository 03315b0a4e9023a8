"""Which demos of a file are converted: those of a filter key, a sample, or those that were named."""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Protocol

from robocasa_lerobot import contract
from robocasa_lerobot.convert.reading.demo import SourceError
from robocasa_lerobot.errors import UnknownNameError, UserError

_COUNT_KEY = re.compile(r"(\d+)_demos$")
_COUNT = re.compile(r"\d+$")
_SHARE = re.compile(r"(\d+(?:\.\d+)?)%$")
_RANGE = re.compile(r"(\d+)-(\d+)$")


class Listing(Protocol):
    """What a selection is made from: an HDF5 file, or a dataset folder."""

    @property
    def path(self) -> Path:
        """Where it is."""

    @property
    def demo_names(self) -> Sequence[str]:
        """Names of its episodes, in order."""

    @property
    def masks(self) -> Collection[str]:
        """Its filter keys."""

    def mask(self, key: str) -> Sequence[str]:
        """The episodes of a filter key."""


def sample(names: Sequence[str], count: int, seed: int) -> tuple[str, ...]:
    """`count` of the names, in the order of `names`; all where there are no more. Which: `contract.demo_subset`."""
    return tuple(names[index] for index in contract.demo_subset(len(names), count, seed))


def check_selection(filter_key: str | None, demos: str | None) -> None:
    """Refuse selections that mean nothing for any file.

    Raises:
        UserError: a filter key and a selection of demos are both given, or the selection cannot be read.
    """
    if demos is not None:
        if filter_key is not None and not _is_sample(demos):
            raise UserError("--filter-key and --demos with names exclude each other: give one of them.")
        _parse(demos)


def select(file: Listing, filter_key: str | None, demos: str | None, seed: int = 0) -> tuple[str, ...]:
    """Names of the demos to convert, in the order of the file.

    Args:
        file: an open file or a dataset folder.
        filter_key: a list `mask/<filter_key>` of the file; `<N>_demos` also where the file has no such list, then by
            the benchmark's rule (`sample`).
        demos: `50` (a sample of so many), `10%` (of so many of a hundred), or names and ranges of numbers such as
            `demo_3,7-9`; after the filter key.
        seed: of the sample.

    Raises:
        UserError: an unknown filter key or demo, or nothing is left.
    """
    names: Sequence[str] = file.demo_names
    if filter_key is not None:
        names = _of_filter_key(file, filter_key, seed)
    if demos is None:
        return tuple(names)
    parsed = _parse(demos)
    if isinstance(parsed, int):
        return sample(names, parsed, seed)
    if isinstance(parsed, float):
        return sample(names, max(1, round(len(names) * parsed)), seed)
    wanted: set[str] = set()
    for item in parsed:
        wanted |= set(_named(item, names, file))
    return tuple(name for name in names if name in wanted)


def _of_filter_key(file: Listing, key: str, seed: int) -> tuple[str, ...]:
    if key in file.masks:
        listed = file.mask(key)
        unknown = [name for name in listed if name not in set(file.demo_names)]
        if unknown:
            raise SourceError(
                f"{file.path}: mask/{key} lists {unknown[0]!r}, which the file does not hold ({len(unknown)} such "
                "names). Choose another filter key, or take --demos."
            )
        if not listed:
            raise SourceError(f"{file.path}: mask/{key} lists no demos.")
        chosen = set(listed)
        return tuple(name for name in file.demo_names if name in chosen)
    match = _COUNT_KEY.match(key)
    if match is None or int(match[1]) == 0:
        remedy = f"({file.path}; <N>_demos is a sample of N demos)"
        raise UnknownNameError("filter key", key, file.masks, remedy)
    return sample(file.demo_names, int(match[1]), seed)


def _is_sample(text: str) -> bool:
    return bool(_COUNT.match(text.strip()) or _SHARE.match(text.strip()))


def _parse(text: str) -> int | float | list[str]:
    """A number of demos, a share of them (0 to 1), or names and ranges."""
    text = text.strip()
    if _COUNT.match(text):
        if int(text) < 1:
            raise UserError("--demos 0: at least one demo is needed.")
        return int(text)
    share = _SHARE.match(text)
    if share:
        if not 0 < float(share[1]) <= 100:
            raise UserError(f"--demos {text}: more than 0 % and at most 100 % is possible.")
        return float(share[1]) / 100
    items = [item.strip() for item in text.split(",")]
    if not all(items):
        raise UserError(
            f"--demos {text!r} cannot be read: give a number (50), a share (10%), or names and ranges (demo_3,7-9)."
        )
    return items


def _named(item: str, names: Sequence[str], file: Listing) -> list[str]:
    if item in names:
        return [item]
    numbers = {int(match[1]): name for name in names if (match := re.search(r"(\d+)$", name))}
    bounds = _RANGE.match(item)
    if bounds:
        found = [name for number, name in numbers.items() if int(bounds[1]) <= number <= int(bounds[2])]
        if not found:
            raise UserError(f"--demos {item}: {file.path} has no demo with such a number ({names[0]} to {names[-1]}).")
        return found
    raise UnknownNameError("demo", item, names, f"({file.path})")
