"""Who decided each step of a demonstration, as recordings by hand say it."""

from __future__ import annotations

from collections.abc import Iterable

from robocasa_lerobot.convert.reading.demo import Demo

# Below an episode: whether a person decided the step while there was a policy, what the policy wanted, whether the step
# belongs to a planned motion that the person asked for.
DECISIONS: tuple[str, ...] = ("intervention", "policy_action", "assisted")


def decisions_of(demos: Iterable[Demo]) -> tuple[str, ...]:
    """Those of `DECISIONS` that all of some demos have, in that order."""
    common = DECISIONS
    for demo in demos:
        common = tuple(key for key in common if demo.has(key))
        if not common:
            break
    return common
