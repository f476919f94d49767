"""Claims about `race web` as a program: what it prints, what it refuses, how it ends."""

import json
import os
import signal
import socket
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from web_cases import COURSE, Glider, choices, free_port, run_of, until
from wire import get, link

from quadsim.cli.cli import race
from quadsim.cli.web import forwarding
from quadsim.record.archive import list_runs, read_run

# The command, with flights without physics in place of the planner's, which would be compiled
PROGRAM = f"""
import sys
from functools import partial
sys.path.insert(0, {str(Path(__file__).parent)!r})
import quadsim.web.race.session
from web_cases import Glider
quadsim.web.race.session.Session = partial(quadsim.web.race.session.Session, take_off=Glider)
from quadsim.cli.cli import main
main()
"""


@contextmanager
def running(*flags):
    """The program and the one JSON object it has printed."""
    command = [sys.executable, "-c", PROGRAM, "web", "--json", "--port", "0", *flags]
    program = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        printed = ""
        while not printed.rstrip().endswith("}"):
            line = program.stdout.readline()
            assert line, program.stderr.read()
            printed += line
        yield program, json.loads(printed)
    finally:
        program.kill()
        program.communicate()


@pytest.mark.process
def test_the_address_opens_the_page_one_click_flies_and_ctrl_c_keeps_what_was_flown(tmp_path):
    """Open to other machines, which need the token in the address that is printed."""
    first_gate = run_of(Glider(choices("gaussian"))).events[0].t
    flags = ("--runs-dir", str(tmp_path), "--course", COURSE, "--host", "0.0.0.0")
    with running(*flags) as (program, printed):
        assert printed["pid"] == program.pid
        url = urlsplit(printed["url"])
        assert url.hostname != "0.0.0.0"  # no browser elsewhere finds that
        assert get(url.port)[0] == 401
        status, headers = get(url.port, path=f"/?{url.query}")
        assert status == 303
        admitted = {"Cookie": headers["Set-Cookie"].partition(";")[0]}
        with link(url.port, additional_headers=admitted) as linked:
            linked.send("start")

            def is_behind_a_gate():
                return linked.ask("signals", "ask_signals", race=0, frames=[])["t"] > first_gate

            assert until(is_behind_a_gate)
            program.send_signal(signal.SIGINT)
            out, err = program.communicate(timeout=30)
    assert out == ""
    assert "Traceback" not in err
    assert program.returncode == 130
    assert not list(tmp_path.glob("*.part"))
    assert [read_run(folder).outcome for folder in list_runs(tmp_path)] == ["interrupted"] * 2
    with pytest.raises(ProcessLookupError):
        os.kill(program.pid, 0)


@pytest.mark.socket
def test_a_busy_port_is_one_line(capsys):
    with socket.socket() as busy:
        busy.bind(("127.0.0.1", free_port()))
        busy.listen()
        port = str(busy.getsockname()[1])
        assert race(["web", "--port", port]) == 2
    err = capsys.readouterr().err.strip()
    assert err.startswith(f"race web: --port: cannot listen on 127.0.0.1:{port}")
    assert "\n" not in err


@pytest.mark.socket
@pytest.mark.parametrize(
    ("flags", "wrong"),
    [
        (["--port", "99999"], "--port"),
        (["--host", "203.0.113.7"], "--host"),
        (["--course", "nowhere"], "'nowhere'"),
        (["no-such-run", "--runs-dir", "nowhere"], "'nowhere'"),
    ],
)
def test_a_wrong_argument_is_one_line(flags, wrong, capsys):
    assert race(["web", *flags]) == 2
    err = capsys.readouterr().err.strip()
    assert err.startswith("race web: ")
    assert wrong in err
    assert "\n" not in err


def test_who_came_by_ssh_is_told_how_to_reach_the_page_and_nobody_else():
    connection = "192.0.2.7 50514 192.0.2.9 2222"
    told = forwarding("127.0.0.1", 8081, connection)
    assert told == "ssh -N -L 8081:127.0.0.1:8081 -p 2222 192.0.2.9"
    assert forwarding("192.0.2.9", 8081, connection) == ""
    assert forwarding("127.0.0.1", 8081, "") == ""
    assert forwarding("127.0.0.1", 8081, "nonsense") == ""
