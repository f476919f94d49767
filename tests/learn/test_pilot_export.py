"""A pilot outside the simulator: its C header and its ONNX file compute what the pilot does."""

import ctypes
import shutil
import subprocess
from itertools import pairwise

import numpy as np
import pytest

import quadsim
from quadsim.cli.cli import race
from quadsim.controllers.learned.c_header import c_header, hover_action, identifier
from quadsim.controllers.learned.observation import SIZE, UNITS
from quadsim.controllers.learned.pilot import command

PILOT = "split_s_swift"
RNG = np.random.default_rng(0)
SEEN = RNG.normal(size=(50, SIZE)).astype(np.float32)
WRAPPER = """
#include "pilot.h"
void action(const float *observation, float *action) { %(name)s_action(observation, action); }
void command(const float *action, float *command) { %(name)s_command(action, command); }
"""


class Compiled:
    """The two functions of a header, compiled by gcc with all warnings as errors."""

    def __init__(self, pilot, folder):
        (folder / "pilot.h").write_text(c_header(pilot))
        (folder / "pilot.c").write_text(WRAPPER % {"name": identifier(pilot.name)})
        strict = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic"]
        files = ["-o", "pilot.so", "pilot.c", "-lm"]
        subprocess.run(["gcc", "-O2", "-shared", "-fPIC", *strict, *files], cwd=folder, check=True)
        self._library = ctypes.CDLL(str(folder / "pilot.so"))

    def action(self, observation):
        return self._call(self._library.action, observation)

    def command(self, action):
        return self._call(self._library.command, action)

    def _call(self, function, numbers):
        given = np.ascontiguousarray(numbers, np.float32)
        answer = np.zeros(4, np.float32)
        pointer = ctypes.POINTER(ctypes.c_float)
        function(given.ctypes.data_as(pointer), answer.ctypes.data_as(pointer))
        return answer


def pilot_of(folder, widths=(7, 5), **kinds):
    """Return a saved pilot of random weights with hidden layers of these widths."""
    sizes = [SIZE, *widths, 4]
    layers = [(0.3 * RNG.normal(size=(a, b)), RNG.normal(size=b)) for a, b in pairwise(sizes)]
    return quadsim.save_pilot(layers, folder / "tiny.npz", vehicle="swift", hold=2, **kinds)


KINDS = [
    {"activation": ["relu", "tanh"], "output": "clip"},
    {"activation": ["identity", "relu"], "output": "tanh"},
    {"widths": (), "output": "clip"},
]
needs_gcc = pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is not installed")


@needs_gcc
@pytest.mark.process
@pytest.mark.parametrize("kinds", KINDS)
def test_the_header_computes_the_pilots_actions_and_commands(kinds, tmp_path):
    pilot = pilot_of(tmp_path, **kinds)
    compiled = Compiled(pilot, tmp_path)
    actions = np.array([compiled.action(seen) for seen in SEEN])
    np.testing.assert_allclose(actions, pilot(SEEN), atol=1e-5)
    assert np.ptp(actions) > 0.5
    about = pilot.about
    commands = np.array([compiled.command(action) for action in actions])
    expected = np.array([command(action, about.low, about.high) for action in actions])
    np.testing.assert_allclose(commands, expected, rtol=1e-5, atol=1e-4)


@pytest.mark.parametrize("kinds", KINDS)
def test_the_onnx_file_computes_the_pilots_actions_and_commands(kinds, tmp_path):
    pytest.importorskip("onnx", reason="onnx is not installed")
    runtime = pytest.importorskip("onnxruntime", reason="onnxruntime is not installed")
    pilot = pilot_of(tmp_path, **kinds)
    file = quadsim.export_pilot(pilot, tmp_path / "tiny.onnx")
    session = runtime.InferenceSession(str(file))
    actions, commands = session.run(["action", "command"], {"observation": SEEN})
    np.testing.assert_allclose(actions, pilot(SEEN), atol=1e-5)
    expected = [command(action, pilot.about.low, pilot.about.high) for action in actions]
    np.testing.assert_allclose(commands, expected, rtol=1e-5, atol=1e-4)
    assert session.get_modelmeta().custom_metadata_map["period_s"] == "0.02"


@needs_gcc
@pytest.mark.process
@pytest.mark.compiled
@pytest.mark.slow
def test_the_header_flies_a_lap_as_the_pilot_does(tmp_path):
    pilot = quadsim.load_pilot(PILOT)
    compiled = Compiled(pilot, tmp_path)
    controller = quadsim.PolicyController(compiled.action, hold=pilot.about.hold)
    flown = quadsim.fly(PILOT, laps=1, controller=controller)
    expected = quadsim.fly(PILOT, laps=1, pilot=PILOT)
    assert flown.outcome == expected.outcome == "finished"
    for axis in ("px", "py", "pz"):
        np.testing.assert_allclose(flown.telemetry[axis], expected.telemetry[axis], atol=1e-3)


def test_the_header_says_what_to_feed_it(tmp_path):
    pilot = pilot_of(tmp_path)
    head, _, _ = c_header(pilot).partition("*/")
    for name in UNITS:
        assert name in head
    assert "Every 20 ms" in head
    low, high = pilot.about.low, pilot.about.high
    np.testing.assert_allclose(command(hover_action(pilot), low, high), [0, 0, 0, 9.81])


@pytest.mark.parametrize(
    ("name", "expected"),
    [("split_s_swift", "split_s_swift"), ("my pilot-2", "my_pilot_2"), ("3", "pilot_3")],
)
def test_a_name_becomes_an_identifier_of_c(name, expected):
    assert identifier(name) == expected


def test_another_suffix_is_refused():
    with pytest.raises(quadsim.SettingError, match=r"path: expected FILE.h or FILE.onnx, got 'p'"):
        quadsim.export_pilot(quadsim.load_pilot(PILOT), "p")


def test_the_command_writes_a_header_of_a_pilot(tmp_path, capsys):
    out = tmp_path / "mine.h"
    assert race(["export", PILOT, "--header", "--out", str(out)]) == 0
    assert capsys.readouterr().out.split() == [str(out)]
    assert "#ifndef QUADSIM_SPLIT_S_SWIFT_H" in out.read_text()
    assert race(["export", PILOT, "--header", "--out", str(out)]) == 2
    assert race(["export", "--header"]) == 2
    assert "--header: expected one pilot, got none" in capsys.readouterr().err
