"""A real flight controller in the loop: Betaflight, built from source, stepped in lock step."""

from typing import Literal

FlightControllerName = Literal["ideal", "betaflight"]
