"""What a wording is: an instruction, and other ways to say it.

Words in braces are names of the scene's objects, or values that were drawn at reset (`envs.task.Choice`).
"""

from __future__ import annotations

from typing import NamedTuple


class Wording(NamedTuple):
    """An instruction and at least four paraphrases, kept as novel language."""

    instruction: str
    paraphrases: tuple[str, ...]


def say(instruction: str, *paraphrases: str) -> Wording:
    """A wording."""
    return Wording(instruction, paraphrases)
