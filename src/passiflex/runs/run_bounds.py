"""Whether the file of a run can be read at all: within itself, and in bounded memory."""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from pathlib import Path

import h5py
import numpy as np

from passiflex.errors import RunFileError

ROOM = 2**30
"""Bytes of numbers that any file may hold."""
RATIO = 100
"""A larger file may hold so many times its own size: numbers of a real run are packed to a third, constants better."""
CHUNK = 2**25
"""Most bytes of a chunk, which is unpacked as a whole."""
SUSPECT = 2**18
"""A packed chunk of fewer bytes unpacks into little, whatever it holds."""
ATTRIBUTE = 2**20
"""Most bytes of one attribute."""
ATTRIBUTES = 2**26
"""Most bytes of all attributes."""
PACKED_BY = {
    h5py.h5z.FILTER_DEFLATE,
    h5py.h5z.FILTER_SHUFFLE,
    h5py.h5z.FILTER_FLETCHER32,
    h5py.h5z.FILTER_LZF,
}
TRIED = "copying it from where it was made: passiflex simulate writes none of this"


def require_bounded(path: Path) -> None:
    """Raise RunFileError unless all that the file holds is in it, and bounded.

    Links to other places, data in other files, and what unpacks into far more than the file are refused; none of
    it is followed or unpacked to find that out.

    Raises
    ------
    OSError, RuntimeError and others of h5py
        If it is no readable HDF5 file.
    """
    size = path.stat().st_size
    room = max(ROOM, RATIO * size)
    with h5py.File(path, "r") as file:
        texts = _attribute_bytes(path, file, size)
        for data in _datasets(path, file):
            room -= _bytes(data, size)
            texts += _attribute_bytes(path, data, size)
            if room < 0 or texts > ATTRIBUTES:
                raise _refused(
                    path, f"more than {max(ROOM, RATIO * size) / 1e9:.2g} GB in {size / 1e6:.2g} MB"
                )


def _datasets(path: Path, file: h5py.File) -> Iterator[h5py.Dataset]:
    """Yield the signals of a run; groups, which are none, are left alone."""
    for name in file:
        if not isinstance(file.get(name, getlink=True), h5py.HardLink):
            raise _refused(path, f"a link to another place, {name!r}")
        data = file.get(name)
        if not isinstance(data, h5py.Dataset):
            continue
        if data.is_virtual or data.external:
            raise _refused(path, f"{name!r}, whose numbers are in another file")
        if data.chunks is not None:
            _require_bounded_chunks(path, name, data)
        yield data


def _require_bounded_chunks(path: Path, name: str, data: h5py.Dataset) -> None:
    """Raise RunFileError unless the packed chunks of a signal unpack into what they should."""
    whole = int(np.prod(data.chunks, dtype=object)) * data.dtype.itemsize
    filters = data.id.get_create_plist()
    kinds = [filters.get_filter(i)[0] for i in range(filters.get_nfilters())]
    if whole > CHUNK or not set(kinds) <= PACKED_BY or len(set(kinds)) < len(kinds):
        raise _refused(path, f"{name!r}, packed in an unusual way")
    if h5py.h5z.FILTER_DEFLATE not in kinds or data.id.get_storage_size() < SUSPECT:
        return
    large: list[tuple[int, ...]] = []

    def note(chunk: h5py.h5d.StoreInfo) -> None:
        if chunk.size >= SUSPECT:
            large.append(chunk.chunk_offset)

    data.id.chunk_iter(note)
    for offset in large:
        skipped, packed = data.id.read_direct_chunk(offset)
        at = kinds.index(h5py.h5z.FILTER_DEFLATE)
        if not skipped >> at & 1 and len(zlib.decompressobj().decompress(packed, whole + 9)) > whole + 8:
            raise _refused(path, f"{name!r}, a part of which unpacks into more than it should")


def _attribute_bytes(path: Path, item: h5py.File | h5py.Dataset, size: int) -> int:
    """Return about how many bytes the attributes of a file or signal take, one after the other."""
    total = 0
    for name in item.attrs:
        about = h5py.h5a.open(item.id, name.encode("utf-8", "surrogateescape"))
        count = int(np.prod(about.shape or (), dtype=object))
        text = h5py.check_string_dtype(about.dtype)
        if text is not None and text.length is None:  # as long as it likes, but within the file
            if count > 1 and count * size > ATTRIBUTES:
                raise _refused(path, f"an attribute of {count} texts, {name!r}")
            total += len(str(item.attrs[name]))
        elif (here := count * about.dtype.itemsize) > ATTRIBUTE:
            raise _refused(path, f"an attribute of {here / 1e6:.3g} MB, {name!r}")
        else:
            total += here
    return total


def _bytes(data: h5py.Dataset, size: int) -> int:
    """Return how many bytes a signal takes in memory, at most."""
    count = int(np.prod(data.shape or (), dtype=object))
    plain = data.dtype.kind in "biufcSV" and h5py.check_vlen_dtype(data.dtype) is None
    return count * (data.dtype.itemsize if plain else max(size, data.dtype.itemsize))


def _refused(path: Path, got: str) -> RunFileError:
    return RunFileError(f"{path} is not read", got=got, needs="a run that lies in its own file", try_=TRIED)
