"""The first request of a run: whatever is wrong is an error that names key, found and expected."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from robocasa_lerobot import contract
from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.remote.client import PolicyClient
from robocasa_lerobot.evaluation.remote.failures import AnswerError, LostError, RemoteError, ServerSaidError
from robocasa_lerobot.evaluation.remote.key_map import KeyMap, load_key_map, path_of, presets
from robocasa_lerobot.evaluation.remote.translation import actions_of, listed, request_of
from robocasa_lerobot.wire.codec import WireError

INSTRUCTION = "open the drawer"
_MISSING = re.compile(r"KeyError: ['\"]([^'\"]+)['\"]")
_LONGEST = 4000  # characters of a server's traceback that are shown: its end


def probe(client: PolicyClient, candidates: Sequence[KeyMap], image_size: int, who: str, name: str) -> KeyMap:
    """The first of the candidates whose answer fits.

    Args:
        client: a new connection.
        candidates: key maps in the order in which they are tried.
        image_size: pixels at which the env renders.
        who: address of the server, for errors.
        name: of the key map, likewise.

    Raises:
        UserError: none fits, for each the reason; or the server could not be reached any more.
    """
    reasons: list[str] = []
    for key_map in candidates:
        message = request_of(key_map, observations(len(key_map.offsets), image_size), INSTRUCTION)
        try:
            client.reset(key_map.reset)
            _check(key_map, client.infer(message))
            return key_map
        except LostError as error:
            raise UserError(f"the first request to the policy was not answered: {error}") from error
        except ServerSaidError as error:
            said = str(error)[-_LONGEST:]
            reasons.append(
                f"the server answered the first request with an error:\n{said}\nSent were {listed(message)} "
                f"(key map {name}).{_remedy(said, message)}"
            )
        except WireError as error:
            raise UserError(f"key map {name}: {error}; look at its `constants` and `reset`.") from error
        except (AnswerError, RemoteError) as error:
            reasons.append(f"the first answer does not fit the key map {name}: {error}.")
    raise UserError(f"{who}: " + "\nThen, with the same names otherwise: ".join(reasons))


def observations(count: int, image_size: int) -> list[dict[str, Any]]:
    """Observations as an env gives them, of a robot that stands still: grey pictures, unit quaternions."""
    state = np.zeros(contract.STATE_SIZE)
    for part in contract.STATE_PARTS:
        if part.name.endswith(("rotation", "rotation_relative")):
            state[contract.STATE_SLICES[part.name].stop - 1] = 1.0
    picture = np.tile(np.linspace(64, 192, image_size, dtype=np.uint8)[:, None, None], (1, image_size, 3))
    return [{"pixels": dict.fromkeys(contract.CAMERAS, picture), "agent_pos": state} for _ in range(count)]


def _check(key_map: KeyMap, answer: Mapping[str, Any]) -> None:
    actions = actions_of(key_map, answer)
    if np.isfinite(actions).all():
        return
    for one in key_map.actions:
        for part in one.parts:
            values = actions[:, contract.ACTION_SLICES[part]]
            wrong = int((~np.isfinite(values)).sum())
            if wrong:
                raise AnswerError(
                    f"{one.key}: found {wrong} of {values.size} numbers of {part} that are not finite, expected numbers"
                )


def _remedy(said: str, message: Mapping[str, Any]) -> str:
    """Which presets send a key that the server has missed."""
    missed = _MISSING.findall(said)
    if not missed:
        return ""
    key = missed[-1]
    having = [name for name in presets() if key in _keys(load_key_map(name))]
    if having and key not in message:
        return f" {key!r} is in the key map {' and in '.join(having)}: give --policy.keys."
    return f" It asked for {key!r}: give a key map that has it (--policy.keys)."


def _keys(key_map: KeyMap) -> set[str]:
    return {name for key in key_map.sent_keys for name in path_of(key)}
