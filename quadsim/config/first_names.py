"""The names under which modules of this project were first stored.

Stored runs and campaigns tell parts of a user's own apart by a hash, in which functions and classes
of this project count by module and name. So that a file may move, a module counts by the name that
it had first: a part that uses `quadsim.heat.loop` has the hash of `quadsim.racing.heat`.
"""

from __future__ import annotations

# The first name of each module that has moved. A move adds a line and never changes one.
FIRST_NAMES = {
    "quadsim.config": "quadsim.spec",
    "quadsim.controllers": "controllers",
    "quadsim.controllers.costs.cost": "controllers.costs",
    "quadsim.web": "web",
    "quadsim.config.build_cost": "quadsim.spec.build",
    "quadsim.config.build_navigation": "quadsim.spec.build",
    "quadsim.config.build_plant": "quadsim.spec.build",
    "quadsim.config.checks": "quadsim.spec.spec",
    "quadsim.config.resolve": "quadsim.spec.spec",
    "quadsim.course.course_file": "quadsim.course.course",
    "quadsim.course.gate": "quadsim.course.course",
    "quadsim.dynamics.expected_path": "quadsim.racing.traffic",
    "quadsim.dynamics.named_tuples": "quadsim.dynamics.records",
    "quadsim.dynamics.system": "quadsim.dynamics",
    "quadsim.firmware.actuators": "quadsim.physics.betaflight",
    "quadsim.firmware.gain_search": "quadsim.physics.gain_search",
    "quadsim.firmware.identification": "quadsim.physics.identification",
    "quadsim.firmware.identified": "quadsim.spec.identified",
    "quadsim.firmware.tuned_gains": "quadsim.spec.tuned_gains",
    "quadsim.heat.grid": "quadsim.racing.grid",
    "quadsim.heat.line_up": "quadsim.campaign.line_ups",
    "quadsim.heat.loop": "quadsim.racing.heat",
    "quadsim.heat.marshal": "quadsim.racing.marshal",
    "quadsim.heat.rules": "quadsim.racing.rules",
    "quadsim.heat.traffic": "quadsim.racing.traffic",
    "quadsim.results.heat": "quadsim.heats",
    "quadsim.results.run": "quadsim.run",
    "quadsim.results.stored_runs": "quadsim.stored_runs",
    "quadsim.tables.listings": "quadsim.spec.listings",
    "quadsim.tables.settings_table": "quadsim.spec.settings_table",
    "quadsim.tables.wording": "quadsim.spec.wording",
    "quadsim.tables.write_keywords": "quadsim.spec.write_keywords",
    "quadsim.tables.write_tables": "quadsim.spec.write_tables",
}


def first_name(module: str) -> str:
    """Return the name under which a module, or a module of the same folder, was first stored.

    A worker process has the script of its parent under another name, which counts as "__main__".
    """
    if module == "__mp_main__":
        return "__main__"
    folder, rest = module, ""
    while folder:
        if folder in FIRST_NAMES:
            return FIRST_NAMES[folder] + rest
        folder, _, last = folder.rpartition(".")
        rest = f".{last}{rest}"
    return module
