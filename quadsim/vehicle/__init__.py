"""Vehicles: the numbers of a quadrotor, read from YAML files and checked."""

from quadsim.vehicle.vehicle import GRAVITY, Rotors, Vehicle, scale_thrust, with_thrust_to_weight
from quadsim.vehicle.vehicle_file import VEHICLES, load_vehicle, parse_vehicle, vehicle_names

__all__ = [
    "GRAVITY",
    "VEHICLES",
    "Rotors",
    "Vehicle",
    "load_vehicle",
    "parse_vehicle",
    "scale_thrust",
    "vehicle_names",
    "with_thrust_to_weight",
]
