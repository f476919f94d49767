"""Simulate quadrotor races that are flown by MPPI with Gaussian, colored or other sampling.

    import quadsim
    run = quadsim.fly("split_s_swift", sampler="colored", seed=0)
    print(run.outcome, run.laps)
    quadsim.plot(run, "race.png")

Names are loaded when they are first used, so that `import quadsim` takes milliseconds.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from quadsim.api import (
        compare,
        compare_heats,
        fit,
        fly,
        frames,
        load_heat,
        load_run,
        plot,
        race,
        read_logs,
        runs,
        save_run,
        sweep,
    )
    from quadsim.config.competition import load_competition
    from quadsim.config.settings import SettingError
    from quadsim.config.spec import Spec
    from quadsim.controllers.config import MPPIConfig
    from quadsim.controllers.costs import Cost, Term
    from quadsim.controllers.learned.export import export_pilot
    from quadsim.controllers.learned.observation import gate_rows, observe
    from quadsim.controllers.learned.pilot import load_pilot
    from quadsim.controllers.learned.policy import PolicyController, save_pilot
    from quadsim.controllers.mppi import MPPI
    from quadsim.controllers.plan import PlanStats
    from quadsim.controllers.samplers import Colored, Gaussian, LogNormal, Smooth, SmoothStar
    from quadsim.course import Course, Gate, Start, load_course
    from quadsim.course.foreign import convert_course
    from quadsim.dynamics import System
    from quadsim.dynamics.estimate import Estimate
    from quadsim.files.strict_yaml import FileError
    from quadsim.heat.settings import Awareness
    from quadsim.heat.spec import Entrant
    from quadsim.record.polynomials import fit_polynomials
    from quadsim.record.run import RunError
    from quadsim.results.heat import Heat
    from quadsim.results.run import Run
    from quadsim.sensing import Sensing, load_sensing
    from quadsim.tables.listings import (
        competitions,
        courses,
        presets,
        sensings,
        settings,
        vehicles,
    )
    from quadsim.vehicle import Vehicle, load_vehicle

_HOMES = {
    "quadsim.controllers.config": ("MPPIConfig",),
    "quadsim.controllers.costs": ("Cost", "Term"),
    "quadsim.controllers.learned.export": ("export_pilot",),
    "quadsim.controllers.learned.observation": ("gate_rows", "observe"),
    "quadsim.controllers.learned.pilot": ("load_pilot",),
    "quadsim.controllers.learned.policy": ("PolicyController", "save_pilot"),
    "quadsim.controllers.mppi": ("MPPI",),
    "quadsim.controllers.plan": ("PlanStats",),
    "quadsim.controllers.samplers": ("Colored", "Gaussian", "LogNormal", "Smooth", "SmoothStar"),
    "quadsim.api": (
        *("compare", "compare_heats", "fit", "fly", "frames", "load_heat"),
        *("load_run", "plot", "race", "read_logs", "runs", "save_run", "sweep"),
    ),
    "quadsim.course": ("Course", "Gate", "Start", "load_course"),
    "quadsim.course.foreign": ("convert_course",),
    "quadsim.files.strict_yaml": ("FileError",),
    "quadsim.heat.settings": ("Awareness",),
    "quadsim.heat.spec": ("Entrant",),
    "quadsim.results.heat": ("Heat",),
    "quadsim.sensing": ("Sensing", "load_sensing"),
    "quadsim.tables.listings": (
        *("competitions", "courses", "presets", "sensings", "settings", "vehicles"),
    ),
    "quadsim.config.competition": ("load_competition",),
    "quadsim.config.settings": ("SettingError",),
    "quadsim.config.spec": ("Spec",),
    "quadsim.record.polynomials": ("fit_polynomials",),
    "quadsim.record.run": ("RunError",),
    "quadsim.results.run": ("Run",),
    "quadsim.dynamics": ("System",),
    "quadsim.dynamics.estimate": ("Estimate",),
    "quadsim.vehicle": ("Vehicle", "load_vehicle"),
}
_HOME = {name: module for module, names in _HOMES.items() for name in names}
__all__ = sorted(_HOME)  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> Any:
    if name == "__version__":
        # Reading the version of the installed package takes some milliseconds.
        return import_module("importlib.metadata").version("quadsim")
    if name not in _HOME:
        raise AttributeError(f"module 'quadsim' has no attribute {name!r}")
    return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return list(__all__)
