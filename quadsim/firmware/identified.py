"""The planner's model of a vehicle with the firmware, identified once and cached."""

from __future__ import annotations

import logging
from contextlib import suppress
from functools import lru_cache
from hashlib import sha256
from pathlib import Path

import msgspec

from quadsim.dynamics.quadrotor import ModelParams
from quadsim.files.atomic import replace_file
from quadsim.files.cache import cache_folder
from quadsim.firmware import actuators, identification, limits, switches, translation
from quadsim.firmware import configuration as reading
from quadsim.firmware.actuators import BetaflightActuators, motors_reversed
from quadsim.firmware.configuration import Configuration, configured
from quadsim.firmware.identification import (
    Identification,
    NoResponseError,
    identify,
    weak_yaw,
)
from quadsim.firmware.limits import nominal_behind
from quadsim.firmware.package import Built, built_firmware
from quadsim.firmware.text import Text
from quadsim.physics import link
from quadsim.physics.link import Link
from quadsim.vehicle import Vehicle

# Without configured logging, a warning is one line on stderr.
log = logging.getLogger("quadsim")
# Files whose change makes cached identifications invalid
CODE = (
    reading.__file__,
    actuators.__file__,
    identification.__file__,
    limits.__file__,
    switches.__file__,
    translation.__file__,
    link.__file__,
)


def firmware_for(vehicle: Vehicle, text: Text) -> tuple[Built, Configuration]:
    """Return the built firmware, and the configuration of a vehicle as the firmware reads it.

    Raises:
        FirmwareError: the firmware is not built, or does not arm.
        FileError: the firmware rejects the configuration.
    """
    built = built_firmware()
    return built, configured(built.program, text, motors_reversed(vehicle))


@lru_cache(maxsize=16)
def identified(vehicle: Vehicle, text: Text, dt: float, period: float) -> Identification:
    """Return the identification of a vehicle on the test bench, cached after the first call.

    Args:
        vehicle: the vehicle.
        text: configuration of the firmware.
        dt: physics step [s].
        period: control period [s].

    Raises:
        FirmwareError, FileError: as for `firmware_for`; or the vehicle does not answer as it is
            commanded.
    """
    built, configuration = firmware_for(vehicle, text)
    nominal = nominal_behind(vehicle, configuration, text.name)
    path = _path(built, vehicle, text, dt, period)
    found = _read(path)
    if found is None:
        log.warning(
            f"identifying the rate loop of {vehicle.name} behind Betaflight on a test bench, once:"
            " some 10 s"
        )

        def actuators() -> BetaflightActuators:
            wire = Link(dt, interpolation=period)
            return BetaflightActuators(vehicle, dt, built, configuration, link=wire)

        try:
            found = identify(nominal, dt, period, actuators)
        except NoResponseError as error:
            raise NoResponseError(f"{text.name}: {vehicle.name} on a bench: {error}") from None
        # If the cache cannot be written, the next call identifies the vehicle again.
        if path:
            with suppress(OSError):
                path.parent.mkdir(parents=True, exist_ok=True)
                replace_file(path, msgspec.json.encode(found))
    if weak_yaw(found, nominal):
        share = f"{100 * max(found.yaw.explained, 0.0):.0f} %"
        log.warning(
            f"{text.name}: {vehicle.name} swings about yaw, and the planner's model explains"
            f" {share} of it: race firmware tune finds other gains"
        )
    return found


def model_behind(vehicle: Vehicle, text: Text, dt: float, period: float) -> ModelParams:
    """Return the planner's model of a vehicle behind the firmware: identified, within its limits.

    For arguments and errors see `identified`.
    """
    _, configuration = firmware_for(vehicle, text)
    nominal = nominal_behind(vehicle, configuration, text.name)
    return identified(vehicle, text, dt, period).model(nominal)


def _path(built: Built, vehicle: Vehicle, text: Text, dt: float, period: float) -> Path | None:
    """Return the file of an identification, None if the user has no cache."""
    folder = cache_folder()
    if folder is None:
        return None
    code = [sha256(Path(file).read_bytes()).hexdigest() for file in CODE]
    what = [built.identity, text.lines, vehicle, dt, period, code]
    key = sha256(msgspec.json.encode(what)).hexdigest()
    return folder / "identified" / f"{key[:24]}.json"


def _read(path: Path | None) -> Identification | None:
    """Return the identification in a file, None if it is missing or damaged."""
    try:
        return msgspec.json.decode(path.read_bytes(), type=Identification) if path else None
    except (OSError, msgspec.DecodeError):
        return None
