"""Arrays of a file: what was declared is read, and anything else is one line."""

import io
import os
import zipfile

import msgspec
import numpy as np
import pytest

from quadsim.files.arrays import (
    TEXT,
    Declared,
    arrays_of,
    npz_bytes,
    read_arrays,
    read_bytes,
    record_of,
)
from quadsim.files.strict_yaml import FileError
from tests.fuzz.arrays import encrypted

T = np.arange(4.0)
X = np.arange(12, dtype=np.float32).reshape(4, 3)
GOOD = {"t": T, "x": X, "about": np.array('{"a": 1}')}
DECLARED = {
    "about": TEXT,
    "t": Declared("float64", ("frames",), most=1e6),
    "x": Declared("float32", ("frames", 3)),
    "count": Declared("int64", required=False),
    "cost.*": Declared("float32", ("costs",), required=False),
}


def found_in(data, largest=10_000):
    return arrays_of(data, DECLARED, "a.npz", "an example", largest)


def stored(name, data, times=1):
    """Return a zip archive with this member in place of x."""
    buffer = io.BytesIO(npz_bytes({name: a for name, a in GOOD.items() if name != "x"}))
    with zipfile.ZipFile(buffer, "a") as archive:
        for _ in range(times):
            archive.writestr(name, data)
    return buffer.getvalue()


def npy(array):
    buffer = io.BytesIO()
    np.save(buffer, array)
    return buffer.getvalue()


@pytest.mark.parametrize("compressed", [False, True])
def test_what_is_read_is_what_was_written(compressed):
    costs = {"cost.gate": np.ones(2, np.float32), "cost.way": np.zeros(2, np.float32)}
    arrays = GOOD | costs | {"x": np.asfortranarray(X), "count": np.array(7)}
    found = found_in(npz_bytes(arrays, compressed))
    assert found.keys() == arrays.keys()
    for name, array in arrays.items():
        np.testing.assert_array_equal(found[name], array)
        assert found[name].dtype == array.dtype
    found["t"][0] = 5.0  # it may be written to
    assert record_of(found["about"], dict[str, int], "a.npz", "an example") == {"a": 1}


def test_empty_arrays_are_arrays():
    found = found_in(npz_bytes(GOOD | {"t": T[:0], "x": X[:0]}))
    assert found["x"].shape == (0, 3)


BAD = {
    "no archive": (b"abc", "zip"),
    "nothing": (b"", "zip"),
    "cut": (npz_bytes(GOOD)[:-40], "zip"),
    "missing": (npz_bytes({"t": T, "about": GOOD["about"]}), "x"),
    "unknown": (npz_bytes(GOOD | {"y": T}), "y"),
    "unknown with a line break": (npz_bytes(GOOD | {"y\n": T}), "y"),
    "another type": (npz_bytes(GOOD | {"t": T.astype(np.float32)}), "t: .*float32"),
    "the other byte order": (npz_bytes(GOOD | {"t": T.astype(">f8")}), "t: "),
    "numbers for text": (npz_bytes(GOOD | {"about": T}), "about: "),
    "text for numbers": (npz_bytes(GOOD | {"t": np.array(["a"] * 4)}), "t: .*text"),
    "objects": (npz_bytes(GOOD | {"t": np.array([{}] * 4)}), "t: expected an array"),
    "more dimensions": (npz_bytes(GOOD | {"t": T[:, None]}), "t: "),
    "another length": (npz_bytes(GOOD | {"t": T[:3]}), r"x: expected float32 \(3, 3\)"),
    "another width": (npz_bytes(GOOD | {"x": X[:, :2]}), "x: "),
    "not finite": (npz_bytes(GOOD | {"t": T * np.nan}), "t: .*nan"),
    "too large": (npz_bytes(GOOD | {"t": np.zeros(5000), "x": np.zeros((5000, 3), "f4")}), "bytes"),
    "no array": (stored("x.npy", b"abc"), "x: expected an array"),
    "shorter than its header says": (stored("x.npy", npy(X)[:-4]), "x: expected an array"),
    "longer than its header says": (stored("x.npy", npy(X) + b"1234"), "x: expected an array"),
    "huge by its header": (
        stored("x.npy", npy(X).replace(b"(4, 3), }      ", b"(4, 3000000), }")),
        "x: expected an array",
    ),
}


def test_anything_else_is_one_line():
    for name, (data, problem) in BAD.items():
        with pytest.raises(FileError, match=problem) as error:
            found_in(data)
        assert str(error.value).startswith("a.npz: expected an example: "), name
        assert "\n" not in str(error.value), name


@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_an_array_that_is_there_twice_is_refused():
    with pytest.raises(FileError, match="x"):
        found_in(stored("x.npy", npy(X), times=2))


def test_no_bit_that_is_turned_gets_past_unseen():
    whole = npz_bytes(GOOD, compressed=True)
    rng = np.random.default_rng(0)
    for _ in range(300):
        data = bytearray(whole)
        data[rng.integers(len(data))] ^= 1 << rng.integers(8)
        try:
            found = found_in(bytes(data))
        except FileError:
            continue
        for name, array in GOOD.items():
            np.testing.assert_array_equal(found[name], array)


class Numbers(msgspec.Struct, forbid_unknown_fields=True):
    """A document of some types."""

    count: int
    share: float = 0.5


NO_NUMBERS = (
    "[1]",
    "{",
    "1",
    "[" * 100_000,
    '{"count": ' + "[" * 100_000,
    '{"count": "1"}',
    '{"count": 1.5}',
    '{"count": true}',
    '{"count": NaN}',
    '{"count": 1, "share": 1e400}',
    '{"count": 1, "share": Infinity}',
    '{"count": 1, "\\u001b[1m": 0}',
    '{"count": 1, "' + "x" * 5000 + '": 0}',
    '{"share": 1.0}',
    "\ud800",
    "",
)


def test_a_record_has_the_types_that_were_declared():
    for text in NO_NUMBERS:
        with pytest.raises(FileError) as error:
            record_of(np.array(text), Numbers, "a.npz", "an example")
        assert str(error.value).startswith("a.npz: expected an example: ")
        assert str(error.value).isprintable()
        assert len(str(error.value)) < 300


def headed(header, version=(1, 0)):
    """Return an array with this text in place of its header."""
    text = header.encode("latin1")
    size = len(text).to_bytes(2 if version == (1, 0) else 4, "little")
    return b"\x93NUMPY" + bytes(version) + size + text + X.tobytes()


PLAIN = "{'descr': '<f4', 'fortran_order': False, 'shape': %s}"
HOSTILE = {
    "encrypted": encrypted(npz_bytes(GOOD)),
    "no expression": stored("x.npy", headed("((((")),
    "nested deeply": stored("x.npy", headed("(" * 3000)),
    "rows without end": stored("x.npy", headed(PLAIN % "(100000000000, 3)")),
    "a negative shape": stored("x.npy", headed(PLAIN % "(-4, -3)")),
    "thousands of dimensions": stored("x.npy", headed(PLAIN % ("(" + "1, " * 3000 + ")"))),
    "a long header": stored("x.npy", headed(" " * 60_000 + PLAIN % "(4, 3)")),
    "Python 2": stored("x.npy", headed(PLAIN % "(4L, 3L)")),
    "an unknown version": stored("x.npy", headed(PLAIN % "(4, 3)", (9, 9))),
    "other types": npz_bytes(GOOD | {"x": np.zeros((4, 3), [("\x1b[1m", "f4")])}),
    "dates": npz_bytes(GOOD | {"x": np.zeros((4, 3), "M8[s]")}),
    "rows that are not there": stored("x.npy", headed(PLAIN % "(5, 3)")),
    "thousands of names": npz_bytes(GOOD | {f"more{i}\n": T for i in range(2000)}),
    "a long name": npz_bytes(GOOD | {"y" * 60_000: T}),
    "a control character after a pattern": npz_bytes(GOOD | {"cost.\x1b[1m": X[0]}),
}


def test_a_hostile_file_is_one_short_line_and_no_warning(recwarn):
    for name, data in HOSTILE.items():
        with pytest.raises(FileError) as error:
            found_in(data, largest=10_000_000)
        text = str(error.value)
        assert text.startswith("a.npz: expected an example: "), name
        assert text.isprintable(), name
        assert len(text) < 1000, name
        assert not recwarn.list, name
        for advice in ("pickle", "unsafe", "trust", "password"):
            assert advice not in text or name == "encrypted", name


def test_numbers_beyond_the_greatest_one_are_refused():
    declared = {"x": Declared("float32", (4, 3), most=11.0)}
    assert arrays_of(npz_bytes({"x": X}), declared, "a.npz", "an example")["x"].max() == 11.0
    for far in (11.5, -3e38, np.nan, np.inf):
        other = X.copy()
        other[1, 1] = far
        with pytest.raises(FileError, match="x: expected"):
            arrays_of(npz_bytes({"x": other}), declared, "a.npz", "an example")


def test_only_a_regular_file_of_its_size_is_read(tmp_path):
    path = tmp_path / "a.npz"
    path.write_bytes(npz_bytes(GOOD))
    assert read_arrays(path, DECLARED, "an example").keys() == GOOD.keys()
    with pytest.raises(FileError, match="bytes"):
        read_bytes(path, "an example", largest=100)
    os.mkfifo(tmp_path / "pipe")
    for other in (tmp_path / "pipe", tmp_path, tmp_path / "none"):
        with pytest.raises(FileError) as error:
            read_bytes(other, "an example")
        assert str(error.value).startswith(f"{other}: expected an example")
