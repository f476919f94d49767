"""The commands of `race`: each is a function in a module that is loaded on demand."""

from __future__ import annotations

from typing import NamedTuple

# Exit code of each outcome of a flight.
EXIT = {"finished": 0, "crashed": 1, "stuck": 1, "timeout": 1, "error": 1, "interrupted": 130}


class Command(NamedTuple):
    """One command."""

    function: str  # "module:function"
    summary: str
    compiles: bool = False  # whether the command runs the compiled planner


# The commands by name, in the groups of `race --help` and of docs/commands.md
GROUPS = {
    "Fly": {
        "fly": Command(
            "quadsim.cli.fly:fly", "simulate a flight: lap and split times, crashes, chatter", True
        ),
        "heat": Command(
            "quadsim.cli.heat:heat",
            "a race of several vehicles: places, overtakes, collisions",
            True,
        ),
        "web": Command("quadsim.cli.web:web", "watch, tune, race and replay in a browser", True),
        "serve": Command(
            "quadsim.cli.serve:serve", "the AI Grand Prix's simulator for a client over MAVLink"
        ),
        "firmware": Command(
            "quadsim.cli.firmware:firmware",
            "the flight controller Betaflight: what is built, build it",
        ),
    },
    "Stored runs": {
        "runs": Command("quadsim.cli.stored:runs", "the stored runs and races: list, filter"),
        "show": Command("quadsim.cli.stored:show", "the report of a stored run"),
        "plot": Command(
            "quadsim.cli.stored:plot", "a stored run as a picture: path, height, controls, spectrum"
        ),
        "export": Command(
            "quadsim.cli.stored:export", "a stored run as an offline page, CSV, MCAP or zip"
        ),
        "render": Command(
            "quadsim.cli.render:render",
            "labelled pictures for perception: colour, depth, segmentation",
        ),
    },
    "Many flights": {
        "compare": Command(
            "quadsim.cli.compare:compare",
            "compare variants over many flights, paired by seed",
            True,
        ),
        "compare-heats": Command(
            "quadsim.cli.compare_heats:compare_heats",
            "many races of several vehicles: wins, ranks, collisions",
            True,
        ),
        "sweep": Command(
            "quadsim.cli.sweep:sweep", "what each value of a setting costs, paired by seed", True
        ),
        "results": Command(
            "quadsim.cli.results:results", "stored comparisons: list, filter, compare"
        ),
        "tune": Command(
            "quadsim.cli.tune:tune", "search planner parameters for the fastest safe lap", True
        ),
        "regress": Command(
            "quadsim.cli.regress:regress",
            "regression test for lap times, success and chatter",
            True,
        ),
        "limit": Command(
            "quadsim.cli.limit:limit", "the least time in which a vehicle can fly a course"
        ),
    },
    "Training and measurements": {
        "train": Command(
            "quadsim.cli.train:train", "learn a pilot for a course, flown by race fly --pilot", True
        ),
        "train-pixels": Command(
            "quadsim.cli.train_pixels:train_pixels",
            "train the network that finds gates in pictures",
            True,
        ),
        "bench": Command(
            "quadsim.cli.bench:bench",
            "planning time on this machine, pytorch-mppi and JAX beside it",
            True,
        ),
        "paper": Command(
            "quadsim.cli.paper:paper", "reproduce the paper's tables and figures", True
        ),
    },
    "Courses, vehicles, sensors, settings": {
        "courses": Command("quadsim.cli.listing:courses", "the courses that come with the project"),
        "vehicles": Command(
            "quadsim.cli.listing:vehicles", "the vehicles that come with the project"
        ),
        "sensings": Command(
            "quadsim.cli.listing:sensings", "the sets of sensors that come with the project"
        ),
        "competitions": Command(
            "quadsim.cli.listing:competitions", "the competitions that come with the project"
        ),
        "presets": Command(
            "quadsim.cli.listing:presets", "the presets, with some of their numbers"
        ),
        "settings": Command(
            "quadsim.cli.listing:settings", "all settings: unit, range, default, meaning"
        ),
        "check": Command(
            "quadsim.cli.check:check", "check course, vehicle, preset and sensing files"
        ),
        "convert": Command(
            "quadsim.cli.convert:convert", "a course of another simulator as a course file"
        ),
        "vehicle": Command(
            "quadsim.cli.vehicle:vehicle",
            "a vehicle file from mass, thrust-to-weight, arm, propeller",
        ),
        "fit": Command("quadsim.cli.fit:fit", "a vehicle file from flight logs"),
    },
}
COMMANDS = {name: command for group in GROUPS.values() for name, command in group.items()}
