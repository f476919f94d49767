"""A free port, a course of one gate, and `race serve` on both."""

import socket

import pytest

from quadsim.cli.cli import race

COURSE = """
loop: false
opening: [1.5, 1.5]
frame_width: 0.6
bounds: [[-5, 15], [-5, 5], [0, 6]]
start: {position: [0, 0, 1.5], yaw_deg: 0}
gates:
  - {position: [4, 0, 1.5], yaw_deg: 0}
"""


@pytest.fixture
def port():
    """A UDP port that is free."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        return free.getsockname()[1]


@pytest.fixture
def serve(tmp_path, monkeypatch, port):
    """Return a function that serves a race of one gate, for the exit code."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "one.yaml").write_text(COURSE)
    words = ["serve", "one.yaml", "--vehicle", "archer", "--camera", "none", "--port", str(port)]

    def started(*more, timeout="20", course=COURSE):
        (tmp_path / "one.yaml").write_text(course)
        return race([*words, "--timeout", timeout, *more])

    return started
