"""Arrays of a file: what was declared is read, and anything else is one line."""

import io
import os
import zipfile

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

T = np.arange(4.0)
X = np.arange(12, dtype=np.float32).reshape(4, 3)
GOOD = {"t": T, "x": X, "about": np.array('{"a": 1}')}
DECLARED = {
    "about": TEXT,
    "t": Declared("float64", ("frames",), finite=True),
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
    assert record_of(found["about"], "a.npz", "an example") == {"a": 1}


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
    "objects": (npz_bytes(GOOD | {"t": np.array([{}] * 4)}), "t: .*Python objects"),
    "more dimensions": (npz_bytes(GOOD | {"t": T[:, None]}), "t: "),
    "another length": (npz_bytes(GOOD | {"t": T[:3]}), r"x: expected float32 \(3, 3\)"),
    "another width": (npz_bytes(GOOD | {"x": X[:, :2]}), "x: "),
    "not finite": (npz_bytes(GOOD | {"t": T * np.nan}), "t: .*finite"),
    "too large": (npz_bytes(GOOD | {"t": np.zeros(5000), "x": np.zeros((5000, 3), "f4")}), "bytes"),
    "no array": (stored("x.npy", b"abc"), "magic"),
    "shorter than its header says": (stored("x.npy", npy(X)[:-4]), "x: .*bytes"),
    "longer than its header says": (stored("x.npy", npy(X) + b"1234"), "x: .*bytes"),
    "huge by its header": (
        stored("x.npy", npy(X).replace(b"(4, 3), }      ", b"(4, 3000000), }")),
        "x: .*bytes",
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_anything_else_is_one_line(name):
    data, problem = BAD[name]
    with pytest.raises(FileError, match=problem) as error:
        found_in(data)
    assert str(error.value).startswith("a.npz: expected an example: ")
    assert "\n" not in str(error.value)


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


@pytest.mark.parametrize("text", ["[1]", "{", "1", "[" * 100_000])
def test_a_record_is_a_json_object(text):
    with pytest.raises(FileError):
        record_of(np.array(text), "a.npz", "an example")


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
