"""Numbers of a page as text: byte-shuffled, compressed, and each array only once."""

from __future__ import annotations

import base64
import zlib
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

Kind = Literal["f32", "f64"]
Place = dict[str, Any]
DTYPES: dict[Kind, np.dtype[Any]] = {"f32": np.dtype("<f4"), "f64": np.dtype("<f8")}
GZIP = 16 + zlib.MAX_WBITS
"""Asks zlib for a gzip header, which then holds no time: the same numbers give the same text."""
LEVEL = 9


class Arrays:
    """Collects arrays, and says where each of them lies.

    A place is {"dtype": "f32" | "f64", "offset": bytes, "shape": [...]}, in C order. Arrays are stored
    little-endian, with all first bytes of their numbers, then all second ones, ...: neighbours then look alike,
    and compress well.
    """

    def __init__(self) -> None:
        self._parts: list[bytes] = []
        self._places: dict[tuple[Kind, bytes], int] = {}
        self._size = 0

    def add(self, values: ArrayLike, kind: Kind = "f32") -> Place:
        """Store an array, unless it is there already, and return its place.

        What is not finite, or too large for the kind, becomes NaN: a gap.
        """
        numbers = np.asarray(values, dtype=np.float64)
        with np.errstate(over="ignore"):
            stored = numbers.astype(DTYPES[kind])
        stored = np.where(np.isfinite(stored), stored, stored.dtype.type(np.nan)).astype(DTYPES[kind])
        bytes_of_each = stored.reshape(-1).view(np.uint8).reshape(-1, stored.itemsize)
        part = bytes_of_each.T.tobytes()
        if (kind, part) not in self._places:
            self._places[kind, part] = self._size
            self._parts.append(part)
            self._size += len(part)
        return {"dtype": kind, "offset": self._places[kind, part], "shape": list(numbers.shape)}

    def text(self) -> str:
        """Return base64(gzip(all arrays))."""
        packer = zlib.compressobj(LEVEL, zlib.DEFLATED, GZIP)
        packed = b"".join([*(packer.compress(part) for part in self._parts), packer.flush()])
        return base64.b64encode(packed).decode("ascii")
