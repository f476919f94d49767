"""Gates of FlightGoggles by their corners (mit-aera/FlightGoggles, nominal_gate_locations.yaml).

    Gate1:
      nominal_location: [[x, y, z], [x, y, z], [x, y, z], [x, y, z]]     ENU [m]
    gate_names: [Gate2, Gate1]                   order of flight, of a challenge's file
    flightgoggles_uav_dynamics:
      init_pose: [x, y, z, qx, qy, qz, qw]       start, of a challenge's file

The keys of a challenge may stand in the same file, as `cat challenge.yaml gates.yaml` writes them.
Corners may stand in any order. The corners do not tell from which side a gate is entered, so it is
passed in the direction from the previous gate to the next.
"""

from __future__ import annotations

import numpy as np

from quadsim.course.foreign.reading import Entry, in_order, yaml_entry
from quadsim.course.foreign.track import ForeignGate, ForeignStart, ForeignTrack, Reading
from quadsim.rotation import matrix

# Tolerance of a rectangle, as a share of its diagonal
FLAT = 0.05


def read_flightgoggles(text: str, file: str, reading: Reading) -> ForeignTrack:
    """Return the track that lists of corners describe. Raises FileError."""
    root = yaml_entry(text, file)
    named = [(name, entry) for name, entry in root.named() if _has_corners(entry)]
    if not named:
        raise root.error("expected gates with nominal_location, four corners each, got none")
    order = root.get("gate_names") if isinstance(root.value, dict) else None
    wanted = reading.gates
    if order and not wanted:
        wanted = tuple(str(item.value) for item in order.items())
    names = [name for name, _ in named]
    gates = [_gate(*named[k], reverse) for k, reverse in in_order(names, wanted, root.fail)]
    return ForeignTrack(
        gates=tuple(gates),
        frame="enu",
        passage="either",
        simulator="FlightGoggles",
        start=_start(root),
    )


def _has_corners(entry: Entry) -> bool:
    return isinstance(entry.value, dict) and "nominal_location" in entry.value


def _gate(name: str, entry: Entry, reverse: bool) -> ForeignGate:
    """Return a gate with x along its normal and z up along an edge. Raises FileError."""
    listed = entry.at("nominal_location")
    corners = np.array([corner.vector() for corner in listed.items()])
    if corners.shape != (4, 3):
        raise listed.wrong("four corners of x, y, z")
    centre = corners.mean(axis=0)
    # The corner farthest from the first is opposite to it.
    away = np.linalg.norm(corners - corners[0], axis=1)
    beside = sorted(set(range(4)) - {0, int(away.argmax())})
    edges = corners[beside] - corners[0]
    sizes = np.linalg.norm(edges, axis=1)
    diagonal = float(away.max())
    opposite = corners[0] + edges.sum(axis=0)
    error = np.linalg.norm(opposite - corners[int(away.argmax())])
    if diagonal <= 0.0 or sizes.min() <= 0.0 or error > FLAT * diagonal:
        raise listed.error("expected the corners of a rectangle, got corners that form none")
    first, second = edges / sizes[:, None]
    if abs(first @ second) > FLAT:
        raise listed.error("expected right angles between the edges of a gate, got others")
    # The edge that rises more is the gate's z axis.
    up, side, height, width = first, second, sizes[0], sizes[1]
    if abs(second[2]) > abs(first[2]):
        up, side, height, width = second, first, sizes[1], sizes[0]
    up = up if up[2] >= 0.0 else -up
    normal = np.cross(side, up)
    normal /= np.linalg.norm(normal)
    left = np.cross(up, normal)
    return ForeignGate(
        name=name,
        place=listed.key,
        position=tuple(centre.tolist()),
        axes=np.column_stack([normal, left, up]),
        sizes=(float(width), float(width), float(height)),
        reverse=reverse,
    )


def _start(root: Entry) -> ForeignStart | None:
    """Return the start of a challenge, None if the file has none. Raises FileError."""
    dynamics = root.get("flightgoggles_uav_dynamics") if isinstance(root.value, dict) else None
    pose = dynamics.get("init_pose") if dynamics else None
    if pose is None:
        return None
    x, y, z, qx, qy, qz, qw = pose.numbers(7, "x, y, z, and x, y, z, w of a quaternion")
    quaternion = Entry([qw, qx, qy, qz], pose.key, pose.fail).quaternion()
    return ForeignStart((x, y, z), tuple(matrix(quaternion)[:, 0].tolist()))
