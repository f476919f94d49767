"""Locks on folders: one process at a time, and none that outlives its process."""

import fcntl
import os
import threading

import pytest

from quadsim.files.locks import in_turn, lock_folder


def test_a_folder_is_locked_once_until_it_is_given_back(tmp_path):
    handle = lock_folder(tmp_path)
    with pytest.raises(BlockingIOError):
        lock_folder(tmp_path)
    os.close(handle)
    os.close(lock_folder(tmp_path))


def test_a_folder_that_is_gone_cannot_be_locked(tmp_path):
    with pytest.raises(FileNotFoundError):
        lock_folder(tmp_path / "none")


def test_whoever_comes_second_waits(tmp_path):
    order = []
    inside = threading.Event()

    def second():
        inside.wait()
        with in_turn(tmp_path):
            order.append("second")

    waiting = threading.Thread(target=second)
    waiting.start()
    with in_turn(tmp_path):
        inside.set()
        waiting.join(0.05)
        order.append("first")
    waiting.join()
    assert order == ["first", "second"]


def test_without_locks_nobody_waits(tmp_path, monkeypatch):
    def refused(handle, operation):
        raise OSError("no locks here")

    monkeypatch.setattr(fcntl, "flock", refused)
    with in_turn(tmp_path), in_turn(tmp_path):
        assert tmp_path.is_dir()
