"""Vehicles: the parameters of a quadrotor, read from YAML files and checked."""

from quadsim.vehicle.vehicle import (
    GRAVITY,
    VEHICLES,
    Rotors,
    Uncertainty,
    Vehicle,
    check_vehicle,
    load_vehicle,
    parse_vehicle,
    scale_thrust,
    unlikely_inertia,
    vehicle_names,
    with_thrust_to_weight,
)

__all__ = [
    "GRAVITY",
    "VEHICLES",
    "Rotors",
    "Uncertainty",
    "Vehicle",
    "check_vehicle",
    "load_vehicle",
    "parse_vehicle",
    "scale_thrust",
    "unlikely_inertia",
    "vehicle_names",
    "with_thrust_to_weight",
]
