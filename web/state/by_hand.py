"""Manual flights, with Betaflight if it is built, and with its default rates."""

from __future__ import annotations

from dataclasses import replace

from quadsim.config.spec import Spec
from quadsim.firmware import FlightControllerName
from quadsim.firmware.package import built_firmware
from quadsim.firmware.process import FirmwareError
from quadsim.firmware.text import shipped_configuration
from quadsim.racing.hand import Hand, HandRates
from quadsim.vehicle import load_vehicle


def flight_controller_of(vehicle: str) -> FlightControllerName:
    """Return "betaflight" if it is built and there is a configuration for the vehicle.

    vehicle: a name or a FILE.yaml.
    """
    try:
        built_firmware()
    except FirmwareError:
        return "ideal"
    loaded = load_vehicle(vehicle)
    has_configuration = loaded.rotors is not None and shipped_configuration(loaded) is not None
    return "betaflight" if has_configuration else "ideal"


def flown_by_hand(spec: Spec) -> Spec:
    """Return the flight with manual sticks instead of the planner."""
    return replace(spec, controller=Hand(HandRates.of(spec.vehicle)))
