"""Identification of a vehicle from its flight logs: see `fit_vehicle`."""

from quadsim.identify.fit import fit_vehicle
from quadsim.identify.result import VehicleFit
from quadsim.identify.to_vehicle import FittedNumber

__all__ = ["FittedNumber", "VehicleFit", "fit_vehicle"]
