"""Pictures that a file holds one to a chunk, inflated twice as fast as HDF5 does it.

HDF5 inflates with zlib; reading the chunk as it lies in the file and inflating it with Intel's ISA-L takes 0.19 instead
of 0.53 ms for a 256x256 picture, which is a quarter of the whole conversion of a file with pictures.
"""

from __future__ import annotations

import zlib

import h5py
import numpy as np
from isal import igzip_lib, isal_zlib
from numpy.typing import NDArray

_DEFLATE = 1  # number of HDF5's gzip filter


def holds_deflated_rows(dataset: h5py.Dataset) -> bool:
    """Whether every chunk is one whole row (picture) of bytes that went through gzip and nothing else."""
    properties = dataset.id.get_create_plist()
    return (
        dataset.dtype == np.uint8
        and dataset.chunks == (1, *dataset.shape[1:])
        and properties.get_nfilters() == 1
        and properties.get_filter(0)[0] == _DEFLATE
    )


def deflated_row(dataset: h5py.Dataset, index: int) -> NDArray[np.uint8]:
    """One row of a dataset for which `holds_deflated_rows`; read-only.

    Raises:
        OSError: the chunk is damaged.
    """
    mask, stored = dataset.id.read_direct_chunk((index,) + (0,) * (dataset.ndim - 1))
    if mask:  # written without its filter
        row: NDArray[np.uint8] = dataset[index]
        return row
    shape = dataset.shape[1:]
    size = int(np.prod(shape))
    try:
        stream = isal_zlib.decompressobj()
        content = stream.decompress(stored, size + 1)  # one more than there may be, so that a lie is found
    except (igzip_lib.IsalError, zlib.error) as error:  # type: ignore[misc]
        raise OSError(f"its part {index} cannot be inflated: {error}") from None
    if len(content) != size:
        raise OSError(f"its part {index} holds {len(content)} bytes or more, not {size}")
    if not stream.eof:
        raise OSError(f"its part {index} is cut off")
    return np.frombuffer(content, np.uint8).reshape(shape)
