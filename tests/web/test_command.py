"""Claims about `race web` as a program: what it prints, what it refuses, how it ends."""

import asyncio
import json
import os
import signal
import socket
import subprocess
import sys
from contextlib import contextmanager

import pytest
from web_cases import COURSE, free_port
from wire import button, connect, get

from quadsim.cli.cli import race
from quadsim.record.archive import list_runs, load_run


@contextmanager
def running(*flags):
    """The program and the one JSON object it has printed."""
    command = [
        sys.executable,
        "-c",
        "from quadsim.cli.cli import main; main()",
        "web",
        "--json",
        "--port",
        "0",
        *flags,
    ]
    program = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        said = ""
        while not said.rstrip().endswith("}"):
            line = program.stdout.readline()
            assert line, program.stderr.read()
            said += line
        yield program, json.loads(said)
    finally:
        program.kill()
        program.communicate()


def port_of(said):
    return int(said["url"].rpartition(":")[2].partition("/")[0])


def test_one_click_flies_and_ctrl_c_keeps_what_was_flown(tmp_path):
    async def client_does(said):
        async with connect(port_of(said)) as client:
            start = await button(client, "START")
            await client.send(type="GuiUpdateMessage", uuid=start, updates={"value": True})
            for _ in range(600):
                if list(tmp_path.glob("*.part")):  # a flight has claimed its folder
                    return True
                await asyncio.sleep(0.05)
        return False

    with running("--runs-dir", str(tmp_path), "--course", COURSE) as (program, said):
        assert said["pid"] == program.pid
        assert asyncio.run(client_does(said))
        program.send_signal(signal.SIGINT)
        out, err = program.communicate(timeout=30)
    assert out == ""
    assert "Traceback" not in err
    assert program.returncode == 130
    assert not list(tmp_path.glob("*.part"))
    assert all(load_run(folder).outcome == "interrupted" for folder in list_runs(tmp_path))
    with pytest.raises(ProcessLookupError):
        os.kill(program.pid, 0)


def test_another_host_prints_a_token_that_opens_it(tmp_path):
    with running("--runs-dir", str(tmp_path), "--host", "0.0.0.0") as (_, said):
        port, path = port_of(said), said["url"].partition("/?")[2]
        name = said["url"].partition("//")[2].partition(":")[0]
        assert name != "0.0.0.0"  # no browser elsewhere finds that
        with socket.create_connection((name, port), timeout=5):
            pass
        assert get(port)[0] == 401
        assert get(port, path=f"/?{path}")[0] == 303


def test_a_busy_port_is_one_line(capsys):
    with socket.socket() as busy:
        busy.bind(("127.0.0.1", free_port()))
        busy.listen()
        port = str(busy.getsockname()[1])
        assert race(["web", "--port", port]) == 2
    err = capsys.readouterr().err.strip()
    what = f"cannot listen on 127.0.0.1:{port}: address already in use; choose another, 0 takes any that is free"
    assert err == f"race web: --port: {what}"


@pytest.mark.parametrize(
    ("flags", "said"),
    [
        (
            ["--port", "99999"],
            "race web: --port: expected a whole number >= 0 and <= 65535, got 99999",
        ),
        (
            ["--host", "203.0.113.7"],
            "race web: --host: cannot listen on 203.0.113.7:8080: cannot assign requested address",
        ),
        (["--course", "nowhere"], "race web: no course 'nowhere'"),
        (["no-such-run", "--runs-dir", "nowhere"], "race web: no runs in 'nowhere'"),
    ],
)
def test_a_wrong_argument_is_one_line(flags, said, capsys):
    assert race(["web", *flags]) == 2
    err = capsys.readouterr().err.strip()
    assert err.startswith(said)
    assert "\n" not in err
