"""Compiled code on the disk is checked before it is loaded; one warning if it cannot be kept."""

import gc
import os
import random
import signal
import sys
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from numba import njit
from numba.core.types import BaseFunction

from quadsim.controllers.lanes import code_cache
from quadsim.controllers.lanes.code_cache import CodeCache
from quadsim.controllers.lanes.compiled import (
    faster_compiler,
    interruptible,
    is_cached,
    kept,
    load_module,
)
from quadsim.controllers.lanes.trace import TraceError
from quadsim.files.cache import cache_folder

TEXT = """
from numba import njit
from quadsim.controllers.lanes.compiled import kept
@kept
@njit
def twice(x):
    return 2 * x
"""


@pytest.fixture(autouse=True)
def home(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(CodeCache, "complained", False)
    return tmp_path / "cache"


def fresh():
    """A dispatcher as a new process would have it."""
    return load_module("kept_code", TEXT).twice


def files(home):
    return sorted(home.rglob("*.code"))


def loaded(function):
    """Return whether calling it found the code on the disk."""
    assert function(21) == 42
    return sum(function.stats.cache_hits.values()) == 1


@pytest.mark.compiled
def test_code_is_kept_for_the_next_process_and_found_again(home):
    first = fresh()
    assert not is_cached(first)
    assert not loaded(first)
    assert is_cached(first)
    assert len(files(home)) == 1
    assert loaded(fresh())
    assert len(files(home)) == 1


def damaged(data: bytes, seed: int) -> bytes:
    """Cut short, or with one bit changed."""
    rng = random.Random(seed)
    at = rng.randrange(len(data))
    return (
        data[:at]
        if seed % 2
        else data[:at] + bytes([data[at] ^ 1 << rng.randrange(8)]) + data[at + 1 :]
    )


@pytest.mark.compiled
@pytest.mark.parametrize("seed", [*range(4), "empty"])
def test_damaged_code_is_never_loaded_and_is_compiled_anew_with_one_line(seed, home, caplog):
    loaded(fresh())
    (path,) = files(home)
    whole = path.read_bytes()
    path.write_bytes(b"" if seed == "empty" else damaged(whole, seed))
    assert not loaded(fresh())
    (message,) = caplog.messages
    assert message.startswith(f"{path}: damaged")
    assert loaded(fresh())
    assert len(caplog.messages) == 1


@pytest.mark.compiled
def test_a_file_without_an_end_is_damaged(home, caplog, monkeypatch):
    loaded(fresh())
    (path,) = files(home)
    path.unlink()
    path.symlink_to("/dev/zero")
    monkeypatch.setattr("quadsim.controllers.lanes.code_cache.LARGEST", 10_000)
    assert not loaded(fresh())
    damaged_, kept_ = caplog.messages
    assert damaged_.startswith(f"{path}: damaged")
    assert kept_.startswith(f"{path.parent}: cannot keep")
    assert path.is_symlink()


@pytest.mark.compiled
def test_code_of_another_text_is_not_taken_for_it(home):
    loaded(fresh())
    other = load_module("kept_code", TEXT.replace("2 * x", "3 * x")).twice
    assert other(21) == 63
    assert len(files(home)) == 2


@pytest.mark.compiled
def test_code_with_an_older_text_of_inlined_functions_is_not_taken(home, monkeypatch):
    loaded(fresh())
    monkeypatch.setattr(code_cache, "_inlined", lambda: "another text")
    assert not loaded(fresh())
    assert len(files(home)) == 2


def full(_):
    raise OSError(28, "No space left on device")


@pytest.mark.compiled
def test_a_full_disk_is_said_once_and_leaves_no_folder(home, monkeypatch, caplog):
    monkeypatch.setattr(os, "fsync", full)
    assert not loaded(fresh())
    assert not loaded(fresh())
    (message,) = caplog.messages
    assert message.startswith(f"{home / 'quadsim'}: cannot keep")
    assert "No space left on device" in message
    assert not home.exists()


@pytest.mark.compiled
def test_a_file_in_the_place_of_the_cache_folder_is_said_once(home, caplog):
    home.write_text("")
    assert not loaded(fresh())
    assert caplog.messages[-1].startswith(f"{home / 'quadsim'}: cannot keep compiled code: ")
    assert home.read_text() == ""


def test_a_relative_cache_folder_is_ignored_and_no_home_is_none(monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", "relative")
    monkeypatch.setenv("HOME", "/home/somebody")
    assert cache_folder() == Path("/home/somebody/.cache/quadsim")
    monkeypatch.setenv("HOME", "nowhere")
    assert cache_folder() is None


def test_an_interrupt_that_the_compiler_swallows_ends_the_command_when_it_returns():
    before = signal.getsignal(signal.SIGINT)

    class Swallows:
        def __del__(self):  # exceptions are printed and forgotten here, as in callbacks from C
            os.kill(os.getpid(), signal.SIGINT)

    def compile_beside(made):
        with interruptible():
            made()
            done.append("went on")

    done = []
    hook, sys.unraisablehook = sys.unraisablehook, lambda _: done.append("swallowed")
    try:
        with pytest.raises(KeyboardInterrupt):
            compile_beside(Swallows)
    finally:
        sys.unraisablehook = hook
    assert done == ["swallowed", "went on"]
    assert signal.getsignal(signal.SIGINT) is before


def interrupted_and_failing(sent):
    with interruptible():
        with suppress(KeyboardInterrupt):
            if sent:
                os.kill(os.getpid(), signal.SIGINT)
        raise RuntimeError("no compiled object yet")


@pytest.mark.parametrize(("sent", "comes"), [(True, KeyboardInterrupt), (False, RuntimeError)])
def test_a_compiler_that_fails_for_an_interrupt_is_interrupted(sent, comes):
    with pytest.raises(comes):
        interrupted_and_failing(sent)


@pytest.mark.compiled
def test_an_interrupt_while_a_kept_function_is_compiled_comes_out_of_its_call(monkeypatch):
    function = kept(njit(lambda x: x + 1))

    def interrupted(*_):
        try:
            os.kill(os.getpid(), signal.SIGINT)
        except KeyboardInterrupt:
            return compile_(*_)

    compile_ = function._compiler.compile
    monkeypatch.setattr(function._compiler, "compile", interrupted)
    with pytest.raises(KeyboardInterrupt):
        function(1)


UNFIT = """
import math
import numpy as np
from numba import njit
from quadsim.controllers.lanes.compiled import kept

@kept
@njit
def run(a):
    # term: band
    height = a[0]
    low = height + "m"
    return low
"""


@pytest.mark.compiled
def test_what_the_compiler_refuses_is_one_line_with_the_term_and_the_line():
    module = load_module("unfit", UNFIT)
    with pytest.raises(TraceError) as caught:
        module.run(np.ones(3))
    message = str(caught.value)
    assert message.startswith('term: band: numba cannot compile the line `low = height + "m"`: ')
    assert "\n" not in message


@pytest.mark.parametrize("collects", [True, False])
def test_the_faster_compiler_leaves_numba_and_the_garbage_collector_as_it_found_them(collects):
    find, before = BaseFunction.get_call_type, gc.isenabled()
    (gc.enable if collects else gc.disable)()
    try:
        with suppress(KeyError), faster_compiler(), faster_compiler():
            assert BaseFunction.get_call_type is not find
            assert not gc.isenabled()
            raise KeyError
        assert BaseFunction.get_call_type is find
        assert gc.isenabled() == collects
    finally:
        (gc.enable if before else gc.disable)()
