"""Named arrays in .npz files. A reader declares what a file may hold; nothing in it is executed."""

from __future__ import annotations

import io
import json
import stat
import zipfile
from collections import Counter
from collections.abc import Mapping
from fnmatch import fnmatchcase
from math import prod
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.lib import format as npy

from quadsim.files.strict_yaml import FileError
from quadsim.files.yaml_errors import shown

LARGEST = 500_000_000  # [bytes], of a file and of all of its arrays together
SUFFIX = ".npy"  # ends an array's name within the archive


class Declared(NamedTuple):
    """An array that a file may hold."""

    dtype: str  # NumPy's name of it; "str" stands for text of any length
    # Lengths of the dimensions. A name stands for any length, which is the same
    # wherever the name occurs among the arrays of a file.
    shape: tuple[int | str, ...] = ()
    finite: bool = False  # whether infinities and NaN are refused
    required: bool = True


TEXT = Declared("str")  # one text, such as a JSON document


class ArrayError(ValueError):
    """An array is not as it was declared. The message names it."""


def npz_bytes(arrays: Mapping[str, np.ndarray], compressed: bool = False) -> bytes:
    """Return the content of an .npz file with these arrays."""
    buffer = io.BytesIO()
    write = np.savez_compressed if compressed else np.savez
    write(buffer, **arrays)  # pyright: ignore[reportArgumentType] (its allow_pickle is no array)
    return buffer.getvalue()


def read_bytes(path: Path, what: str, largest: int = LARGEST) -> bytes:
    """Return the content of a regular file.

    Args:
        path: the file.
        what: the kind of file for error messages, such as "a pilot".
        largest: the number of bytes above which a file is not read.

    Raises:
        FileError: the file is missing, unreadable, too large or no regular file.
    """
    try:
        status = path.stat()
        # opening a pipe would wait for a writer, and a device has no end
        if not stat.S_ISREG(status.st_mode):
            raise FileError(f"{path}: expected {what}, got a folder, a pipe or a device")
        with path.open("rb") as file:
            data = file.read(largest + 1)
    except OSError as error:
        reason = error.strerror or str(error)
        raise FileError(f"{path}: expected {what}: {reason.lower()}") from None
    if len(data) > largest:
        size = f"at most {largest:,} bytes, got {status.st_size:,}"
        raise FileError(f"{path}: expected {what} of {size}")
    return data


def read_arrays(
    path: Path, declared: Mapping[str, Declared], what: str, largest: int = LARGEST
) -> dict[str, np.ndarray]:
    """Return the arrays of an .npz file by name; see `arrays_of` and `read_bytes`."""
    return arrays_of(read_bytes(path, what, largest), declared, path, what, largest)


def arrays_of(
    data: bytes,
    declared: Mapping[str, Declared],
    path: object,
    what: str,
    largest: int = LARGEST,
) -> dict[str, np.ndarray]:
    """Return the arrays of an .npz file's content by name.

    Args:
        data: the content of the file.
        declared: the arrays that the file may hold. A name may be a pattern, such as "cost.*",
            which stands for any number of arrays.
        path: the file's name for error messages.
        what: the kind of file for error messages, such as "a pilot".
        largest: the number of bytes that all arrays may take together.

    Raises:
        FileError: the content is damaged or holds anything else than was declared. The message
            is one line.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            members = _members(archive, declared, largest)
            found = {name: _array(archive, name, *member) for name, member in members.items()}
        _check_shapes(found, {name: member.wanted for name, member in members.items()})
    except ArrayError as error:
        problem = str(error)
    # a damaged archive fails in a dozen ways
    except Exception as error:
        problem = "damaged: " + " ".join(str(error).split())
    else:
        return found
    raise FileError(f"{path}: expected {what}: {problem}")


def record_of(text: np.ndarray, path: object, what: str) -> dict[str, Any]:
    """Return the JSON object in an array that was declared as TEXT.

    Raises:
        FileError: the text is no JSON object.
    """
    try:
        record = json.loads(str(text))
    except (ValueError, RecursionError) as error:
        raise FileError(f"{path}: expected {what}: damaged: {error}") from None
    if not isinstance(record, dict):
        raise FileError(f"{path}: expected {what}: expected a JSON object in it")
    return record


class _Member(NamedTuple):
    """An array in the archive, and how it was declared."""

    entry: zipfile.ZipInfo
    wanted: Declared


def _members(
    archive: zipfile.ZipFile, declared: Mapping[str, Declared], largest: int
) -> dict[str, _Member]:
    """Return the archive's arrays by name, in the order of the declarations.

    Raises:
        ArrayError: an array is missing, unknown or there twice, or all together are too large.
    """
    entries = archive.infolist()
    counts = Counter(_name(entry) for entry in entries)
    twice = [name for name, count in counts.items() if count > 1]
    if twice:
        raise ArrayError(f"{shown(twice[0])}: expected one array of this name, got several")
    # zipfile reads no more of a member than the size that its entry gives
    size = sum(entry.file_size for entry in entries)
    if size > largest:
        raise ArrayError(f"expected arrays of at most {largest:,} bytes, got {size:,}")

    found: dict[str, _Member] = {}
    missing: list[str] = []
    for pattern, wanted in declared.items():
        matching = [entry for entry in entries if fnmatchcase(_name(entry), pattern)]
        for entry in matching:
            found.setdefault(_name(entry), _Member(entry, wanted))
        if wanted.required and not matching:
            missing.append(pattern)
    unknown = [name if name.isprintable() else shown(name) for name in counts if name not in found]
    if missing or unknown:
        raise ArrayError(f"arrays missing or unknown: {', '.join(sorted(missing + unknown))}")
    return found


def _name(entry: zipfile.ZipInfo) -> str:
    """Return the name of the array in a member of the archive."""
    return entry.filename.removesuffix(SUFFIX)


def _array(
    archive: zipfile.ZipFile, name: str, entry: zipfile.ZipInfo, wanted: Declared
) -> np.ndarray:
    """Return one array. Its numbers are not read before its type is known. Raises ArrayError."""
    with archive.open(entry) as file:
        version = npy.read_magic(file)
        read_header = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
        shape, by_columns, dtype = read_header(file)
        is_text = wanted.dtype == "str" and dtype.kind == "U"
        if not is_text and dtype != np.dtype(wanted.dtype):
            raise ArrayError(f"{name}: expected {_described(wanted)}, got {_kind(dtype)} {shape}")
        content = file.read()
    size = dtype.itemsize * prod(shape)
    if len(content) != size:
        raise ArrayError(f"{name}: expected {size:,} bytes, got {len(content):,}")
    order = "F" if by_columns else "C"
    array = np.ndarray(shape, dtype, bytearray(content), order=order)
    if wanted.finite and not np.isfinite(array).all():
        raise ArrayError(f"{name}: expected finite numbers")
    return array


def _check_shapes(found: Mapping[str, np.ndarray], declared: Mapping[str, Declared]) -> None:
    """Raise ArrayError unless the shapes are those declared, with one length for each name."""
    lengths: dict[str, int] = {}
    for name, wanted in declared.items():
        shape = found[name].shape
        fits = len(shape) == len(wanted.shape)
        for length, dimension in zip(shape, wanted.shape, strict=False):
            expected = dimension
            if isinstance(dimension, str):
                # the first array with a name of a length decides it
                expected = lengths.setdefault(dimension, length)
            fits = fits and length == expected
        if not fits:
            known = tuple(d if isinstance(d, int) else lengths.get(d, d) for d in wanted.shape)
            described = _described(wanted._replace(shape=known))
            raise ArrayError(
                f"{name}: expected {described}, got {_kind(found[name].dtype)} {shape}"
            )


def _described(wanted: Declared) -> str:
    """Return a declaration as an error shows it: "float64 (61, n)"."""
    dimensions = ", ".join(map(str, wanted.shape))
    comma = "," if len(wanted.shape) == 1 else ""
    kind = "text" if wanted.dtype == "str" else wanted.dtype
    return f"{kind} ({dimensions}{comma})"


def _kind(dtype: np.dtype) -> str:
    """Return a found dtype as an error shows it."""
    if dtype.hasobject:
        return "Python objects"
    return "text" if dtype.kind == "U" else str(dtype)
