"""Poses of AirSim's gates, as simGetObjectPose of the Game of Drones (NeurIPS 2019) returns them.

The text is YAML or JSON, or poses as Python prints them: a mapping from the gates' names to poses,
a list of poses, or one of these under the key `gates`. A pose has `position` {x_val, y_val, z_val}
and `orientation` {w_val, x_val, y_val, z_val}, in NED, and may have a `scale`. Gate11_23 is gate
11.

The passage is the gate's y axis, as in get_gate_facing_vector_from_quaternion of baseline_racer.py
in microsoft/AirSim-NeurIPS2019-Drone-Racing. A gate of scale 1 has an opening of 1.6 m and is
2.1333 m wide outside.
"""

from __future__ import annotations

import re

from quadsim.course.foreign.reading import Entry, in_order, yaml_entry
from quadsim.course.foreign.track import ForeignGate, ForeignTrack, Reading
from quadsim.rotation import Vec3

OPENING = 1.6  # of scale 1 [m]
FRAME_WIDTH = 0.267  # of scale 1 [m]
# Names of classes in the text that Python prints for a pose
CLASS = re.compile(r"<(Pose|Vector3r|Quaternionr)>")


def read_airsim(text: str, file: str, reading: Reading) -> ForeignTrack:
    """Return the track that a list of poses describes. Raises FileError."""
    blank = CLASS.sub(lambda found: " " * len(found[0]), text)
    root = yaml_entry(blank, file)
    listed = root
    if isinstance(root.value, dict):
        listed = root.first("gates", "gate_poses") or root
    named = listed.named()
    names = [name for name, _ in named]
    gates = []
    for k, reverse in in_order(names, reading.gates, listed.fail):
        name, pose = named[k]
        gates.append(
            ForeignGate(
                name=name,
                place=pose.key,
                position=pose.at("position").vector(),
                axes=pose.at("orientation").axes(),
                sizes=_sizes(pose),
                reverse=reverse,
            )
        )
    return ForeignTrack(
        gates=tuple(gates),
        frame="ned",
        passage="y",
        simulator="AirSim",
        frame_width=FRAME_WIDTH,
    )


def _sizes(pose: Entry) -> Vec3:
    """Return the sizes of the opening along the gate's axes. Raises FileError."""
    scale = pose.get("scale")
    if scale is None:
        return OPENING, OPENING, OPENING
    if isinstance(scale.value, list | dict):
        x, y, z = scale.vector()
    else:
        x = y = z = scale.number()
    if min(x, y, z) <= 0.0:
        raise scale.wrong("a scale > 0")
    return OPENING * x, OPENING * y, OPENING * z
