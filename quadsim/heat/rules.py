"""The rules of a race of several vehicles, as data.

elimination  Vehicles whose centres come within 0.1 m of each other are both out. Otherwise
             they pass through each other. (Geles et al. 2026, UZH's multi-drone protocol)
chaser       Of two vehicles that touch, the one behind is out. (Game of Drones, NeurIPS 2019)
physics      Vehicles that touch push each other away, and nobody is out. A gate that is hit
             costs its penalty, and one that is missed is flown again. (Drone Champions League)
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

RulesName = Literal["elimination", "chaser", "physics"]
Out = Literal["both", "chaser", "nobody"]


@dataclass(frozen=True)
class Rules:
    """The rules that decide the consequences of a contact of two vehicles."""

    name: RulesName
    # distance of two centres that counts as a contact [m]; None: that at which they touch
    contact: float | None
    # the vehicles that are out after a contact
    out: Out
    # whether vehicles collide in the simulated world
    collide: bool
    # whether a hit of a gate adds time instead of ending the flight
    penalties: bool


RULES: dict[RulesName, Rules] = {
    "elimination": Rules("elimination", 0.1, "both", collide=False, penalties=False),
    "chaser": Rules("chaser", None, "chaser", collide=False, penalties=False),
    "physics": Rules("physics", None, "nobody", collide=True, penalties=True),
}
assert tuple(RULES) == get_args(RulesName)
