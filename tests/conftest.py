"""Fixtures that several test files share."""

import os
import signal

# or BLAS threads spin against the compiled loops'
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import pytest

# a job in the background of a shell inherits an ignored Ctrl-C, which tests send to themselves and
# to commands
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session")
def key():
    """A key of the counter-based generator."""
    return np.array([20240501, 7], np.uint32)


@pytest.fixture
def on_threads():
    """on_threads(n, f): what f() returns on n threads. The number in use before comes back."""
    # loads numba: only for tests that ask
    from controllers.lanes.threads import threads, use_threads

    before = threads()

    def run(n, f):
        if n > len(os.sched_getaffinity(0)):
            pytest.skip(f"needs {n} cores")
        use_threads(n)
        return f()

    yield run
    use_threads(before)
