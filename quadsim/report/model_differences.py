"""The parameters in which the planner's model differs from the vehicle that it controls.

The latency is left out: the state is predicted to the time at which a command acts, see
 quadsim.report.given_state.
"""

from __future__ import annotations

from typing import NamedTuple

from rich.console import RenderableType

from quadsim.console import plain_table

UNITS = {
    "rate_lag": "s",
    "motor_lag": "s",
    "drag": "1/s",
    "rate_limit": "rad/s",
    "thrust_limit": "m/s^2",
}
# One number, or one for each axis
Number = float | list[float]


class Pair(NamedTuple):
    """The values of one parameter in the planner's model and in the vehicle."""

    model: Number
    vehicle: Number


def model_table(spec: dict) -> RenderableType:
    """Return a table with a row for each differing parameter, or one line if there is none.

    A firmware has its own rate loop, which the vehicle's numbers do not describe.
    """
    if spec.get("betaflight"):
        identified = "the planner's rate loop is the one identified behind Betaflight"
        return f"[dim]model[/]  {identified}{_limits(spec)}"
    rows = differing(spec)
    adapts = spec["planner"]["mppi"].get("adapt")
    if not rows and adapts:
        estimated = "thrust gain, drag and maximum thrust are estimated in flight"
        return f"[dim]model[/]  starts from the vehicle's nominal parameters; {estimated}"
    if not rows:
        return "[dim]model[/]  the planner's model has the vehicle's nominal parameters"
    planners = "planner's, at first" if adapts else "planner's"
    table = plain_table("model", planners, "vehicle's", "", left=range(4))
    for name, row in rows.items():
        model = " ".join(f"{x:g}" for x in row["model"])
        vehicle = " ".join(f"{x:g}" for x in row["vehicle"])
        table.add_row(name.replace("_", " "), model, vehicle, f"[dim]{UNITS[name]}[/]")
    return table


def _limits(spec: dict) -> str:
    """Return the model's limits that are lower than the vehicle's as text, "" if there are none."""
    rows = differing(spec)
    limits = [
        f"{name.replace('_limit', '')} to {' '.join(f'{x:.4g}' for x in rows[name]['model'])}"
        f" {UNITS[name]}"
        for name in ("thrust_limit", "rate_limit")
        if name in rows
    ]
    return f", with limits: {', '.join(limits)}" if limits else ""


def differing(spec: dict) -> dict[str, dict[str, list[float]]]:
    """Return the differing parameters by name, as {"model": numbers, "vehicle": numbers}.

    Numbers are a list with one number for all axes if they are equal, else with one for each axis.
    """
    found = {}
    for name, pair in _compared(spec).items():
        model = _axes(pair.model)
        vehicle = _axes(pair.vehicle)
        if model != vehicle:
            found[name] = {"model": model, "vehicle": vehicle}
    return found


def _compared(spec: dict) -> dict[str, Pair]:
    """Return the parameters that a model and a vehicle have in common, in the same units."""
    model = spec["model"]
    vehicle = spec["vehicle"]
    rotors = vehicle["rotors"]
    # In the model the lag of a rate loop with a lead is the sum of both.
    lead = vehicle["rate_lead"]
    lags = [tau + ahead for tau, ahead in zip(vehicle["rate_tau"], lead, strict=True)]
    return {
        "rate_lag": Pair(model["rate_tau"], lags),
        "motor_lag": Pair(model["motor_tau"], rotors["motor_tau"] if rotors else 0.0),
        "drag": Pair(model["drag"], vehicle["drag"]),
        "rate_limit": Pair(model["rate_max"], vehicle["omega_max"]),
        "thrust_limit": Pair(model["thrust_max"], vehicle["thrust_max"]),
    }


def _axes(numbers: Number) -> list[float]:
    """Return a list with one number if all axes are equal, else with all numbers.

    Numbers are rounded, because a mean of three may differ in its last digit.
    """
    values = numbers if isinstance(numbers, list) else [numbers]
    rounded = [float(f"{value:.9g}") for value in values]
    return rounded[:1] if len(set(rounded)) == 1 else rounded
