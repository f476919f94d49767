"""A configuration of the firmware with gains for a vehicle, and what they change."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from math import ceil, degrees
from typing import Any, NamedTuple

from quadsim.files.values import SettingError
from quadsim.firmware.actuators import BetaflightActuators, motors_reversed
from quadsim.firmware.configuration import with_other_gains
from quadsim.firmware.gain_search import StepResponse, search, step_response, wanted_response
from quadsim.firmware.gains import AXIS_NAMES, AxisGains, Gains, gains_of, with_gains
from quadsim.firmware.identification import NewActuators
from quadsim.firmware.identified import firmware_for
from quadsim.firmware.limits import nominal_behind
from quadsim.firmware.package import FIRMWARE_VERSION
from quadsim.firmware.text import Text, shipped_configuration
from quadsim.firmware.translation import in_this_version
from quadsim.physics.link import Link
from quadsim.vehicle import Vehicle

LARGEST_RATE = 200  # of rates_type ACTUAL [10 deg/s]
PLAIN = (
    "# Gains do not change with the throttle",
    "set tpa_rate = 0",
    "set throttle_boost = 0",
    "# Switches: AUX1 arms",
    "aux 0 0 0 1700 2100 0 0",
    "# Commands come from a computer, which ramps them itself",
    "set rc_smoothing = OFF",
    "set runaway_takeoff_prevention = OFF",
    "# Gains, from race firmware tune",
)

Show = Callable[[str, float], None]  # takes an axis and the share of its search that is done


class Responses(NamedTuple):
    """The step responses of one axis."""

    axis: str
    wanted: StepResponse
    before: StepResponse
    after: StepResponse


class Tuned(NamedTuple):
    """The gains that a search has found, and how the vehicle responds with them."""

    before: AxisGains
    after: AxisGains
    text: Text  # the configuration with the gains after
    responses: list[Responses]  # of roll, pitch, yaw

    def as_json(self) -> dict[str, Any]:
        """Return gains, figures of the step responses, and the lines of the configuration."""
        axes = {
            axis.axis: {
                name: {
                    "rise_time_s": response.rise_time,
                    "overshoot": response.overshoot,
                    "settled_error": response.settled_error,
                }
                for name, response in zip(axis._fields[1:], axis[1:], strict=True)
            }
            for axis in self.responses
        }
        for name, before, after in zip(AXIS_NAMES, self.before, self.after, strict=True):
            axes[name]["before"] |= before._asdict()
            axes[name]["after"] |= after._asdict()
        return {"axes": axes, "lines": self.text.lines}


def first_configuration(vehicle: Vehicle) -> Text:
    """Return the Betaflight configuration that is used if the user gives none.

    It is the configuration shipped with the vehicle; without one, see `plain_configuration`.

    Raises:
        SettingError: the vehicle has no rotors.
        FileError: the file cannot be read.
    """
    if vehicle.rotors is None:
        problem = f"expected a vehicle with rotors for Betaflight, got {vehicle.name}"
        raise SettingError("vehicle", problem)
    return shipped_configuration(vehicle) or plain_configuration(vehicle)


def plain_configuration(vehicle: Vehicle) -> Text:
    """Return a configuration with linear rates that cover the vehicle's, and Betaflight's gains."""
    tens = [min(ceil(degrees(rate) / 10.0), LARGEST_RATE) for rate in vehicle.omega_max]
    roll, pitch, yaw = (10 * rate for rate in tens)
    lines = [
        f"# Betaflight {FIRMWARE_VERSION}, for the vehicle {vehicle.name}. This text can be pasted "
        "into the Configurator's CLI.",
        f"# Rates: linear, up to {roll}, {pitch} and {yaw} deg/s about roll, pitch and yaw",
        "set rates_type = ACTUAL",
    ]
    for name, rate in zip(AXIS_NAMES, tens, strict=True):
        lines += [f"set {name}_rc_rate = {rate}", f"set {name}_srate = {rate}"]
        lines += [f"set {name}_expo = 0"]
    return Text("Betaflight's gains", (*lines, *PLAIN))


class FirmwareBench:
    """Starts the firmware of a vehicle on the test bench, with one configuration or another."""

    def __init__(self, vehicle: Vehicle, text: Text, dt: float, period: float):
        """Read the configuration.

        Args:
            vehicle: the vehicle.
            text: configuration of its firmware.
            dt: physics step [s].
            period: control period, in which a command is reached along a straight line [s].

        Raises:
            FirmwareError: the firmware is not built, or does not arm.
            FileError: it does not take its configuration.
        """
        self.dt = dt
        self.period = period
        self.text = in_this_version(text)
        self.built, self.configuration = firmware_for(vehicle, self.text)
        limits = nominal_behind(vehicle, self.configuration, text.name)
        # Steps stay within what the configuration gives.
        self.vehicle = replace(vehicle, omega_max=limits.rate_max, thrust_max=limits.thrust_max)

    @property
    def gains(self) -> AxisGains:
        """The gains of the text."""
        return gains_of(self.built.program, self.configuration)

    def actuators(self, gains: AxisGains | None = None) -> BetaflightActuators:
        """Start the firmware; None: with the gains of the text."""
        configuration = self.configuration
        if gains is not None:
            configuration = with_other_gains(
                configuration,
                self.built.program,
                with_gains(self.text, gains),
                motors_reversed(self.vehicle),
            )
        link = Link(self.dt, interpolation=self.period)
        return BetaflightActuators(self.vehicle, self.dt, self.built, configuration, link=link)

    def response(self, axis: int, gains: AxisGains | None = None) -> StepResponse:
        """Return the step response of an axis; None: with the gains of the text."""
        return step_response(self.vehicle, axis, self.dt, lambda: self.actuators(gains))


def tuned(
    vehicle: Vehicle,
    text: Text,
    dt: float,
    period: float,
    show: Show = lambda axis, share: None,
) -> Tuned:
    """Return the configuration with the gains whose step responses are best.

    Args:
        vehicle: the vehicle.
        text: configuration of its firmware.
        dt: physics step [s].
        period: control period [s].
        show: function that is called with the share of the search that is done.

    Raises:
        FirmwareError, FileError: as for FirmwareBench.
    """
    bench = FirmwareBench(vehicle, text, dt, period)
    text = bench.text
    before = bench.gains
    after = before
    for name in AXIS_NAMES:
        after = _searched(bench, name, after, partial(show, name))
    responses = [
        Responses(
            name,
            wanted_response(bench.vehicle, axis, dt, period),
            bench.response(axis),
            bench.response(axis, after),
        )
        for axis, name in enumerate(AXIS_NAMES)
    ]
    return Tuned(before, after, with_gains(text, after), responses)


def _searched(
    bench: FirmwareBench, name: str, gains: AxisGains, show: Callable[[float], None]
) -> AxisGains:
    """Return the gains with the best gains of one axis that are found.

    Args:
        bench: the test bench.
        name: name of the axis.
        gains: gains before the search; the other axes keep theirs.
        show: function that is called with the share of the search that is done.
    """

    def with_axis(of_axis: Gains) -> NewActuators:
        return partial(bench.actuators, gains._replace(**{name: of_axis}))

    axis = AXIS_NAMES.index(name)
    found = search(bench.vehicle, axis, bench.dt, bench.period, gains[axis], with_axis, show)
    return gains._replace(**{name: found})
