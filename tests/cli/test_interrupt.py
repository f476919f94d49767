"""`race fly` stopped in mid-flight: a signal keeps the flight so far, SIGKILL leaves none."""

import os
import pty
import signal
import subprocess
from contextlib import suppress

import pytest

from quadsim.cli.cli import race
from quadsim.console import uninterrupted
from quadsim.record.archive import list_runs, read_run
from tests.campaign_cases import RACE
from tests.small import SMALL, flags

# Next to nothing draws the vehicle to its gate, so it hovers: for 5 s at least.
HOVER = {**SMALL, "progress": 1e-6, "opening": 1e-6}


@pytest.fixture
def flying(tmp_path):
    """A flight that goes on for seconds, in a terminal of its own, once its live line is seen."""
    terminal, stderr = pty.openpty()
    command = [*RACE, "fly", "paper_flat", *flags(HOVER)]
    flight = subprocess.Popen(
        command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=stderr, text=True
    )
    os.close(stderr)
    seen = b""
    while seen.count(b"real time") < 3:
        seen += os.read(terminal, 4096)
    yield flight, terminal
    flight.kill()
    os.close(terminal)


def rest_of(terminal):
    """Return what is still written to the terminal until its last writer has left."""
    text = b""
    with suppress(OSError):  # how Linux says that nobody is left
        while more := os.read(terminal, 4096):
            text += more
    return text.decode()


@pytest.mark.process
def test_an_interrupted_flight_is_reported_and_kept(flying, tmp_path):
    """SIGTERM is handled as Ctrl-C is."""
    flight, terminal = flying
    flight.send_signal(signal.SIGTERM)
    shown = rest_of(terminal)
    out = flight.stdout.read()
    assert flight.wait() == 130
    assert "interrupted" in out
    assert "Traceback" not in shown
    assert "interrupted" in shown.rstrip().splitlines()[-1]
    (folder,) = list_runs(tmp_path / "runs")
    run = read_run(folder)
    assert run.outcome == "interrupted"
    assert run.telemetry["t"][-1] > 0.0


@pytest.mark.regression
def test_a_killed_flight_leaves_nothing_that_looks_finished(flying, tmp_path, capsys):
    flight, _ = flying
    flight.kill()
    flight.wait()
    assert list_runs(tmp_path / "runs") == []
    assert race(["show", "--runs-dir", f"{tmp_path}/runs"]) == 2
    assert capsys.readouterr().err.startswith("race show: ")


@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_while_something_is_kept_comes_when_that_is_done(sent):
    before, done = [signal.getsignal(s) for s in (signal.SIGINT, signal.SIGTERM)], []

    def keep():
        with uninterrupted():
            os.kill(os.getpid(), sent)
            done.append("kept")

    with pytest.raises(KeyboardInterrupt):
        keep()
    assert done == ["kept"]
    assert [signal.getsignal(s) for s in (signal.SIGINT, signal.SIGTERM)] == before
