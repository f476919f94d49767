"""A real flight controller in the loop: Betaflight, built from source, stepped in lock step.

The modules build the firmware (`package`), configure it (`configuration`, `gains`) and step it
(`process`, `actuators`); on a test bench they identify the rate loop and tune the gains
(`identification`, `gain_search`, `tuned_gains`).
"""

from typing import Literal

FlightControllerName = Literal["ideal", "betaflight"]
