"""Which state a controller was given, as text: ahead of the measurement, or as measured."""

from __future__ import annotations

from typing import Any

from quadsim.physics.link import WIRE, LinkConfig, command_latency
from quadsim.racing.hand import HAND


def given_state(spec: dict[str, Any]) -> str:
    """Return which state the controller of a run was given.

    Args:
        spec: the spec of the run.

    Returns:
        One line, "" if commands act at once or a person flew.
    """
    link = LinkConfig(**spec["link"]) if spec.get("link") else WIRE
    latency = command_latency(
        vehicle=spec["vehicle"].get("latency", 0.0),
        link=link.latency,
        model=spec["model"].get("delay", 0.0),
    )
    late = [f"{1e3 * latency:.3g} ms"] if latency else []
    if link.rate:
        late.append(f"the wait of up to {1e3 * link.period:.3g} ms for a frame")
    if spec.get("clock") == "wall":
        late.append("the planning time")
    is_predicted = spec.get("predict", True)
    if spec.get(HAND) or (is_predicted and not late):
        return ""
    if is_predicted:
        return f"state given {' plus '.join(late)} ahead of the measurement"
    acts = f"{' plus '.join(late)} later" if late else "at once"
    return f"state given as measured, the command acts {acts}"
