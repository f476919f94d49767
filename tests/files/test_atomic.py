"""A file is written whole or not at all, and nothing but a file is replaced."""

import os

import pytest

from quadsim.files.atomic import replace_file


def test_a_file_is_replaced_whole_and_nothing_else_is_left(tmp_path):
    path = tmp_path / "f"
    for data in (b"one", b"two"):
        replace_file(path, data)
        assert path.read_bytes() == data
    assert os.listdir(tmp_path) == ["f"]


def link_to_a_device(path):
    os.symlink("/dev/null", path)


@pytest.mark.parametrize("make", [os.mkfifo, os.mkdir, link_to_a_device])
def test_a_pipe_a_folder_and_a_device_stay_what_they_are(make, tmp_path):
    """By a user with all rights, `--out /dev/null` would put a file in the place of the device."""
    path = tmp_path / "special"
    make(path)
    before = os.lstat(path)
    with pytest.raises(OSError, match="expected a file"):
        replace_file(path, b"data")
    assert os.lstat(path) == before
    assert os.listdir(tmp_path) == ["special"]
