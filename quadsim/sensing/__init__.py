"""Sensors that sample the plant, and the estimate that a controller receives.

`quadsim.sensing.estimation` estimates the state from measurements and the map; it imports neither
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
