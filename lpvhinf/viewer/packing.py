"""Arrays as text that a page unpacks into typed arrays, in little-endian order."""

from __future__ import annotations

import base64
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

Kind = Literal["int8", "int16", "float32"]


def packed(values: ArrayLike, kind: Kind) -> str:
    """Base64 of an array's numbers in C order.

    Examples
    --------
    >>> packed([1, -1], "int16"), unpacked("AQD//w==", "int16").tolist()
    ('AQD//w==', [1, -1])
    """
    return base64.b64encode(np.ascontiguousarray(values, dtype=np.dtype(kind).newbyteorder("<")).tobytes()).decode()


def unpacked(text: str, kind: Kind) -> np.ndarray[tuple[int], np.dtype[np.generic]]:
    """What `packed` had, flat."""
    return np.frombuffer(base64.b64decode(text), dtype=np.dtype(kind).newbyteorder("<"))
