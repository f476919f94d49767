"""Write a pilot for programs outside the simulator: as an ONNX file, or as one C header."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from quadsim.controllers.learned.c_header import c_header
from quadsim.controllers.learned.observation import SIZE, UNITS
from quadsim.controllers.learned.pilot import ACTIONS, Pilot, activations, write_file
from quadsim.files.onnx_graph import Graph, Value
from quadsim.files.values import SettingError

# operator of ONNX for each activation, and for each conversion of the last layer's outputs
OPERATORS = {"relu": "Relu", "tanh": "Tanh", "identity": "Identity"}


def export_pilot(pilot: Pilot, path: str | Path) -> Path:
    """Write a pilot as an ONNX file or as one C header, and return the path.

    Both have the network alone: a program has to feed it observations at the pilot's rate, as
    docs/learning.md and the header's comment describe.

    Args:
        pilot: the pilot, such as `quadsim.load_pilot("split_s_swift")`.
        path: FILE.onnx or FILE.h.

    Raises:
        SettingError: the path has another suffix (a ValueError).
        ModuleNotFoundError: onnx is not installed; the message says how to install it.
        FileError: the file cannot be written (a ValueError).

    Examples:
        >>> import quadsim
        >>> file = quadsim.export_pilot(quadsim.load_pilot("split_s_swift"), "pilot.h")
        >>> "split_s_swift_action(" in file.read_text()
        True
    """
    path = Path(path)
    if path.suffix not in (".h", ".onnx"):
        raise SettingError("path", f"expected FILE.h or FILE.onnx, got {str(path)!r}")
    write_file(path, c_header(pilot).encode() if path.suffix == ".h" else pilot_onnx(pilot))
    return path


def pilot_onnx(pilot: Pilot) -> bytes:
    """Return the content of a pilot's ONNX file.

    Its input is `observation`  (batch, 38), its outputs are `action`  (batch, 4), numbers in -1..1,
    and `command`  (batch, 4), body rates [rad/s] and thrust [m/s^2]; all are float32. The metadata
    have the name and the unit of each observed number, and how long an action is held [s].

    Raises:
        ModuleNotFoundError: onnx is not installed.
    """
    graph = Graph()
    about = pilot.about
    pairs = list(zip(pilot.weights[::2], pilot.weights[1::2], strict=True))
    kinds = activations(about.activation, len(pairs) - 1)

    # The network
    x = "observation"
    for (matrix, bias), kind in zip(pairs[:-1], kinds, strict=True):
        layer = graph.node("Gemm", x, graph.constant(matrix), graph.constant(bias))
        x = graph.node(OPERATORS[kind], layer)
    matrix, bias = pairs[-1]
    x = graph.node("Gemm", x, graph.constant(matrix), graph.constant(bias))
    if about.output == "tanh":
        graph.node("Tanh", x, to="action")
    else:
        least = graph.constant(np.array(-1.0, np.float32))
        most = graph.constant(np.array(1.0, np.float32))
        graph.node("Clip", x, least, most, to="action")

    # The command: a linear function of the action
    low = np.array(about.low, np.float32)
    high = np.array(about.high, np.float32)
    scaled = graph.node("Mul", "action", graph.constant((high - low) / 2))
    graph.node("Add", scaled, graph.constant((high + low) / 2), to="command")

    metadata = {
        "pilot": pilot.name,
        "sha256": pilot.digest,
        "vehicle": about.vehicle,
        "course": about.course,
        "period_s": f"{about.hold * about.dt:g}",
        "observation": json.dumps(UNITS),
        "command": "body rates about x, y, z [rad/s], thrust divided by mass [m/s^2]",
    }
    observation = Value("observation", ("batch", SIZE))
    outputs = [Value("action", ("batch", ACTIONS)), Value("command", ("batch", ACTIONS))]
    return graph.file("pilot", [observation], outputs, metadata)
