"""Loops whose blocks are shared among threads."""

import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from itertools import count

import numpy as np
import pytest

from quadsim.controllers.lanes import helpers
from quadsim.controllers.lanes.compiled import load_module
from quadsim.controllers.lanes.helpers import run_parts
from quadsim.controllers.lanes.sharing import on_threads
from quadsim.controllers.lanes.threads import most_threads, threads, use_threads

pytestmark = pytest.mark.compiled

TEXT = """
import numpy as np
from numba import njit
from quadsim.controllers.lanes.compiled import kept
from quadsim.controllers.lanes.sharing import share

@kept
@njit(nogil=True)
def scaled(desk, first, last, x, y, factor, offset, room):
    if desk:
        share(desk, last)
        return
    scratch = np.empty(room, np.int8)
    scratch[0] = 1
    for b in range(first, last):
        y[b] += factor * x[b] + offset + scratch[0]
"""


@pytest.fixture(autouse=True)
def threads_as_before():
    yield
    use_threads(None)


@pytest.fixture(scope="module")
def scaled():
    return load_module("shared_loop", TEXT).scaled


@pytest.mark.parametrize("threads", sorted({1, most_threads()}))
@pytest.mark.parametrize("blocks", [0, 1, 2, 7, 1000])
def test_each_block_runs_once_with_the_arguments_of_the_call(scaled, blocks, threads):
    use_threads(threads)
    x = np.arange(1000.0)
    y = np.zeros(1000)
    on_threads(scaled, blocks, x, y, 3, 0.5, 1)
    expected = np.where(np.arange(1000) < blocks, 3 * x + 1.5, 0.0)
    np.testing.assert_array_equal(y, expected)


def test_what_shares_the_loops_can_be_kept_on_the_disk(scaled):
    helpers.helpers()
    (code,) = run_parts.overloads.values()
    assert not code.library.has_dynamic_globals


def test_with_zero_for_the_desk_some_blocks_run_on_the_calling_thread(scaled):
    y = np.zeros(10)
    scaled(0, 3, 5, np.ones(10), y, 1, 0.0, 1)
    np.testing.assert_array_equal(np.flatnonzero(y), (3, 4))


def test_arguments_of_another_type_are_shared_too(scaled):
    y = np.zeros(10, np.float32)
    on_threads(scaled, 10, np.ones(20, np.float32)[::2], y, np.float32(2.0), np.float32(0.0), 1)
    np.testing.assert_array_equal(y, np.full(10, 3.0))


def test_a_part_without_memory_is_an_error_and_no_wrong_result(scaled, monkeypatch):
    # The helpers of earlier tests may rest, as they do on a busy machine: the caller would then run
    # the loop alone and raise the compiler's own error.
    monkeypatch.setattr(helpers, "_helpers", None)
    use_threads(most_threads())
    wanted = "loop on several threads" if most_threads() > 1 else ""
    with pytest.raises(MemoryError, match=wanted):
        on_threads(scaled, 4, np.ones(4), np.zeros(4), 1, 0.0, 1 << 60)
    y = np.zeros(4)
    on_threads(scaled, 4, np.ones(4), y, 1, 0.0, 1)
    assert (y == 2.0).all(), "the next call works"


def test_every_block_of_many_calls_runs_once(scaled):
    """A helper that comes late from one call must not take blocks of the next one."""
    use_threads(most_threads())
    rng = np.random.default_rng(0)
    counts = np.zeros(200)
    expected = np.zeros(200)
    for blocks in rng.integers(0, 201, 3000).tolist():
        on_threads(scaled, blocks, np.zeros(200), counts, 1, 0.0, 1)
        expected[:blocks] += 1
    np.testing.assert_array_equal(counts, expected)


def test_a_caller_does_not_wait_for_helpers_that_sleep(scaled, monkeypatch):
    monkeypatch.setattr(helpers, "ring", lambda bell: None)
    use_threads(most_threads())
    y = np.zeros(100)
    on_threads(scaled, 100, np.ones(100), y, 1, 0.0, 1)
    assert (y == 2.0).all()


@pytest.mark.parametrize(("waited", "rests"), [(0, False), (5, False), (20, True)])
def test_helpers_rest_while_another_program_takes_turns_with_their_caller(
    monkeypatch, waited, rests
):
    """Each rest is twice as long as the one before.

    Args:
        waited: for every 100 ns that the caller runs, the time that it waits for a core [ns].
        rests: whether that is too long.
    """
    looks = count()
    monkeypatch.setattr(
        helpers.OnCore,
        "of_this_thread",
        lambda: helpers.OnCore(1, *(next(looks) * np.array([100, waited])).tolist()),
    )
    own = helpers.Helpers()
    alone = [own.wake(1) == 0 for _ in range(8 * helpers.WATCHED)]
    own._end()
    assert any(alone) == rests
    if rests:
        # The first look only begins to count.
        first = 2 * helpers.WATCHED - 1
        second = first + 2 * helpers.WATCHED
        assert alone.index(True) == first
        assert alone[first : second + 1].count(True) == helpers.WATCHED + 2
        assert all(alone[second : second + 2 * helpers.WATCHED])


def test_threads_that_call_at_once_have_their_own_results(scaled):
    """The desk holds one job: the other callers run theirs alone."""

    def calls(k: int) -> np.ndarray:
        use_threads(most_threads())
        y = np.zeros(50)
        for _ in range(200):
            on_threads(scaled, 50, np.full(50, float(k)), y, 1, 0.0, 1)
        return y

    with ThreadPoolExecutor(4) as pool:
        for k, y in enumerate(pool.map(calls, range(4))):
            np.testing.assert_array_equal(y, 200.0 * (k + 1))


def test_a_number_of_threads_is_that_of_the_thread_that_sets_it():
    use_threads(1)
    with ThreadPoolExecutor(1) as pool:
        assert pool.submit(threads).result() == most_threads()
    assert threads() == 1


DRAW = """
import numpy as np
from quadsim.controllers.lanes.layout import LANES
from quadsim.controllers.lanes.normals import fill_normals
z = np.empty((64, 1, LANES), np.float32)
fill_normals(z, np.ones(1, np.float32), np.zeros(2, np.uint32), 1)
print("drawn")
"""


@pytest.mark.process
def test_a_process_with_helpers_ends_by_itself():
    """Some blocks of normals are drawn, so that a helper has some to take."""
    done = subprocess.run([sys.executable, "-c", DRAW], capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stdout, done.stderr) == (0, "drawn\n", "")
