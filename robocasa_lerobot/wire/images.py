"""Compressed pictures in messages, as vla-eval sends them: `{"__image__": true, "format", "data", "shape"}`.

Source: vla-eval 0.8.0, protocol/image_codec.py.
"""

from __future__ import annotations

import io
from typing import Any, Final

import numpy as np

from robocasa_lerobot.wire.codec import MAX_MESSAGE_BYTES, WireError

MARK: Final = "__image__"
_FORMATS: Final = ("PNG", "JPEG")
_MAX_DEPTH: Final = 8


def decode_images(message: Any, max_bytes: int = MAX_MESSAGE_BYTES) -> Any:
    """A decoded message whose compressed pictures are read-only uint8 arrays (H, W, C).

    Args:
        message: of `codec.decode`.
        max_bytes: of all its pictures together, once they are decoded.

    Raises:
        WireError: a picture that is none, has another shape than it says, or is too large.
    """
    return _Reader(max_bytes).read(message, 0)


def encode_png(picture: np.ndarray) -> dict[str, Any]:
    """A uint8 picture (H, W, 3) without loss, as vla-eval sends it by default."""
    from PIL import Image

    stream = io.BytesIO()
    Image.fromarray(picture).save(stream, format="PNG", compress_level=1)
    return {MARK: True, "format": "png", "data": stream.getvalue(), "shape": list(picture.shape)}


class _Reader:
    def __init__(self, max_bytes: int) -> None:
        self._left = max_bytes

    def read(self, value: Any, depth: int) -> Any:
        if depth > _MAX_DEPTH:
            raise WireError(f"a message nested more than {_MAX_DEPTH} deep")
        if isinstance(value, dict):
            if MARK in value:
                return self._picture(value)
            return {key: self.read(one, depth + 1) for key, one in value.items()}
        if isinstance(value, list):
            return [self.read(one, depth + 1) for one in value]
        return value

    def _picture(self, value: dict[Any, Any]) -> np.ndarray:
        data, shape = value.get("data"), value.get("shape")
        if not isinstance(data, bytes) or not isinstance(shape, list) or len(shape) != 3:
            raise WireError("a picture needs bytes and a shape of three sizes")
        if not all(isinstance(size, int) and not isinstance(size, bool) and 0 < size < 2**16 for size in shape):
            raise WireError(f"the shape of a picture is {shape!r:.60}; (H, W, C) was expected")
        height, width, channels = shape
        self._left -= height * width * channels
        if self._left < 0:
            raise WireError("the pictures of a message are too large")
        array = self._raw(data, shape) if value.get("format") == "raw" else _compressed(data, (height, width))
        if array.shape != (height, width, channels):
            raise WireError(f"a picture of shape {array.shape} says that it has {tuple(shape)}")
        array.flags.writeable = False
        return array

    def _raw(self, data: bytes, shape: list[int]) -> np.ndarray:
        if len(data) != int(np.prod(shape)):
            raise WireError(f"a raw picture of shape {shape} has {len(data)} bytes")
        return np.frombuffer(data, np.uint8).reshape(shape)


def _compressed(data: bytes, size: tuple[int, int]) -> np.ndarray:
    from PIL import Image

    try:
        with Image.open(io.BytesIO(data), formats=_FORMATS) as picture:
            if (picture.height, picture.width) != size:  # before anything is decompressed
                raise WireError(f"a picture of {picture.height}x{picture.width} says that it has {size[0]}x{size[1]}")
            array = np.array(picture)
    except WireError:
        raise
    except Exception as error:  # Pillow raises a dozen kinds for broken files
        raise WireError(f"a picture cannot be read: {type(error).__name__}: {error}") from error
    if array.dtype != np.uint8:
        raise WireError(f"a picture of dtype {array.dtype}; uint8 was expected")
    return array[..., None] if array.ndim == 2 else array
