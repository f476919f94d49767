"""How a flight is served to a client."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from quadsim.sensing.camera import Camera

# Rounds of the virtual contest: in the second one, neither the pose nor the track is sent.
Round = Literal["first", "second"]


@dataclass(frozen=True)
class Served:
    """The settings by which a flight is served."""

    client: str = "127.0.0.1"
    port: int = 14550
    camera_port: int = 5600
    camera: Camera | None = None  # None: no pictures
    round: Round = "first"
    lock_step: bool = False
    # by how much the barometer reads low in hover, in proportion to the thrust [m]
    baro_wash: float = 0.0
    # time from the client's first message, or from a reset, to the start that it is told [s]; None:
    # the race begins when the client arms
    countdown: float | None = None
