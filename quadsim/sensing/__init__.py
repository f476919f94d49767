"""What a vehicle senses of itself: sensors that watch the plant, and an estimator that is given what they say.

`quadsim.sensing.estimation` makes a state of measurements and of the map; it knows neither sensors nor plant.
"""

from quadsim.sensing.sensing_file import PERFECT, SENSINGS, Sensing, load_sensing, parse_sensing, sensing_names

__all__ = ["PERFECT", "SENSINGS", "Sensing", "load_sensing", "parse_sensing", "sensing_names"]
