"""Read and write named arrays in .npz files; a reader declares the arrays that a file may have."""

from __future__ import annotations

import io
import stat
import warnings
import zipfile
from collections import Counter
from collections.abc import Iterable, Mapping
from fnmatch import fnmatchcase
from math import inf
from pathlib import Path
from typing import NamedTuple, TypeVar

import msgspec
import numpy as np

from quadsim.files.strict_yaml import FileError
from quadsim.files.yaml_errors import shown

LARGEST = 500_000_000  # [bytes], of a file and of all of its arrays together
SUFFIX = ".npy"  # ends an array's name within the archive
# Numbers of arrays' names and of characters of a library's message that an error shows
NAMES = 5
LONGEST = 160

Schema = TypeVar("Schema")


class Declared(NamedTuple):
    """The declaration of an array that a file may have."""

    dtype: str  # NumPy's name of it; "str" stands for text of any length
    # Lengths of the dimensions. A name stands for any length, which is the same
    # wherever the name occurs among the arrays of a file.
    shape: tuple[int | str, ...] = ()
    required: bool = True
    # The greatest absolute value allowed. If there is one, infinities and NaN are refused too.
    most: float = inf


TEXT = Declared("str")  # one text, such as a JSON document


class ArrayError(ValueError):
    """An error of an array that differs from its declaration; the message names the array."""


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
        FileError: the file is missing, unreadable, too large or not a regular file.
    """
    try:
        status = path.stat()
        # opening a pipe would wait for a writer, and a device has no end
        if not stat.S_ISREG(status.st_mode):
            raise FileError(f"{path}: expected {what}, got a folder, a pipe or a device")
        if status.st_size > largest:
            size = f"at most {largest:,} bytes, got {status.st_size:,}"
            raise FileError(f"{path}: expected {what} of {size}")
        with path.open("rb") as file:
            data = file.read(largest + 1)
    except OSError as error:
        reason = error.strerror or str(error)
        raise FileError(f"{path}: expected {what}: {reason.lower()}") from None
    # the size that a file names may be wrong, in /proc for example
    if len(data) > largest:
        raise FileError(f"{path}: expected {what} of at most {largest:,} bytes, got more")
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
        declared: the arrays that the file may have. A name may be a pattern, such as "cost.*",
            which stands for any number of arrays.
        path: the file's name for error messages.
        what: the kind of file for error messages, such as "a pilot".
        largest: the number of bytes that all arrays may take together.

    Raises:
        FileError: the content is damaged, or differs from the declaration.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            members = _members(archive, declared, largest)
            arrays = {name: _array(archive, member.entry) for name, member in members.items()}
        lengths: dict[str, int] = {}
        for name, member in members.items():
            _check(name, arrays[name], member.wanted, lengths)
        return arrays
    except ArrayError as error:
        problem = str(error)
    # a damaged archive fails in a dozen ways
    except Exception as error:
        problem = f"damaged: {_one_line(error)}"
    raise FileError(f"{path}: expected {what}: {problem}")


def record_of(text: np.ndarray, schema: type[Schema], path: object, what: str) -> Schema:
    """Return the JSON document in an array that was declared as TEXT.

    Args:
        text: the array.
        schema: the type of the document: a msgspec Struct, a dataclass, a dict of types. Numbers in
            quotes and NaN are rejected.
        path: the file's name for error messages.
        what: the kind of file for error messages, such as "a pilot".

    Raises:
        FileError: the text is not such a document.
    """
    try:
        return msgspec.json.decode(text.item(), type=schema)
    except (msgspec.MsgspecError, ValueError, RecursionError) as error:
        problem = _one_line(error)
    raise FileError(f"{path}: expected {what}: {problem}")


class _Header(msgspec.Struct):
    """The key of a document that names its format."""

    format: str | None = None


def expect_format(
    text: np.ndarray, expected: str, path: object, what: str, advice: str = ""
) -> None:
    """Check the key `format` of the JSON document in an array that was declared as TEXT.

    Args:
        text: the array.
        expected: the only format that can be read.
        path: the file's name for error messages.
        what: the kind of file for error messages, such as "a pilot".
        advice: advice for a file of another format.

    Raises:
        FileError: the text is not such a document, or has another format.
    """
    found = record_of(text, _Header, path, what).format
    if found != expected:
        got = repr(listed([found])) if found else "none"
        ending = f": {advice}" if advice else ""
        raise FileError(f"{path}: expected {what} of the format {expected!r}, got {got}{ending}")


class _Member(NamedTuple):
    """An array in the archive, and its declaration."""

    entry: zipfile.ZipInfo
    wanted: Declared


def _members(
    archive: zipfile.ZipFile, declared: Mapping[str, Declared], largest: int
) -> dict[str, _Member]:
    """Return the archive's arrays by name, in the order of the declarations.

    Raises:
        ArrayError: an array is missing, unknown or duplicate, or all together are too large.
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
        matching = [entry for entry in entries if _matches(_name(entry), pattern)]
        for entry in matching:
            found.setdefault(_name(entry), _Member(entry, wanted))
        if wanted.required and not matching:
            missing.append(pattern)
    unknown = [name for name in counts if name not in found]
    if missing or unknown:
        raise ArrayError(f"arrays missing or unknown: {listed(sorted(missing + unknown))}")
    return found


def _matches(name: str, pattern: str) -> bool:
    """Return whether an array's name fits a declared pattern and can be printed."""
    return fnmatchcase(name, pattern) and name.isprintable() and len(name) <= LONGEST


def _name(entry: zipfile.ZipInfo) -> str:
    """Return the name of the array in a member of the archive."""
    return entry.filename.removesuffix(SUFFIX)


def _array(archive: zipfile.ZipFile, entry: zipfile.ZipInfo) -> np.ndarray:
    """Return one array of the archive.

    Raises:
        ArrayError: the member is not an array, or is an array of Python objects. NumPy's message is
            not shown, because it advises to trust the file.
    """
    content = io.BytesIO(archive.read(entry))
    try:
        # A warning, as of a file from Python 2, counts as an error
        with warnings.catch_warnings(action="error"):
            array = np.load(content, allow_pickle=False)
        if isinstance(array, np.ndarray) and not content.read(1):
            return array
    except Exception:
        pass
    raise ArrayError(f"{_name(entry)}: expected an array, got other content")


def _check(name: str, array: np.ndarray, wanted: Declared, lengths: dict[str, int]) -> None:
    """Check an array against its declaration.

    Args:
        name: the array's name.
        array: the array.
        wanted: declaration of the array.
        lengths: lengths of named dimensions so far; new ones are added.

    Raises:
        ArrayError: the array differs from its declaration.
    """
    is_text = wanted.dtype == "str" and array.dtype.kind == "U"
    fits = is_text or array.dtype == np.dtype(wanted.dtype)
    if not fits or not _has_shape(array.shape, wanted, lengths):
        known = tuple(lengths.get(str(length), length) for length in wanted.shape)
        described = _described(wanted._replace(shape=known))
        raise ArrayError(f"{name}: expected {described}, got {_kind(array)}")
    if wanted.most < inf:
        greatest = float(np.abs(array).max(initial=0.0))
        # NaN is not smaller than any number
        if not greatest <= wanted.most:
            raise ArrayError(f"{name}: expected numbers up to {wanted.most:g}, got {greatest:g}")


def _has_shape(shape: tuple[int, ...], wanted: Declared, lengths: dict[str, int]) -> bool:
    """Return whether a shape fits the declaration.

    The first array with a named dimension decides the length of this dimension.

    Args:
        shape: the found shape.
        wanted: declaration of the array.
        lengths: lengths of named dimensions so far; new ones are added.
    """
    if len(shape) != len(wanted.shape):
        return False
    for length, dimension in zip(shape, wanted.shape, strict=True):
        expected = dimension
        if isinstance(dimension, str):
            expected = lengths.setdefault(dimension, length)
        if length != expected:
            return False
    return True


def _described(wanted: Declared) -> str:
    """Return a declaration as text for errors, such as "float64 (61, n)"."""
    dimensions = ", ".join(map(str, wanted.shape))
    comma = "," if len(wanted.shape) == 1 else ""
    kind = "text" if wanted.dtype == "str" else wanted.dtype
    return f"{kind} ({dimensions}{comma})"


def _kind(array: np.ndarray) -> str:
    """Return the type and shape of an array as text for errors, such as "float32 (4, 3)"."""
    kind = {"U": "text", "V": "records"}.get(array.dtype.kind, str(array.dtype))
    return f"{kind} {array.shape}"


def listed(names: Iterable[str]) -> str:
    """Return the first names as text, with the number of names that are left out."""
    every = [name if name.isprintable() and len(name) <= LONGEST else shown(name) for name in names]
    more = len(every) - NAMES
    return ", ".join(every[:NAMES]) + (f" and {more} more" if more > 0 else "")


def _one_line(error: Exception) -> str:
    """Return a library's message on one line, shortened and without control characters."""
    text = " ".join(str(error).split()) or type(error).__name__
    if len(text) > LONGEST:
        text = text[: LONGEST - 3] + "..."
    return text if text.isprintable() else shown(text)
