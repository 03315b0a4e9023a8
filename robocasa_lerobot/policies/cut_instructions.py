"""Instructions that are longer than what a policy reads of them."""

from __future__ import annotations

from collections.abc import Sequence

from lerobot.configs.policies import PreTrainedConfig

from robocasa_lerobot.policies.common.language import count_words

_READS_WORDS = {"diffusion_transformer": ("text_encoder", "token"), "flow_vla": ("prefix", "scratch")}


def cut_instructions(config: PreTrainedConfig, instructions: Sequence[str]) -> str | None:
    """A sentence about instructions of which a policy would not read the end; None where it reads all words."""
    setting, value = _READS_WORDS.get(config.type, ("", None))
    if value is None or getattr(config, setting) != value:
        return None
    most: int = getattr(config, "max_words")  # noqa: B009  of ours alone
    long = [text for text in instructions if count_words(text) > most]
    if not long:
        return None
    longest = max(long, key=count_words)
    return (
        f"{len(long)} of {len(instructions)} instructions are cut after {most} words (`policy.max_words`), the longest "
        f"has {count_words(longest)}: {longest!r}"
    )
