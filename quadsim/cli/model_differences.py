"""The parameters of the planner's model that differ from those of the vehicle it controls."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rich.console import RenderableType
from rich.markup import escape

from quadsim.console import plain_table
from quadsim.record.run import system_of

UNITS = {  # of a quadrotor's numbers
    **dict.fromkeys(("rate_lag", "motor_lag", "latency"), "s"),
    "drag": "1/s",
    "rate_limit": "rad/s",
    "thrust_limit": "m/s^2",
}
Number = float | list[float]  # one, or one for each axis


def model_table(spec: dict) -> RenderableType:
    """A row for each parameter that differs, or a line that none does."""
    rows, meanings = differing(spec), _meanings(spec)
    flies = system_of(spec) == "quadrotor"
    adapts = flies and spec["planner"]["mppi"].get("adapt")
    if not rows:
        if adapts:
            estimated = "thrust gain, drag and maximum thrust are estimated in flight"
            return f"[dim]model[/]  starts from the vehicle's nominal parameters; {estimated}"
        return "[dim]model[/]  the planner's model has the vehicle's nominal parameters"
    table = plain_table(
        "model", "planner's, at first" if adapts else "planner's", "vehicle's", "", left=range(4)
    )
    for name, sides in rows.items():
        texts = (" ".join(f"{x:g}" for x in sides[side]) for side in ("model", "vehicle"))
        table.add_row(name.replace("_", " "), *texts, f"[dim]{escape(meanings.get(name, ''))}[/]")
    return table


def differing(spec: dict) -> dict[str, dict[str, list[float]]]:
    """Name -> {model, vehicle}: one number for all axes that share it."""
    compared = (
        _quadrotor(spec)
        if system_of(spec) == "quadrotor"
        else _fields(spec["model"], spec["vehicle"])
    )
    rows = {name: {"model": _axes(m), "vehicle": _axes(v)} for name, (m, v) in compared.items()}
    return {name: row for name, row in rows.items() if row["model"] != row["vehicle"]}


def _quadrotor(spec: dict) -> dict[str, tuple[Number, Number]]:
    """Its model and its vehicle describe the same by other numbers."""
    model, vehicle = spec["model"], spec["vehicle"]
    rotors = vehicle["rotors"]
    return {
        "rate_lag": (model["rate_tau"], vehicle["rate_tau"]),
        "motor_lag": (model["motor_tau"], rotors["tau"] if rotors else 0.0),
        "latency": (0.0, vehicle["latency"]),
        "drag": (model["drag"], vehicle["drag"]),
        "rate_limit": (model["rate_max"], vehicle["rate_max"]),
        "thrust_limit": (model["thrust_max"], vehicle["thrust_max"]),
    }


def _fields(
    model: Mapping[str, Any], vehicle: Mapping[str, Any]
) -> dict[str, tuple[Number, Number]]:
    """The numbers that both have."""
    return {
        name: (value, vehicle[name])
        for name, value in model.items()
        if isinstance(value, int | float) and isinstance(vehicle.get(name), int | float)
    }


def _meanings(spec: dict) -> dict[str, str]:
    """Name -> unit."""
    return UNITS if system_of(spec) in (None, "quadrotor") else {}


def _axes(numbers: Number) -> list[float]:
    """One number where all axes have the same. Rounded: a mean of three may differ in its last
    digit."""
    values = [float(f"{x:.9g}") for x in (numbers if isinstance(numbers, list) else [numbers])]
    return values[:1] if len(set(values)) == 1 else values
