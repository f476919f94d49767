"""Flights that a person flies: behind Betaflight where that is built, with its default rates."""

from __future__ import annotations

from dataclasses import replace

from quadsim.config.resolve import shipped_configuration
from quadsim.config.spec import Spec
from quadsim.firmware import FlightControllerName
from quadsim.firmware.package import built_firmware
from quadsim.firmware.process import FirmwareError
from quadsim.racing.hand import Hand, HandRates
from quadsim.vehicle import load_vehicle


def flight_controller_of(vehicle: str) -> FlightControllerName:
    """Return "betaflight" where it is built and the vehicle comes with a configuration of it.

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
    """Return the flight with a person's sticks in the planner's place."""
    return replace(spec, controller=Hand(HandRates.of(spec.vehicle)))
