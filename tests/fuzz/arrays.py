"""Damaged .npz files: other arrays, other JSON, archives that lie, places that are no file."""

from __future__ import annotations

import io
import json
import os
import random
import struct
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from tests.fuzz.damage import damaged_bytes, damaged_json

# [bytes] of zeros that an archive of some kilobytes brings
BOMB = 64 << 20
# Levels of JSON; json.loads and msgspec give up far below
DEEP = 200_000
# Values where a number, a name or a list belongs
ODD: tuple[Any, ...] = (
    None, True, -1, 0, 1.5, 2**70, 1e308, -1e308, 1e-308, "2", "0.01", "x" * 5000, "\x1b[2J",
    [], {}, ["1", "2"], [[1.0]], "1234", [True] * 4, [1e308] * 4, [0.0] * 4,
)  # fmt: skip
NUMBERS = ("NaN", "Infinity", "-Infinity", "1e400", "-1e400")

Arrays = dict[str, np.ndarray]


def arrays_in(data: bytes) -> Arrays:
    """Return the arrays of an undamaged file."""
    with np.load(io.BytesIO(data)) as loaded:
        return {name: loaded[name] for name in loaded.files}


def npz(arrays: Arrays, compression: int = zipfile.ZIP_DEFLATED) -> bytes:
    """Return a file with these arrays, also with such that only a pickle holds."""
    return _members({name: _npy(array) for name, array in arrays.items()}, compression)


def damaged_npz(rng: random.Random, data: bytes, text: str) -> bytes:
    """Return a damaged file.

    Args:
        rng: decides the damage.
        data: the undamaged file.
        text: the name of the array that holds JSON.
    """
    arrays = arrays_in(data)
    kind = rng.random()
    if kind < 0.15:
        return damaged_bytes(rng, data)
    if kind < 0.5:
        arrays[text] = np.array(_other_json(rng, str(arrays[text])))
        return npz(arrays)
    if kind < 0.75:
        return npz(_other_arrays(rng, arrays))
    return rng.choice(CONTAINERS)(rng, arrays)


def damage_place(rng: random.Random, path: Path, data: bytes) -> None:
    """Write the data to the path; now and then the path is no regular file."""
    match rng.randrange(14):
        case 0:
            os.mkfifo(path)
        case 1:
            path.symlink_to("/dev/zero")
        case 2:
            path.mkdir()
        case 3:
            path.symlink_to(path.name)
        case _:
            path.write_bytes(data)


def _other_json(rng: random.Random, text: str) -> str:
    """Return JSON with other values, too deep, with numbers that are none, or none at all."""
    match rng.randrange(8):
        case 0:
            return rng.choice(("[", '{"a":')) * DEEP
        case 1:
            return _with_values(rng, text, (rng.choice(("[" * DEEP + "]" * DEEP, *NUMBERS)),))
        case 2 | 3 | 4:
            return _with_values(rng, text, tuple(map(json.dumps, ODD)))
        case 5:
            return rng.choice(("", "null", "[]", "3", '"x"', "{}", "\ud800", "{}" * 2))
        case _:
            return damaged_json(rng, text)


def _with_values(rng: random.Random, text: str, values: tuple[str, ...]) -> str:
    """Return a JSON object in which one value, at the top or below, is another text."""
    root = json.loads(text)
    holder = root
    while True:
        key = rng.choice(list(holder))
        inner = holder[key]
        if not isinstance(inner, dict) or not inner or rng.random() < 0.5:
            break
        holder = inner
    holder[key] = "@@@"
    return json.dumps(root).replace('"@@@"', rng.choice(values))


def _other_arrays(rng: random.Random, arrays: Arrays) -> Arrays:
    """Return arrays of which one is lost, renamed, or of another kind, shape or size."""
    numbers = [name for name, array in arrays.items() if array.dtype.kind != "U"]
    name = rng.choice(numbers)
    array = arrays.pop(name)
    spoilt = np.array(array, float)
    if spoilt.size:
        spoilt.flat[rng.randrange(spoilt.size)] = rng.choice((np.nan, np.inf, 1e308, -3e38, 1e30))
    with np.errstate(all="ignore"):
        replacements: list[Arrays] = [
            {},
            {"x": array},
            {"\x1b[1m": array, name: array},
            {name: array[:-1]},
            {name: array[None]},
            {name: array.ravel()},
            {name: array.T},
            {name: array[::-1]},
            {name: array[:0]},
            {name: np.zeros((0, 0), array.dtype)},
            {name: array[..., :1]},
            {name: np.repeat(array, 2, axis=-1)},
            {name: spoilt.astype(array.dtype)},
            {name: np.full_like(array, 3e38 if array.dtype.kind == "f" else 30_000)},
            {name: array * array.dtype.type(-1)},
            {name: (array * 1e9).astype(array.dtype)},
            {name: (array * 1e-9).astype(array.dtype)},
            {name: (array * 1e30).astype(array.dtype)},
            {name: (array - 1e6).astype(array.dtype)},
            {name: array + array.dtype.type(3)},
            {name: array.astype(np.float64)},
            {name: array.astype(np.float16)},
            {name: array.astype(np.complex64)},
            {name: array.astype(bool)},
            {name: array.astype(">f4")},
            {name: array.astype(object)},
            {name: np.array([{"a": 1}], object)},
            {name: np.array(["x"] * 3)},
            {name: np.array("1.0")},
            {name: np.zeros(array.shape, "M8[s]")},
            {name: np.zeros(array.shape, [("a\x1b", "f4"), ("b", "O")])},
        ]
    return arrays | rng.choice(replacements)


def _encrypted(rng: random.Random, arrays: Arrays) -> bytes:
    """Return an archive whose members ask for a password."""
    return encrypted(npz(arrays))


def encrypted(archive: bytes) -> bytes:
    """Return an archive with the flag set that says its members are encrypted."""
    data = bytearray(archive)
    for signature, offset in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        at = data.find(signature)
        while at >= 0:
            data[at + offset] |= 1
            at = data.find(signature, at + 4)
    return bytes(data)


def _damaged_lzma(rng: random.Random, arrays: Arrays) -> bytes:
    """Return an archive of another compression whose streams are damaged."""
    data = bytearray(npz(arrays, rng.choice((zipfile.ZIP_LZMA, zipfile.ZIP_BZIP2))))
    for _ in range(rng.choice((1, 4, 40))):
        data[rng.randrange(60, len(data) * 3 // 4)] ^= 1 << rng.randrange(8)
    return bytes(data)


def _with_header(rng: random.Random, arrays: Arrays) -> bytes:
    """Return an archive in which the header of an array says something else."""
    name = rng.choice(list(arrays))
    array = arrays[name]
    row = "{'descr': %r, 'fortran_order': %s, 'shape': %s, }"
    descr = array.dtype.str
    header = rng.choice(
        (
            "((((",
            "(" * 3000,
            "{}",
            "",
            "\xff\xfe",
            "__import__('os').system('touch pwned')",
            row % (descr, "False", "(100000000000, 10)"),
            row % (descr, "False", "(-1, -3)"),
            row % (descr, "True", "(True,)"),
            row % (descr, "False", "(" + "1, " * 200 + ")"),
            row % (descr, "False", "(" + "1, " * 2000 + ")"),
            row % (descr, "False", "(10L, 4L)"),
            row % (descr, "False", "('a',)"),
            row % ("|O", "False", "(3,)"),
            row % ("<U1000000000", "False", "()"),
            row % ("<f999", "False", "(3,)"),
            row % ("<f4", "'no'", "(3,)"),
            row.replace("%r", "['x', '<f4']") % ("False", "(3,)"),
            " " * 60_000 + row % (descr, "False", str(array.shape)),
        )
    )
    version = rng.choice(((1, 0), (2, 0), (3, 0), (9, 9), (0, 0)))
    text = header.encode("latin1" if version[0] < 3 else "utf8") + b"\n"
    size = struct.pack("<H" if version == (1, 0) else "<I", len(text))
    content = b"\x93NUMPY" + bytes(version) + size + text + array.tobytes()
    return _members({k: _npy(v) for k, v in arrays.items()} | {name: content})


def _npy(array: np.ndarray) -> bytes:
    content = io.BytesIO()
    np.lib.format.write_array(content, np.asarray(array), allow_pickle=True)
    return content.getvalue()


def _members(contents: dict[str, bytes], compression: int = zipfile.ZIP_DEFLATED) -> bytes:
    """Return an archive of these members, which does not depend on the time of day."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, content in contents.items():
            archive.writestr(zipfile.ZipInfo(f"{name}.npy"), content, compression)
    return buffer.getvalue()


def _bomb(rng: random.Random, arrays: Arrays) -> bytes:
    """Return an archive with a member of zeros, as an array of its own or in place of another."""
    name = rng.choice([*arrays, "bomb"])
    kind = arrays[name].dtype if name in arrays else np.dtype("f4")
    itemsize = max(kind.itemsize, 1)
    shape = (BOMB // itemsize,) if rng.random() < 0.5 else (BOMB // itemsize // 4, 4)
    return npz(arrays | {name: np.zeros(shape, kind)})


def _lying_sizes(rng: random.Random, arrays: Arrays) -> bytes:
    """Return an archive whose directory names other sizes than its members have."""
    data = bytearray(npz(arrays))
    at = data.find(b"PK\x01\x02")
    while at >= 0:
        size = rng.choice((0, 1, 100, 2**31, 2**32 - 2))
        data[at + 24 : at + 28] = struct.pack("<I", size)
        at = data.find(b"PK\x01\x02", at + 4)
    return bytes(data)


def _twice(rng: random.Random, arrays: Arrays) -> bytes:
    """Return an archive with two members of one name."""
    name = rng.choice(list(arrays))
    buffer = io.BytesIO(npz(arrays))
    with zipfile.ZipFile(buffer, "a") as archive:
        # zipfile warns of the second one's name; another of the same length is renamed below
        archive.writestr(zipfile.ZipInfo("~" * len(name) + ".npy"), _npy(arrays[name]))
    return buffer.getvalue().replace(b"~" * len(name), name.encode())


def _many(rng: random.Random, arrays: Arrays) -> bytes:
    """Return an archive with thousands of members."""
    return npz(arrays | {f"more_{i}\n": np.zeros(1) for i in range(3000)})


def _text_code_points(rng: random.Random, arrays: Arrays) -> bytes:
    """Return an archive whose texts hold what is no character."""
    contents = {name: _npy(array) for name, array in arrays.items()}
    for name, array in arrays.items():
        if array.dtype.kind == "U":
            contents[name] = contents[name][:-4] + rng.choice((b"\xff" * 4, b"\x00\xd8\x00\x00"))
    return _members(contents)


CONTAINERS: tuple[Callable[[random.Random, Arrays], bytes], ...] = (
    _encrypted,
    _damaged_lzma,
    _with_header,
    _with_header,
    _with_header,
    _bomb,
    _lying_sizes,
    _twice,
    _many,
    _text_code_points,
)
