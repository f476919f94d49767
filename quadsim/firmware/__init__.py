"""A real flight controller in the loop: Betaflight, built from source, stepped in lock step.

It is built (`package`), configured (`configuration`, `gains`) and stepped (`process`, `actuators`);
on a test bench its rate loop is identified and its gains are found (`identification`,
`gain_search`).
"""

from typing import Literal

FlightControllerName = Literal["ideal", "betaflight"]
