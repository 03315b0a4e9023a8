"""The beginning of a run with a policy behind a socket: what the server says, which key map is meant, the probe."""

from __future__ import annotations

import hashlib
import json
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from robocasa_lerobot.errors import UserError
from robocasa_lerobot.evaluation.remote.address import GR00T, OPENPI, VLA_EVAL, Address
from robocasa_lerobot.evaluation.remote.client import TOKEN_VARIABLE, PolicyClient, Timeouts
from robocasa_lerobot.evaluation.remote.connect import connect
from robocasa_lerobot.evaluation.remote.described import OURS, is_ours, map_of_ours, maps_of_modality_config
from robocasa_lerobot.evaluation.remote.failures import LostError, RemoteError
from robocasa_lerobot.evaluation.remote.key_map import AUTO, KeyMap, from_tree, load_key_map, presets, with_executed
from robocasa_lerobot.evaluation.remote.probe import probe
from robocasa_lerobot.wire.codec import text_of

UNKNOWN_WEIGHTS = "unknown:"  # what fingerprints begin with: nobody can see the weights behind a socket
_LONG_ARRAY, _LONG_TEXT = 64, 2000


@dataclass(frozen=True)
class RemotePolicy:
    """A policy behind a socket as a run knows it; picklable.

    `keys` is the name of the key map, `metadata` what the server said, in values of JSON.
    """

    address: Address
    keys: str
    key_map: KeyMap
    metadata: dict[str, Any]
    timeouts: Timeouts = field(default_factory=Timeouts)

    @classmethod
    def recorded(cls, address: Address, described: Mapping[str, Any]) -> RemotePolicy:
        """The policy of a run's header."""
        key_map = from_tree(dict(described["key_map"]), f"the key map of {address.text}")
        return cls(address, str(described["keys"]), key_map, dict(described["metadata"]))

    @property
    def fingerprint(self) -> str:
        """SHA-256 over key map and metadata, marked as one that says nothing of the weights."""
        content = json.dumps([asdict(self.key_map), self.metadata], sort_keys=True)
        return UNKNOWN_WEIGHTS + hashlib.sha256(content.encode()).hexdigest()

    def describe(self) -> dict[str, Any]:
        """What the header of a run says about it."""
        said = self.metadata.get("policy")
        said = said.get("fingerprint") if isinstance(said, Mapping) else None
        return {
            "address": self.address.text,
            "protocol": self.address.protocol,
            "keys": self.keys,
            "key_map": asdict(self.key_map),
            "metadata": self.metadata,
            "weights": f"unknown; the server says {said}" if said else "unknown",
            "outcomes": "fixed by the trial's seed, which the server is told"
            if self.key_map.repeats
            else "depend on the server's random state",
        }


class Introduction:
    """A connection that has been made for the probe.

    Args:
        address: of the server.
        keys: preset, file or `auto`; None: what the protocol or the server itself says.
        executed_steps: in the place of the key map's.
        timeouts: seconds of patience.

    Raises:
        UserError: the server cannot be reached, or no key map is known or fits it.
    """

    def __init__(self, address: Address, keys: str | None, executed_steps: int | None, timeouts: Timeouts) -> None:
        self._address, self._timeouts = address, timeouts
        try:
            self._client: PolicyClient = connect(address, timeouts, token=os.environ.get(TOKEN_VARIABLE))
        except RemoteError as error:
            why = " Start the server, then give the same command again." if isinstance(error, LostError) else ""
            raise UserError(f"the policy cannot be asked: {error}.{why}") from error
        try:
            self._keys, found = _choose(address, keys, self._client.metadata)
            self._candidates = [with_executed(key_map, executed_steps) for key_map in found]
        except BaseException:
            self._client.close()
            raise

    @property
    def image_size(self) -> int:
        """Pixels, height and width, at which the env renders for this policy."""
        return self._candidates[0].image_size

    def probe(self, image_size: int) -> RemotePolicy:
        """Ask once, and end the connection; pictures are rendered at `image_size`.

        Raises:
            UserError: key, found and expected of what does not fit.
        """
        try:
            key_map = probe(self._client, self._candidates, image_size, self._address.text, self._keys)
            return RemotePolicy(self._address, self._keys, key_map, plain(self._client.metadata), self._timeouts)
        finally:
            self._client.close()

    def close(self) -> None:
        """End the connection without a probe."""
        self._client.close()


def _choose(address: Address, keys: str | None, metadata: Mapping[str, Any]) -> tuple[str, Sequence[KeyMap]]:
    """Name of the key map, and the maps to try."""
    if keys is None:
        defaults = {OPENPI: None, GR00T: AUTO, VLA_EVAL: VLA_EVAL}
        keys = OURS if is_ours(metadata) else defaults[address.protocol]
    if keys is None:
        raise UserError(
            f"{address.text}: openpi's servers do not say what they take: give --policy.keys, one of "
            f"{', '.join(_presets_for(address.protocol))}, or the file of a key map."
        )
    if keys == OURS:
        return keys, [map_of_ours(metadata, address.protocol)]
    if keys == AUTO:
        if address.protocol != GR00T:
            raise UserError(f"{address.text}: the key map auto is for gr00t://, whose servers say what they take.")
        return keys, maps_of_modality_config(metadata)
    key_map = load_key_map(keys)
    if key_map.protocol not in (None, address.protocol):
        known = ", ".join(_presets_for(address.protocol))
        raise UserError(f"{address.text}: the key map {keys} is for {key_map.protocol}://; for this one: {known}.")
    return keys, [key_map]


def _presets_for(protocol: str) -> list[str]:
    return [name for name in presets() if load_key_map(name).protocol in (None, protocol)]


def plain(value: Any) -> Any:
    """A decoded message in values of JSON: long texts and arrays are shortened to what they are."""
    if isinstance(value, Mapping):
        return {str(text_of(key)): plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [plain(one) for one in value]
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist()) if value.size <= _LONG_ARRAY else f"{value.dtype} array of shape {value.shape}"
    if isinstance(value, bytes):
        return f"{len(value)} bytes"
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    if value is None or isinstance(value, bool | int | float):
        return value
    text = str(value)
    return text if len(text) <= _LONG_TEXT else text[:_LONG_TEXT] + "..."
