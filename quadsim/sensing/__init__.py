"""Sensors that watch the plant, and the estimate that a controller is given.

`quadsim.sensing.estimation` makes a state of measurements and of the map; it imports neither
sensors nor plant. `quadsim.sensing.navigation` makes the Estimate that a controller plans with.
"""

from quadsim.sensing.sensing_file import (
    PERFECT,
    SENSINGS,
    Sensing,
    load_sensing,
    parse_sensing,
    sensing_names,
)

__all__ = ["PERFECT", "SENSINGS", "Sensing", "load_sensing", "parse_sensing", "sensing_names"]
