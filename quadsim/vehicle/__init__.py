"""Vehicles: the numbers of a quadrotor, read from YAML files with Flightmare's key names."""

from quadsim.vehicle.vehicle import (
    GRAVITY,
    VEHICLES,
    Rotors,
    Vec3,
    Vehicle,
    load_vehicle,
    parse_vehicle,
    scale_thrust,
    vehicle_names,
    with_thrust_to_weight,
)

__all__ = [
    "GRAVITY",
    "VEHICLES",
    "Rotors",
    "Vec3",
    "Vehicle",
    "load_vehicle",
    "parse_vehicle",
    "scale_thrust",
    "vehicle_names",
    "with_thrust_to_weight",
]
