"""VehicleFit: the fitted vehicle with the intervals of its numbers, and its files."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from quadsim.dynamics.quadrotor import ModelParams
from quadsim.files.yaml_text import written
from quadsim.identify.prediction import Prediction
from quadsim.identify.to_vehicle import FittedNumber
from quadsim.identify.traces import Trace
from quadsim.vehicle import Vehicle

# Keys of a vehicle file, with the fitted numbers on their line
LINES = {
    "mass": ("mass",),
    "inertia": ("inertia.x", "inertia.y", "inertia.z"),
    "rate_tau": ("rate_tau.x", "rate_tau.y", "rate_tau.z"),
    "drag": ("drag.x", "drag.y", "drag.z"),
    "latency": ("latency",),
    "motor_tau": ("rotors.motor_tau",),
    "thrust_map": ("rotors.thrust_map.c2", "rotors.thrust_map.c1", "rotors.thrust_map.c0"),
    "kappa": ("rotors.kappa",),
}


@dataclass(frozen=True, eq=False)
class VehicleFit:
    """A vehicle that was fitted to logs.

    Attributes:
        name: name of the vehicle.
        vehicle: the vehicle, which `quadsim.fly` flies.
        numbers: its numbers with 95 % intervals and sources.
        remarks: one line each on what the logs do not tell, and what was left out.
        predictions: errors of open-loop flights in each tested log.
        traces: measured and predicted signals of some seconds.
        residuals: of each channel, over their noise.
    """

    name: str
    vehicle: Vehicle
    numbers: tuple[FittedNumber, ...]
    remarks: tuple[str, ...]
    predictions: tuple[Prediction, ...]
    traces: tuple[Trace, ...] = ()
    residuals: Mapping[str, np.ndarray] = field(default_factory=dict)

    def __repr__(self) -> str:
        """Return one short line."""
        told = sum(number.source == "log" for number in self.numbers)
        return f"<VehicleFit {self.name}: {told} numbers from the logs>"

    def __getitem__(self, key: str) -> FittedNumber:
        """Return a number by its key, such as "drag.x".

        Raises:
            KeyError: there is no such number.
        """
        for number in self.numbers:
            if number.key == key:
                return number
        raise KeyError(key)

    @property
    def doubt(self) -> str:
        """Why the fit predicts worse than constant velocity, "" if it does not."""
        # The last row is that of all logs after the longest time.
        row = self.predictions[-1] if self.predictions else None
        if row is None or row.measured_attitude <= row.constant_velocity:
            return ""
        wanted = f"expected predictions that beat constant velocity after {row.seconds:g} s"
        got = f"{row.measured_attitude:.3g} m in place of {row.constant_velocity:.3g} m"
        return f"{wanted}, got errors of {got}"

    @property
    def model(self) -> ModelParams:
        """The planner's model, with lags of the angular acceleration that a vehicle file lacks."""
        model = ModelParams.of(self.vehicle)
        lags = [number.value for number in self.numbers if number.key.startswith("rate_lag.")]
        if len(lags) < 3:
            return model
        x, y, z = lags
        return replace(model, rate_lag=(x, y, z))

    def to_yaml(self, path: str | Path | None = None) -> str:
        """Return the text of a vehicle file with each number's interval and source as a comment.

        Args:
            path: file to write; None writes nothing.

        Raises:
            FileError: the file cannot be written.
        """
        text, block, rest = self.vehicle.to_yaml().partition("uncertainty:")
        lines = [self._commented(line) for line in text.splitlines()]
        # The block of standard deviations has keys of the same names.
        lines += (block + rest).splitlines()
        remarks = [f"# {remark}" for remark in self.remarks]
        return written("\n".join([*remarks, *lines]) + "\n", path)

    def _commented(self, line: str) -> str:
        """Return a line of the vehicle file with its comment."""
        keys = LINES.get(line.split(":")[0].strip(), ())
        known = {number.key: number for number in self.numbers}
        numbers = [known[key] for key in keys if key in known]
        if not numbers:
            return line
        unit = numbers[0].unit if len({number.unit for number in numbers}) == 1 else ""
        said = ", ".join(_said(number) for number in numbers)
        return f"{line}  # {f'[{unit}] ' if unit else ''}{said}"

    def to_json(self, path: str | Path | None = None) -> str:
        """Return the numbers, intervals and remarks as JSON.

        Args:
            path: file to write; None writes nothing.

        Raises:
            FileError: the file cannot be written.
        """
        content = {
            "name": self.name,
            "numbers": [number._asdict() for number in self.numbers],
            "remarks": list(self.remarks),
            "predictions": [prediction._asdict() for prediction in self.predictions],
        }
        return written(json.dumps(content, indent=1) + "\n", path)


def _said(number: FittedNumber) -> str:
    """Return a number's interval and source."""
    if number.source != "log":
        return number.source
    return f"{number.low:.4g} to {number.high:.4g}"
