"""Checks of the parts of a flight, of each part alone and of parts together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import get_args

from quadsim.config.own import check_part
from quadsim.config.settings import CONTROL_UNITS, PlantName, SettingError
from quadsim.controllers.costs import Cost
from quadsim.controllers.learned.pilot import Pilot
from quadsim.controllers.presets import Planner
from quadsim.controllers.presets import contradictions as contradictions_of_planner
from quadsim.controllers.samplers import Sampling, is_registered
from quadsim.dynamics.quadrotor import Control
from quadsim.files.strict_yaml import FileError
from quadsim.files.yaml_errors import shown_value
from quadsim.firmware.process import MAIN_LOOP
from quadsim.firmware.text import Text
from quadsim.limit.limits import LimitProblem, StoredSolution
from quadsim.physics.crazyflow_plant import before_scipy
from quadsim.physics.faults import (
    CommandFault,
    FactorFault,
    FaultOfVehicle,
    parse_fault,
    sensor_key,
)
from quadsim.physics.link import SETTINGS as LINK_SETTINGS
from quadsim.physics.link import WIRE, LinkConfig
from quadsim.physics.randomization_file import RandomizationRanges, check_randomization
from quadsim.racing.flight import whole_multiple
from quadsim.sensing import PERFECT, Sensing
from quadsim.sensing.pixels.network import load_network
from quadsim.vehicle import Vehicle, check_vehicle

PLANTS = get_args(PlantName)
# Plants with the rotors of quadsim.physics.actuators
PLANTS_WITH_ROTORS = ("bullet", "rigid")
ROUNDING = 1e-6


def plant_name(plant: object) -> str:
    """Return the name of a plant for errors."""
    return plant if isinstance(plant, str) else "a plant of your own"


def sensing_name(sensing: Sensing | None) -> str:
    """Return the name of a sensing for errors; None stands for exact knowledge."""
    return sensing.name if sensing else PERFECT


def check_type(name: str, part: object, kind: type) -> None:
    """Raise SettingError unless a part has the expected type."""
    if not isinstance(part, kind):
        raise SettingError(name, f"expected a {kind.__name__}, got {shown_value(part)}")


def check_classes(name: str, part: object) -> None:
    """Check that a part and its values have the project's own classes. Raises SettingError.

    A record has only their numbers, so a repeated flight would lack the methods of a subclass.
    """
    if not is_dataclass(part):
        return
    kind = type(part)
    if kind.__module__.partition(".")[0] != "quadsim":
        wanted = "expected one of quadsim's own classes, whose methods need not be recorded"
        raise SettingError(name, f"{wanted}, got {kind.__name__}")
    for inner in fields(part):
        check_classes(name, getattr(part, inner.name))


def check_numbers(name: str, part: object) -> None:
    """Check the numbers of a part that was not read from a file by the rules of its file.

    Args:
        name: name of the setting.
        part: a vehicle, a sensing or a randomization; other parts are checked elsewhere.

    Raises:
        SettingError: a number is out of range, or the numbers do not fit together.
    """
    try:
        if isinstance(part, Vehicle):
            check_vehicle(part)
        elif isinstance(part, Sensing):
            part.but()
        elif isinstance(part, RandomizationRanges):
            check_randomization(part)
    except SettingError as error:
        raise SettingError(name, str(error)) from None


def check_plant(plant: object) -> None:
    """Check that a plant is a known name or the user's own. Raises SettingError."""
    if not isinstance(plant, str):
        check_part("plant", plant)
    elif plant not in PLANTS:
        known = " or ".join(map(repr, PLANTS))
        raise SettingError("plant", f"expected {known}, got {plant!r}")
    elif plant == "crazyflow":
        # Here, as the planner loads SciPy before a flight has its plant
        before_scipy()


def check_cost(cost: object) -> None:
    """Check that a cost replaces or changes the default one. Raises SettingError."""
    if not (cost is None or isinstance(cost, Cost) or callable(cost)):
        wanted = "expected a Cost, or a function of the default Cost that returns one"
        raise SettingError("cost", f"{wanted}, got {shown_value(cost)}")


def check_period(dt: float, plant_dt: float) -> None:
    """Check that a control period [s] is a multiple of the physics step. Raises SettingError."""
    try:
        whole_multiple(dt, plant_dt)
    except ValueError:
        wanted = f"expected a whole multiple of the plant's step {plant_dt:g} [s]"
        raise SettingError("dt", f"{wanted}, got {dt:g}") from None


def check_view(view_weight: float, sensing: Sensing | None) -> None:
    """Check that a flight whose cost has the view term has a camera. Raises SettingError."""
    if view_weight and not (sensing and sensing.corner_camera):
        wanted = "expected a sensing with a camera"
        raise SettingError("view_weight", f"{wanted}, got {sensing_name(sensing)}")


def check_network(sensing: Sensing | None) -> None:
    """Check that the network that finds gates in pictures can be loaded. Raises SettingError."""
    network = sensing.pixels.network if sensing and sensing.pixels else None
    if network is None:
        return
    try:
        load_network(network)
    except (FileError, ModuleNotFoundError) as error:
        raise SettingError("sensing", f"pixels.network: {error}") from None


def check_record_sensing(record_sensing: bool, sensing: Sensing | None) -> None:
    """Check that a flight that records its sensing has sensors. Raises SettingError."""
    if record_sensing and sensing is None:
        wanted = "expected a sensing with sensors beside it"
        raise SettingError("record_sensing", f"{wanted}, got {PERFECT}")


def check_known_from(
    known_from: float | None, sensing: Sensing | None, pilot: Pilot | None
) -> None:
    """Check that the controller can use true positions of gates. Raises SettingError."""
    if known_from is None:
        return
    if sensing is not None:
        wanted = "expected none beside sensors, whose estimator finds displaced gates"
        raise SettingError("known_from", f"{wanted}, got {known_from:g} and {sensing.name}")
    if pilot is not None:
        wanted = "expected none beside a learned pilot, which flies by the map"
        raise SettingError("known_from", f"{wanted}, got {known_from:g}")


def check_planner(planner: Planner) -> None:
    """Check that the numbers of a planner fit together. Raises SettingError."""
    if is_registered(planner.sampling):
        _check_channels(planner.sampling)
    for path, problem in contradictions_of_planner(planner):
        raise SettingError(path.partition(".")[2], problem)


def _check_channels(sampling: Sampling) -> None:
    """Check that a sampler has one number for each control. Raises SettingError."""
    wanted = len(Control._fields)
    for name in ("sigma", "gamma"):
        numbers = getattr(sampling, name, None)
        if numbers is not None and len(numbers) != wanted:
            units = f" [{CONTROL_UNITS}]" if name == "sigma" else ""
            shown = " ".join(map(str, numbers))
            raise SettingError(name, f"expected {wanted} numbers{units}, got {shown}")


def check_beside_reference(displace_gates: float, view_weight: float, map_scale: float) -> None:
    """Check that no setting excludes following a reference. Raises SettingError."""
    for name, number in (("displace_gates", displace_gates), ("view_weight", view_weight)):
        if number:
            why = "for a preset whose reference ignores displaced gates and the camera"
            raise SettingError(name, f"expected 0 {why}, got {number:g}")
    if map_scale != 1.0:
        why = "for a preset whose reference is of the map"
        raise SettingError("map_scale", f"expected 1 {why}, got {map_scale:g}")


def check_reference(reference: StoredSolution | None, problem: LimitProblem) -> None:
    """Check that the solution to be followed belongs to this race. Raises SettingError."""
    if reference is None or reference.key != problem.key:
        got = reference.key if reference else None
        raise SettingError("reference", f"expected a solution of {problem.file_name}, got {got}")


def check_beside_pilot(controller: object, deadline_ms: float | None) -> None:
    """Check that no given part would be ignored by a learned pilot. Raises SettingError."""
    if controller is not None:
        problem = f"expected none beside a pilot, got {shown_value(controller)}"
        raise SettingError("controller", problem)
    if deadline_ms is not None:
        problem = f"expected none beside a pilot, which has no samples, got {deadline_ms:g}"
        raise SettingError("deadline_ms", problem)


def check_no_firmware(betaflight: Text | None, blackbox: str | None) -> None:
    """Check that no setting of the firmware is given without it. Raises SettingError."""
    if betaflight is not None:
        wanted = "expected none beside the flight controller 'ideal'"
        raise SettingError("betaflight", f"{wanted}, got {betaflight.name!r}")
    if blackbox is not None:
        wanted = "expected none without the flight controller 'betaflight'"
        raise SettingError("blackbox", f"{wanted}, got {blackbox!r}")


def expect_new_log(blackbox: str | Path) -> None:
    """Raise SettingError if the file of the firmware's log exists already."""
    if Path(blackbox).exists():
        wanted = "expected a new file, of the log of this flight"
        advice = "name another, or remove it"
        raise SettingError(
            "blackbox", f"{wanted}, got one that exists, {str(blackbox)!r}: {advice}"
        )


def check_firmware(
    betaflight: Text | None,
    blackbox: str | None,
    vehicle: Vehicle,
    plant: object,
    plant_dt: float,
) -> None:
    """Check that the vehicle and the plant fit the firmware. Raises SettingError."""
    if blackbox is not None and not Path(blackbox).absolute().parent.is_dir():
        wanted = "expected a file in a folder that exists"
        raise SettingError("blackbox", f"{wanted}, got {blackbox!r}")
    name = "flight_controller"
    if vehicle.rotors is None:
        wanted = "expected a vehicle with rotors for 'betaflight'"
        raise SettingError(name, f"{wanted}, got {vehicle.name}")
    if plant not in PLANTS_WITH_ROTORS:
        wanted = f"expected plant {' or '.join(PLANTS_WITH_ROTORS)} for 'betaflight'"
        raise SettingError(name, f"{wanted}, got {plant_name(plant)}")
    if not is_whole(plant_dt / MAIN_LOOP):
        wanted = f"expected a whole multiple of {MAIN_LOOP:g} s for 'betaflight'"
        raise SettingError("plant_dt", f"{wanted}, got {plant_dt:g}")
    if betaflight is None:
        wanted = f"expected FILE.txt of Betaflight's CLI for the vehicle {vehicle.name}"
        raise SettingError("betaflight", f"{wanted}, as none comes with the project")


def is_whole(number: float) -> bool:
    """Return whether a number is a positive integer, up to rounding errors."""
    return abs(number - round(number)) < ROUNDING and round(number) >= 1


def check_link(link: LinkConfig, plant: object, plant_dt: float) -> None:
    """Check that the plant has a link, and that the link's numbers agree. Raises SettingError."""
    if link == WIRE:
        return
    if plant not in PLANTS_WITH_ROTORS:
        name = next(name for name, number in LINK_SETTINGS.items() if getattr(link, number))
        wanted = f"expected plant {' or '.join(PLANTS_WITH_ROTORS)} for a link"
        raise SettingError(name, f"{wanted}, got {plant_name(plant)}")
    if link.rate and link.rate * plant_dt > 1.0 + ROUNDING:
        wanted = f"expected at most {1.0 / plant_dt:g} Hz, a frame in each physics step"
        raise SettingError("link_hz", f"{wanted}, got {link.rate:g}")
    if link.burst is not None:
        # A channel that is bad after each good frame loses bursts of no less than this.
        shortest = link.loss / (1.0 - link.loss)
        if not link.loss or link.burst < shortest:
            wanted = f"at least {shortest:.3g} frames with" if link.loss else "none without"
            raise SettingError("link_burst", f"expected {wanted} link_loss, got {link.burst:g}")


def check_faults(
    texts: Sequence[str],
    vehicle: Vehicle,
    plant: object,
    sensing: Sensing | None,
    flight_controller: str,
) -> None:
    """Check that the flight has the parts that faults affect. Raises SettingError."""
    for text in texts:
        try:
            fault = parse_fault(text)
        except ValueError as error:
            raise SettingError("fault", str(error)) from None
        if isinstance(fault, FaultOfVehicle):
            if vehicle.rotors is None:
                wanted = "expected a vehicle with rotors"
                raise SettingError("fault", f"{wanted} for {text!r}, got {vehicle.name}")
            if plant not in PLANTS_WITH_ROTORS:
                wanted = f"expected plant {' or '.join(PLANTS_WITH_ROTORS)}"
                raise SettingError("fault", f"{wanted} for {text!r}, got {plant_name(plant)}")
            has_own_loop = flight_controller != "ideal"
            if has_own_loop and isinstance(fault, FactorFault) and fault.part == "rate_gain":
                wanted = "expected the flight controller 'ideal'"
                raise SettingError("fault", f"{wanted} for {text!r}, got {flight_controller!r}")
        elif not isinstance(fault, CommandFault):
            key = sensor_key(fault)
            if sensing is None or getattr(sensing, key) is None:
                name = sensing_name(sensing)
                wanted = f"expected a sensing with {key!r}"
                raise SettingError("fault", f"{wanted} for {text!r}, got {name}")
