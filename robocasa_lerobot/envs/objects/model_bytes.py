"""The shape of an object as bytes, to be kept on disk (`envs.kept_files`): every number comes back as it was."""

from __future__ import annotations

import dataclasses
import zlib

import msgpack
import numpy as np

from robocasa_lerobot.envs.objects.draft import Interior, Model
from robocasa_lerobot.envs.objects.solids import Solid

_LEVEL = 1  # a quarter of the size in 0.2 ms; higher ones gain a tenth


def to_bytes(model: Model) -> bytes:
    """A model as bytes, about 7 kB."""
    fields = {field.name: getattr(model, field.name) for field in dataclasses.fields(model)}
    fields["solids"] = [[s.kind, s.size, s.pos, s.quat, s.points.tolist()] for s in model.solids]
    fields["interior"] = None if model.interior is None else [model.interior.center, model.interior.half]
    return zlib.compress(msgpack.packb(fields), _LEVEL)


def from_bytes(content: bytes) -> Model:
    """The model that `to_bytes` was given."""
    fields = msgpack.unpackb(zlib.decompress(content), use_list=False)
    solids = tuple(
        Solid(kind, size, pos, quat, np.array(points, dtype=np.float64).reshape(-1, 3))
        for kind, size, pos, quat, points in fields["solids"]
    )
    interior = None if fields["interior"] is None else Interior(*fields["interior"])
    return Model(**{**fields, "solids": solids, "interior": interior})
