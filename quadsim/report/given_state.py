"""Describe the state that a controller was given: predicted to a later time, or as measured."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from quadsim.physics.link import WIRE, LinkConfig, command_latency
from quadsim.racing.hand import HAND


def given_state(spec: dict[str, Any]) -> str:
    """Return a description of the state that the controller of a run was given.

    Args:
        spec: the spec of the run.

    Returns:
        One line, "" if commands act at once or a person flew.
    """
    link = LinkConfig.of(spec)
    latency = command_latency(
        vehicle=spec["vehicle"]["latency"],
        link=link.latency,
        model=spec["model"]["delay"],
    )
    late = [f"{1e3 * latency:.3g} ms"] if latency else []
    if link.rate:
        late.append(f"the wait of up to {1e3 * link.period:.3g} ms for a frame")
    if spec["clock"] == "wall":
        late.append("the planning time")
    is_predicted = spec["predict"]
    if spec[HAND] or (is_predicted and not late):
        return ""
    if is_predicted:
        return f"state given {' plus '.join(late)} ahead of the measurement"
    acts = f"{' plus '.join(late)} later" if late else "at once"
    return f"state given as measured, the command acts {acts}"


def conditions(specs: Mapping[str, dict[str, Any]]) -> list[str]:
    """Return lines on the links of several flights and on the states that controllers were given.

    Args:
        specs: the spec of each run by the name of its entrant or variant.

    Returns:
        At most two lines, one for the links and one for the states; a line is left out if there is
        nothing to say of any flight.
    """
    links = {name: _link(spec) for name, spec in specs.items()}
    states = {name: given_state(spec) for name, spec in specs.items()}
    lines = (together(links, "no link"), together(states, "state given as measured"))
    return [line for line in lines if line]


def _link(spec: dict[str, Any]) -> str:
    """Return a description of a flight's link, "" if the flight has no link."""
    link = LinkConfig.of(spec)
    return "" if link == WIRE else str(link)


def together(texts: Mapping[str, str], without: str) -> str:
    """Return one line with the texts of several names.

    Args:
        texts: the text of each name, "" if it has none.
        without: text that replaces "" if other names have a text.

    Returns:
        The text alone if it is the same for all names; else "a, b: text; c: text".
    """
    if len(set(texts.values())) < 2:
        return next(iter(texts.values()), "")
    names: dict[str, list[str]] = {}
    for name, text in texts.items():
        names.setdefault(text, []).append(name)
    return "; ".join(f"{', '.join(of)}: {text or without}" for text, of in names.items())
