"""The settings of a race of several vehicles."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Annotated, Literal

from quadsim.files.strict_yaml import setting
from quadsim.files.values import check_fields
from quadsim.heat.rules import RulesName
from quadsim.heat.traffic import Sight

Expect = Literal["plans", "own", "velocity", "nothing"]


@dataclass(frozen=True)
class Awareness:
    """A planner expects the other vehicles to fly in some way, and keeps room from them.

    Examples:
        >>> from quadsim.heat.settings import Awareness
        >>> Awareness(expect="velocity").keep
        0.6
    """

    expect: Annotated[
        Expect,
        setting(
            "the others' flight as a planner expects it: plans (as they tell them), own (planned"
            " by itself, nothing told), velocity (constant) or nothing (ignored)"
        ),
    ] = "own"
    keep: Annotated[
        float, setting("distance that is kept from another vehicle", unit="m", gt=0, le=10)
    ] = 0.6
    keep_weight: Annotated[
        float, setting("weight of each metre by which it is not kept", ge=0, le=1e6)
    ] = 200.0
    keep_above: Annotated[
        float, setting("keep over the distance that is kept above another vehicle", ge=0.01, le=1)
    ] = 0.8
    keep_below: Annotated[
        float, setting("keep over the distance that is kept below another vehicle", ge=0.01, le=1)
    ] = 0.4
    ahead_share: Annotated[
        float, setting("factor on keep_weight for vehicles that are behind", ge=0, le=10)
    ] = 1.0
    patience: Annotated[
        float,
        setting(
            "time closely behind another vehicle until half of keep is kept from it; 0: keep is"
            " kept always",
            unit="s",
            ge=0,
            le=60,
        ),
    ] = 0.0
    own_samples: Annotated[
        int, setting("samples with which another vehicle's flight is planned", ge=64, le=65536)
    ] = 384

    def __post_init__(self) -> None:
        check_fields(self)


@dataclass(frozen=True)
class HeatSettings(Awareness):
    """The settings of a race of several vehicles.

    Those of Awareness are for all planners that have none of their own.

    Examples:
        >>> from quadsim.heat.settings import HeatSettings
        >>> HeatSettings().rules
        'elimination'
    """

    rules: Annotated[
        RulesName,
        setting(
            "elimination: vehicles within 0.1 m are both out; chaser: who touches from behind is"
            " out; physics: contacts push away and hits cost time"
        ),
    ] = "elimination"
    downwash: Annotated[
        bool, setting("whether a vehicle feels the flow below the rotors of others")
    ] = True
    spacing: Annotated[float, setting("distance of neighbouring starts", unit="m", gt=0, le=20)] = (
        1.0
    )
    stagger: Annotated[
        float, setting("time from one vehicle's start to the next one's", unit="s", ge=0, le=60)
    ] = 0.0
    seen_position_noise: Annotated[
        float, setting("noise of the others' seen positions, per axis", unit="m", ge=0, le=1)
    ] = 0.0
    seen_velocity_noise: Annotated[
        float, setting("noise of the others' seen velocities, per axis", unit="m/s", ge=0, le=10)
    ] = 0.0
    seen_delay: Annotated[
        float, setting("time until a vehicle sees where the others were", unit="s", ge=0, le=1)
    ] = 0.0

    @property
    def sight(self) -> Sight:
        """How well the vehicles see each other."""
        return Sight(self.seen_position_noise, self.seen_velocity_noise, self.seen_delay)

    @property
    def awareness(self) -> Awareness:
        """The awareness of planners that are given none of their own."""
        return Awareness(**{f.name: getattr(self, f.name) for f in fields(Awareness)})
