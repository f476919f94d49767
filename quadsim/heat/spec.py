"""HeatSpec: the complete specification of one race of several vehicles."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from quadsim.config.checks import PLANTS_WITH_ROTORS, plant_name
from quadsim.config.spec import Spec
from quadsim.course import Course, Start
from quadsim.files.values import SettingError
from quadsim.files.yaml_errors import shown_value
from quadsim.heat.distances import default_keep, default_spacing
from quadsim.heat.grid import check_grid, start_grid
from quadsim.heat.rules import RULES
from quadsim.heat.settings import Awareness, HeatSettings
from quadsim.streams import entrant_seed

MOST = 8  # vehicles of a race
# Settings of a flight that the race decides
SHARED = ("plant", "laps", "clock", "penalties")


@dataclass(frozen=True)
class Entrant:
    """A competitor: the spec of its flight, and its prediction of the other vehicles.

    Examples:
        >>> import quadsim
        >>> spec = quadsim.Spec.of("figure8", sampler="gaussian", laps=1)
        >>> quadsim.Entrant("first", spec).name
        'first'
    """

    name: str
    spec: Spec
    # None: the awareness in the race's settings
    awareness: Awareness | None = None


@dataclass(frozen=True)
class HeatSpec:
    """The complete specification of one race of several vehicles.

    The same specification gives the same race to the last bit on the same machine.

    Raises:
        SettingError: the entrants do not fit together, or have no room to start (a ValueError).

    Examples:
        >>> import quadsim
        >>> from quadsim.heat.spec import Entrant, HeatSpec
        >>> spec = quadsim.Spec.of("split_s_swift", laps=1)
        >>> heat = HeatSpec((Entrant("a", spec), Entrant("b", spec)))
        >>> [round(start.position[0], 2) for start in heat.starts]
        [-5.38, -4.6]
    """

    entrants: tuple[Entrant, ...]
    settings: HeatSettings = field(default_factory=HeatSettings)
    seed: int = 0
    # How many places further on the grid each entrant starts than its number is
    rotation: int = 0
    starts: tuple[Start, ...] = field(init=False)

    def __post_init__(self) -> None:
        """Check that the entrants fit together, and compute their starts."""
        entrants = _with_one_step(self.entrants)
        penalties = RULES[self.settings.rules].penalties
        if penalties and len(entrants) > 1:
            entrants = tuple(replace(one, spec=one.spec.but(penalties=True)) for one in entrants)
        object.__setattr__(self, "entrants", entrants)
        _check(entrants)
        self._fill_distances()
        object.__setattr__(self, "starts", self._places())

    def _fill_distances(self) -> None:
        """Replace distances of None by the defaults for this course and these vehicles."""
        radii = [entrant.spec.vehicle.radius for entrant in self.entrants]
        keep = default_keep(self.course, radii)
        settings = self.settings
        if settings.keep is None:
            settings = replace(settings, keep=keep)
        if settings.spacing is None:
            settings = replace(settings, spacing=default_spacing(self.course, radii))
        object.__setattr__(self, "settings", settings)
        entrants = tuple(
            replace(one, awareness=replace(one.awareness, keep=keep))
            if one.awareness and one.awareness.keep is None
            else one
            for one in self.entrants
        )
        object.__setattr__(self, "entrants", entrants)

    def _places(self) -> tuple[Start, ...]:
        """Return the start of each entrant. Raises SettingError."""
        places = len(self.entrants)
        course = self.course
        spacing = self.settings.spacing
        assert spacing is not None  # set by _fill_distances
        grid = start_grid(course, places, spacing)
        starts = [grid[self.place(k)] for k in range(places)]
        if places > 1:
            radii = [entrant.spec.vehicle.radius for entrant in self.entrants]
            check_grid(course, starts, radii, RULES[self.settings.rules].contact)
        return tuple(starts)

    @property
    def course(self) -> Course:
        """The course."""
        return self.entrants[0].spec.course

    @property
    def names(self) -> tuple[str, ...]:
        """The entrants' names, in order."""
        return tuple(entrant.name for entrant in self.entrants)

    def place(self, entrant: int) -> int:
        """Return the place of an entrant on the grid; both are counted from 0."""
        return (entrant + self.rotation) % len(self.entrants)

    def start_time(self, entrant: int) -> float:
        """Return the start time of an entrant [s]; places start one after the other."""
        return self.settings.stagger * self.place(entrant)

    def awareness(self, entrant: int) -> Awareness:
        """Return an entrant's prediction of the others, and the clearance that it keeps."""
        return self.entrants[entrant].awareness or self.settings.awareness

    def flown_spec(self, entrant: int) -> Spec:
        """Return the spec of an entrant's flight, with its seed and its start."""
        spec = self.entrants[entrant].spec
        start = self.starts[entrant]
        own_start = None if start == self.course.start else start
        return replace(spec, seed=entrant_seed(self.seed, entrant), start=own_start)

    def record(self) -> dict[str, Any]:
        """Return the specification as a JSON dict for a stored race."""
        return {
            "seed": self.seed,
            "rotation": self.rotation,
            "settings": asdict(self.settings),
            "entrants": [
                {
                    "name": entrant.name,
                    "place": self.place(k) + 1,
                    "awareness": asdict(self.awareness(k)),
                    "spec": self.flown_spec(k).record(),
                }
                for k, entrant in enumerate(self.entrants)
            ],
        }


def _with_one_step(entrants: Sequence[Entrant]) -> tuple[Entrant, ...]:
    """Return the entrants with a common physics step, the finest of all, for their shared world."""
    if not entrants:
        return ()
    finest = min(entrant.spec.plant_dt for entrant in entrants)
    return tuple(
        entrant
        if entrant.spec.plant_dt == finest
        else replace(entrant, spec=entrant.spec.but(plant_dt=finest))
        for entrant in entrants
    )


def _check(entrants: Sequence[Entrant]) -> None:
    """Check that the entrants can race in one world. Raises SettingError."""
    if not 1 <= len(entrants) <= MOST:
        raise SettingError("entrants", f"expected 1 to {MOST} of them, got {len(entrants)}")
    name, times = Counter(entrant.name for entrant in entrants).most_common(1)[0]
    if times > 1:
        raise SettingError("entrants", f"expected different names, got {name!r} {times} times")
    for entrant in entrants:
        if not entrant.name or not entrant.name.isprintable():
            wanted = "expected a name of printable characters"
            raise SettingError("entrants", f"{wanted}, got {entrant.name!r}")
    if len(entrants) > 1:
        _check_world(entrants)


def _check_world(entrants: Sequence[Entrant]) -> None:
    """Check that several entrants have one course, one plant and one clock. Raises SettingError."""
    first = entrants[0].spec
    for entrant in entrants:
        spec = entrant.spec
        who = f"for {entrant.name!r}, as for {entrants[0].name!r}"
        if spec.course != first.course:
            wanted = f"expected the course {first.course.name} {who}"
            raise SettingError("entrants", f"{wanted}, got {spec.course.name}")
        for name in SHARED:
            if getattr(spec, name) != getattr(first, name):
                wanted = f"expected {name} {shown_value(getattr(first, name))} {who}"
                raise SettingError("entrants", f"{wanted}, got {shown_value(getattr(spec, name))}")
        if spec.planner.mppi.dt != first.planner.mppi.dt:
            wanted = f"expected the control period {first.planner.mppi.dt:g} s {who}"
            raise SettingError("entrants", f"{wanted}, got {spec.planner.mppi.dt:g}")
        if spec.plant not in PLANTS_WITH_ROTORS:
            wanted = f"expected {' or '.join(PLANTS_WITH_ROTORS)} for a race of several"
            raise SettingError("plant", f"{wanted}, got {plant_name(spec.plant)}")
        for name in ("displace_gates", "known_from", "referee", "blackbox", "excite"):
            if getattr(spec, name):
                raise SettingError(name, "expected none for a race of several vehicles")
        if spec.map_scale != 1.0:
            wanted = "expected 1 for a race of several vehicles"
            raise SettingError("map_scale", f"{wanted}, got {spec.map_scale:g}")
        if spec.displacement.is_any:
            wanted = "expected one that leaves gates and obstacles on the map, in a race of several"
            raise SettingError("randomization", f"{wanted}, got {spec.randomization.name}")
