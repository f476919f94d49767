"""What the planner's model believes, held against what the vehicle is."""

from __future__ import annotations

from rich.console import RenderableType

from quadsim.app.lap_table import plain_table


def model_differences(spec: dict) -> RenderableType:
    """A table of the numbers that differ, or a line that none does."""
    rows = [(name, unit, b, i) for name, unit, b, i in _pairs(spec) if b != i]
    adapts = spec["planner"]["mppi"].get("adapt")
    if not rows:
        learns = "; it learns thrust, drag and limit in flight" if adapts else ""
        return f"[dim]model[/]  the planner believes the vehicle's own lags, drag and limits{learns}"
    table = plain_table()
    for name in ("model", "the planner begins with" if adapts else "the planner believes", "the vehicle is", ""):
        table.add_column(name)
    for name, unit, believed, real in rows:
        table.add_row(name, _text(believed), _text(real), f"[dim]{unit}[/]")
    return table


def differences(spec: dict) -> dict[str, dict]:
    """The same for programs: number -> {believed, real}."""
    return {name.replace(" ", "_"): {"believed": b, "real": i} for name, _, b, i in _pairs(spec) if b != i}


def _pairs(spec: dict) -> list[tuple[str, str, list[float], list[float]]]:
    """(number, unit, believed, real); one number stands for all axes that share it."""
    model, vehicle = spec["model"], spec["vehicle"]
    rotors = vehicle["rotors"]
    pairs = [
        ("rate lag", "s", model["rate_tau"], vehicle["rate_tau"]),
        ("motor lag", "s", model["motor_tau"], rotors["tau"] if rotors else 0.0),
        ("latency", "s", 0.0, vehicle["latency"]),
        ("drag", "1/s", model["drag"], vehicle["drag"]),
        ("rate limit", "rad/s", model["rate_max"], vehicle["rate_max"]),
        ("thrust limit", "m/s^2", model["thrust_max"], vehicle["thrust_max"]),
    ]
    return [(name, unit, _axes(believed), _axes(real)) for name, unit, believed, real in pairs]


def _axes(numbers: float | list[float]) -> list[float]:
    """[.4, .4, .4] and .4 say the same; a mean of three may differ in its last digit."""
    values = [float(f"{x:.9g}") for x in (numbers if isinstance(numbers, list) else [numbers])]
    return values[:1] if len(set(values)) == 1 else values


def _text(numbers: list[float]) -> str:
    return " ".join(f"{x:g}" for x in numbers)
