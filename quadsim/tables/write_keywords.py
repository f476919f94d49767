"""Write keywords.py, which declares the keywords of `quadsim.fly` for editors and type checkers.

    python -m quadsim.tables.write_keywords

Names and types come from quadsim.config.settings. A type checker cannot derive them from
dataclasses, so they are written out; a test fails when the file is out of date.
"""

from __future__ import annotations

from pathlib import Path

from msgspec import inspect

from quadsim.config.settings import SETTINGS, Kind, Setting, bare

FILE = Path(__file__).parents[1] / "config" / "keywords.py"
HEAD = '''"""The keywords of `quadsim.fly`, for editors and type checkers.

Written by `python -m quadsim.tables.write_keywords`; quadsim.config.settings explains each.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypedDict

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from quadsim.config.competition import Competition
    from quadsim.config.spec import Spec
    from quadsim.controllers.costs import Cost, Term
    from quadsim.controllers.learned.pilot import Pilot
    from quadsim.controllers.presets import Planner
    from quadsim.controllers.samplers import PlainSampler, Sampling
    from quadsim.course import Course
    from quadsim.dynamics.quadrotor import ModelParams
    from quadsim.firmware.text import Text
    from quadsim.physics.plant import Plant, PlantName
    from quadsim.physics.randomization_file import RandomizationRanges
    from quadsim.racing.flight import ControlLaw, Controller, RefereeProtocol
    from quadsim.sensing import Sensing
    from quadsim.vehicle import Vehicle

    CourseLike = str | Path | Course
    Numbers = Sequence[float] | NDArray[Any]


class Keywords(TypedDict, total=False):
    """The settings by name. `Spec.of` takes the same keywords.

    None stands for the default. It switches off a number of the planner that can be off, such as
    `cutoff` and `target_ess`.
    """

'''
# Types of the keywords that take an object, most of them instead of a name.
OBJECTS = {
    "sampler": "str | Sampling | PlainSampler",
    "pilot": "str | Path | Pilot",
    "preset": "str | Path",
    "vehicle": "str | Path | Vehicle",
    "sensing": "str | Path | Sensing",
    "randomization": "str | Path | RandomizationRanges",
    "competition": "str | Path | Competition",
    "plant": "PlantName | Plant | Callable[[Spec], Plant]",
    "betaflight": "str | Path | Text",
    "runs_dir": "str | Path",
    "planner": "Planner",
    "model": "ModelParams",
    "terms": "Sequence[Term | tuple[Callable[..., Any], float | NDArray[Any]]]",
    "cost": "Cost | Callable[[Cost], Cost]",
    "controller": "str | Controller | ControlLaw | Callable[[Spec], Controller | ControlLaw]",
    "referee": "RefereeProtocol | Callable[[Spec], RefereeProtocol]",
}


def keywords_module() -> str:
    """Return the text of keywords.py."""
    types = {name: _type(setting) for name, setting in SETTINGS.items()} | OBJECTS
    return HEAD + "".join(f"    {name}: {kind} | None\n" for name, kind in types.items())


def _type(setting: Setting) -> str:
    """Return the type annotation of a setting."""
    kinds = dict.fromkeys(_text(kind) for kind in setting.kinds.values())
    return " | ".join(kinds)


def _text(kind: Kind) -> str:
    match bare(kind):
        case inspect.BoolType():
            return "bool"
        case inspect.IntType():
            return "int"
        case inspect.FloatType():
            return "float"
        case inspect.LiteralType(values):
            return f"Literal[{', '.join(map(repr, values))}]".replace("'", '"')
        case inspect.TupleType():
            return "Numbers"
        case inspect.VarTupleType():
            return "str | Sequence[str]"
    return "str"


if __name__ == "__main__":
    FILE.write_text(keywords_module(), encoding="utf-8")
