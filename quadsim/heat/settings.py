"""The settings of a race of several vehicles."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Annotated, Literal

from quadsim.files.strict_yaml import setting, unit
from quadsim.files.values import check_fields
from quadsim.heat.rules import RulesName
from quadsim.heat.traffic import Sight

Expect = Literal["plans", "own", "velocity", "nothing"]
Clearance = Annotated[float, unit("m", gt=0, le=10)]
Spacing = Annotated[float, unit("m", gt=0, le=20)]


@dataclass(frozen=True)
class Awareness:
    """A planner's prediction of the other vehicles, and the clearance that it keeps from them.

    A HeatSpec replaces a `keep` of None by its default, see quadsim.heat.distances.

    Examples:
        >>> from quadsim.heat.settings import Awareness
        >>> Awareness(expect="velocity").keep_weight
        200.0
    """

    expect: Annotated[
        Expect,
        setting(
            "prediction of the other vehicles: plans (the plans that they share), own (planned by"
            " the planner itself), velocity (constant velocity) or nothing (ignored)"
        ),
    ] = "own"
    keep: Annotated[
        Clearance | None,
        setting(
            "horizontal clearance to other vehicles (default: 0.6 m, or half of the narrowest"
            " opening if that is less)"
        ),
    ] = None
    keep_weight: Annotated[float, setting("cost per metre inside that clearance", ge=0, le=1e6)] = (
        200.0
    )
    keep_above: Annotated[
        float,
        setting("horizontal over vertical clearance above another vehicle", ge=0.01, le=1),
    ] = 0.8
    keep_below: Annotated[
        float,
        setting("horizontal over vertical clearance below another vehicle", ge=0.01, le=1),
    ] = 0.4
    ahead_share: Annotated[
        float, setting("factor on keep_weight for vehicles that are behind", ge=0, le=10)
    ] = 1.0
    patience: Annotated[
        float,
        setting(
            "time behind another vehicle after which the clearance to it is halved; 0: the"
            " clearance never shrinks",
            unit="s",
            ge=0,
            le=60,
        ),
    ] = 0.0
    own_samples: Annotated[
        int, setting("samples of the plan for another vehicle (expect: own)", ge=64, le=65536)
    ] = 384

    def __post_init__(self) -> None:
        check_fields(self)


@dataclass(frozen=True)
class HeatSettings(Awareness):
    """The settings of a race of several vehicles.

    The settings inherited from Awareness apply to every planner without its own. A HeatSpec
    replaces a `keep` and a `spacing` of None by their defaults, see quadsim.heat.distances.

    Examples:
        >>> from quadsim.heat.settings import HeatSettings
        >>> HeatSettings().rules
        'elimination'
    """

    rules: Annotated[
        RulesName,
        setting(
            "elimination: two vehicles within 0.1 m of each other are both out; chaser: the one"
            " that touches from behind is out; physics: contacts push apart and hits cost time"
        ),
    ] = "elimination"
    downwash: Annotated[
        bool, setting("whether the downwash of other vehicles acts on a vehicle")
    ] = True
    spacing: Annotated[
        Spacing | None,
        setting(
            "distance between neighbouring starts (default: 1 m, or the largest with room for all)"
        ),
    ] = None
    stagger: Annotated[
        float, setting("time between the starts of consecutive vehicles", unit="s", ge=0, le=60)
    ] = 0.0
    seen_position_noise: Annotated[
        float, setting("noise of the perceived positions of others, per axis", unit="m", ge=0, le=1)
    ] = 0.0
    seen_velocity_noise: Annotated[
        float,
        setting("noise of the perceived velocities of others, per axis", unit="m/s", ge=0, le=10),
    ] = 0.0
    seen_delay: Annotated[
        float, setting("delay of the perceived states of others", unit="s", ge=0, le=1)
    ] = 0.0

    @property
    def sight(self) -> Sight:
        """The noise and the delay with which the vehicles perceive each other."""
        return Sight(self.seen_position_noise, self.seen_velocity_noise, self.seen_delay)

    @property
    def awareness(self) -> Awareness:
        """The awareness of planners that do not have their own."""
        return Awareness(**{f.name: getattr(self, f.name) for f in fields(Awareness)})
