"""Claims about `race web` as a program: what it prints, what it refuses, how it ends."""

import asyncio
import json
import os
import signal
import socket
import subprocess
import sys
from contextlib import contextmanager
from urllib.parse import urlsplit

import pytest
from web_cases import COURSE, free_port
from wire import button, connect, get

from quadsim.cli.cli import race
from quadsim.record.archive import list_runs, load_run

PROGRAM = [sys.executable, "-c", "from quadsim.cli.cli import main; main()", "web", "--json"]


@contextmanager
def running(*flags):
    """The program and the one JSON object it has printed."""
    command = [*PROGRAM, "--port", "0", *flags]
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


@pytest.mark.flight
def test_the_address_opens_the_page_one_click_flies_and_ctrl_c_keeps_what_was_flown(tmp_path):
    """Open to other machines, which need the token in the address that is printed."""

    async def one_click(port, cookie):
        async with connect(port, additional_headers={"Cookie": cookie}) as client:
            start = await button(client, "START")
            await client.send(type="GuiUpdateMessage", uuid=start, updates={"value": True})
            for _ in range(600):
                if list(tmp_path.glob("*.part")):  # a flight has claimed its folder
                    return True
                await asyncio.sleep(0.05)
        return False

    flags = ("--runs-dir", str(tmp_path), "--course", COURSE, "--host", "0.0.0.0")
    with running(*flags) as (program, printed):
        assert printed["pid"] == program.pid
        url = urlsplit(printed["url"])
        assert url.hostname != "0.0.0.0"  # no browser elsewhere finds that
        assert get(url.port)[0] == 401
        status, headers = get(url.port, path=f"/?{url.query}")
        assert status == 303
        assert asyncio.run(one_click(url.port, headers["Set-Cookie"].partition(";")[0]))
        program.send_signal(signal.SIGINT)
        out, err = program.communicate(timeout=30)
    assert out == ""
    assert "Traceback" not in err
    assert program.returncode == 130
    assert not list(tmp_path.glob("*.part"))
    assert all(load_run(folder).outcome == "interrupted" for folder in list_runs(tmp_path))
    with pytest.raises(ProcessLookupError):
        os.kill(program.pid, 0)


def test_a_busy_port_is_one_line(capsys):
    with socket.socket() as busy:
        busy.bind(("127.0.0.1", free_port()))
        busy.listen()
        port = str(busy.getsockname()[1])
        assert race(["web", "--port", port]) == 2
    err = capsys.readouterr().err.strip()
    assert err.startswith(f"race web: --port: cannot listen on 127.0.0.1:{port}")
    assert "\n" not in err


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
