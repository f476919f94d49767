"""Write a pilot as one C header: its weights, and loops that compute an action from them.

The header needs no library beside the mathematics of C99 (`tanhf`), keeps no state and allocates no
memory. Its comment says what to feed it, how often, and what it returns.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from importlib import metadata
from itertools import pairwise
from textwrap import wrap

import numpy as np

from quadsim.controllers.learned.observation import SIZE, UNITS, normalised
from quadsim.controllers.learned.pilot import ACTIONS, Activation, Output, Pilot, activations
from quadsim.dynamics.quadrotor import GRAVITY, Control

WIDTH = 100
# What each part of an observation is. The order of the numbers follows from UNITS.
MEANING = """
The frames are right-handed. World frame: z up, height 0 at the course's ground. Body frame: x
forward, y left, z up. A quantity "in the body frame" is a vector of the world, expressed in the
body's axes.

velocity: of the vehicle over ground, in the body frame.
gravity: unit vector of gravity's direction in the body frame; (0, 0, -1) in a level flight.
rate: angular velocity of the body about its own axes.
height: of the vehicle above the ground.
next gate: vectors from the vehicle to the corners of the opening of the next gate, in the body
frame; left and right as a vehicle sees them that flies through the gate in the legal direction.
second gate: the same of the gate after it. After the last gate of a closed course come its first
two gates; of an open course, two openings of the last gate's size, 5 m and 10 m behind it.
last: the action of the previous call. Before the first call it is the action of hovering:
{hover}.
"""
CODE = """
/* Compute matrix' * x + bias; the matrix is stored row by row, a row for each input. */
static inline void {name}_layer(const float *matrix, const float *bias,
    int inputs, int outputs, const float *x, float *y) {{
    for (int j = 0; j < outputs; ++j) {{
        y[j] = bias[j];
    }}
    for (int i = 0; i < inputs; ++i) {{
        for (int j = 0; j < outputs; ++j) {{
            y[j] += x[i] * matrix[i * outputs + j];
        }}
    }}
}}

/* Compute the action, {actions} numbers in -1..1, of an observation. */
static inline void {name}_action(const float observation[{size}], float action[{actions}]) {{
{layers}
}}

/* Convert an action to a command: body rates about x, y, z [rad/s] and thrust [m/s^2]. */
static inline void {name}_command(const float action[{actions}], float command[{actions}]) {{
    for (int k = 0; k < {actions}; ++k) {{
        float share = 0.5f * (action[k] + 1.0f);
        command[k] = {name}_low[k] + share * ({name}_high[k] - {name}_low[k]);
    }}
}}
"""
# One statement for each activation, and for the conversion of the last layer's outputs
STATEMENTS: dict[Activation | Output, str] = {
    "relu": "{y}[j] = {y}[j] < 0.0f ? 0.0f : {y}[j];",
    "tanh": "{y}[j] = tanhf({y}[j]);",
    "clip": "{y}[j] = {y}[j] < -1.0f ? -1.0f : {y}[j] > 1.0f ? 1.0f : {y}[j];",
}


def c_header(pilot: Pilot) -> str:
    """Return the C header of a pilot.

    It has three functions whose names begin with the pilot's: `NAME_action`, which computes an
    action from an observation, `NAME_command`, which converts an action to body rates and thrust,
    and `NAME_layer`, which they use.
    """
    name = identifier(pilot.name)
    guard = f"QUADSIM_{name.upper()}_H"
    about = pilot.about
    parts = [
        _comment(pilot, name),
        f"#ifndef {guard}\n#define {guard}\n\n#include <math.h>\n",
        f"#define {name.upper()}_PERIOD {_number(about.hold * about.dt)} /* between actions [s] */",
        "/* Commands at the actions -1 and 1: body rates [rad/s], thrust [m/s^2] */",
        _array(f"{name}_low", about.low),
        _array(f"{name}_high", about.high),
    ]
    pairs = list(zip(pilot.weights[::2], pilot.weights[1::2], strict=True))
    for number, (matrix, bias) in enumerate(pairs, 1):
        parts.append(f"/* Layer {number}: {matrix.shape[0]} inputs, {len(bias)} outputs */")
        parts.append(_array(f"{name}_matrix_{number}", matrix.ravel()))
        parts.append(_array(f"{name}_bias_{number}", bias))
    layers = _layers(pilot, name)
    parts.append(CODE.format(name=name, size=SIZE, actions=ACTIONS, layers=layers))
    parts.append("#endif\n")
    return "\n".join(parts)


def identifier(name: str) -> str:
    """Return a pilot's name as an identifier of C."""
    plain = re.sub(r"[^A-Za-z0-9]+", "_", name).strip("_")
    return plain if plain[:1].isalpha() else f"pilot_{plain}".rstrip("_")


def _comment(pilot: Pilot, name: str) -> str:
    """Return the comment at the head: the pilot, its use, and the numbers of an observation."""
    about = pilot.about
    period = f"{1e3 * about.hold * about.dt:g} ms"
    trained = f", trained on the course {about.course}" if about.course else ""
    hover = ", ".join(f"{x:.6g}" for x in hover_action(pilot))
    lines = [
        f"The pilot {pilot.name} as C, written by quadsim {metadata.version('quadsim')}.",
        f"It flies the vehicle {about.vehicle}{trained}.",
        f"SHA-256 of its file: {pilot.digest}",
        "",
        f"Every {period}:",
        f"  1. fill an observation, {SIZE} numbers in the order, units and frames below;",
        f"  2. {name}_action(observation, action);   action: {ACTIONS} numbers in -1..1",
        f"  3. {name}_command(action, command);      command: body rates about x, y and z [rad/s]",
        "     in the body frame, and thrust along body z divided by the mass [m/s^2];",
        f"  4. give the command to the rate controller, and hold it for {period}.",
        "",
        *MEANING.format(hover=f"({hover})").strip().splitlines(),
        "",
        "number  meaning                        divide the SI value by",
        *(f"{k:6}  {meaning:30} {_scale(unit)}" for k, (meaning, unit) in enumerate(UNITS.items())),
    ]
    # A name that a user has chosen must not end the comment
    inside = [line.replace("*/", "* /") for line in lines]
    return "\n".join(["/*", *(f" * {line}".rstrip() for line in inside), " */"])


def hover_action(pilot: Pilot) -> np.ndarray:
    """Return the action that holds the vehicle still, which is `last` at the start.  (4,)"""
    about = pilot.about
    hover = min(max(GRAVITY, about.low[3]), about.high[3])
    return normalised(Control(0.0, 0.0, 0.0, hover), about.low, about.high)


def _scale(unit: str) -> str:
    """Return the number by which an SI value is divided: "10 m/s" as "10 [m/s]"."""
    number, _, of = unit.partition(" ")
    return f"{number} [{of}]" if of else number


def _layers(pilot: Pilot, name: str) -> str:
    """Return the statements of the network, layer by layer."""
    widths = [SIZE, *(len(bias) for bias in pilot.weights[1::2])]
    count = len(widths) - 1
    kinds = [*activations(pilot.about.activation, count - 1), pilot.about.output]
    lines = [f"    float hidden_{k}[{width}];" for k, width in enumerate(widths[1:-1], 1)]
    values = ["observation", *(f"hidden_{k}" for k in range(1, count)), "action"]
    for k, ((inputs, outputs), (x, y), kind) in enumerate(
        zip(pairwise(widths), pairwise(values), kinds, strict=True), 1
    ):
        arrays = f"{name}_matrix_{k}, {name}_bias_{k}"
        lines.append(f"    {name}_layer({arrays}, {inputs}, {outputs}, {x}, {y});")
        if kind in STATEMENTS:
            lines.append(f"    for (int j = 0; j < {outputs}; ++j) {{")
            lines.append(f"        {STATEMENTS[kind].format(y=y)}")
            lines.append("    }")
    return "\n".join(lines)


def _array(name: str, values: Sequence[float] | np.ndarray) -> str:
    """Return the definition of an array of constants."""
    numbers = wrap(", ".join(map(_number, values)), WIDTH - 4)
    lines = "\n".join(f"    {line}" for line in numbers)
    return f"static const float {name}[{len(values)}] = {{\n{lines}\n}};"


def _number(value: float) -> str:
    """Return a constant of C that is read as the same float32."""
    return f"{np.float32(value)!s}f"
