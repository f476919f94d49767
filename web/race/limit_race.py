"""The best known race of `race limit` as a competitor, for the ghost, gaps and sectors."""

from __future__ import annotations

from dataclasses import replace
from weakref import WeakKeyDictionary

import numpy as np

from quadsim.dynamics.quadrotor import STATE, VELOCITY
from quadsim.limit.limits import StoredSolution
from quadsim.racing.events import Event
from quadsim.web.race.competitor import Competitor

NAME = "limit"
RATE = 100.0  # frames a second

_made: WeakKeyDictionary[StoredSolution, Competitor] = WeakKeyDictionary()


def limit_race(entry: Competitor) -> Competitor | None:
    """Return the best known solution of a competitor's race, None if none is known.

    The result is a finished flight with the name `limit`. The conversion is cached.
    """
    stored = entry.limit
    if stored is None:
        return None
    if stored not in _made:
        _made[stored] = _competitor(entry, stored)
    return _made[stored]


def _competitor(entry: Competitor, stored: StoredSolution) -> Competitor:
    """Return a solution as a competitor in the race of `entry`."""
    solution = stored.solution
    end = float(solution.t[-1])
    t = np.append(np.arange(0.0, end - 0.5 / RATE, 1.0 / RATE), end)
    states = dict(zip(STATE, stored.states(entry.spec.vehicle, t).T, strict=True))
    # A gate is passed at the end of the last interval that leads to it
    gates = range(int(solution.target[-1]) + 1)
    passes = np.array([solution.t[1:][solution.target == gate][-1] for gate in gates])
    events = tuple(_pass(stored, k, float(at), entry.legs.gates) for k, at in enumerate(passes))
    commands = {
        "wx_cmd": states["wx"],
        "wy_cmd": states["wy"],
        "wz_cmd": states["wz"],
        "a_cmd": states["a"],
    }
    alone = {name: value for name, value in entry.record.items() if name != "heat"}
    columns = {"t": t, **states, **commands, "passed": np.searchsorted(passes, t, side="right")}
    return replace(
        entry.with_record({**alone, "sensing": None, "sampler": NAME}),
        name=NAME,
        x=columns,
        events=events,
        laps=tuple(stored.lap_times),
        outcome="finished",
        live=False,
        snapshots=None,
        sampled_trajectories=None,
        folder=None,
        start_numbers={},
        pending_numbers={},
        own_style=None,
        expected=(),
        corners=None,
        # A reference to the solution would keep the solution in _made for ever.
        limit=None,
    )


def _pass(stored: StoredSolution, k: int, t: float, gates: int) -> Event:
    """Return the event of the k-th gate pass, from 0, at t [s]. gates: number per lap."""
    lap, gate = divmod(k, gates)
    x, y, z = stored.solution.position(np.array([t]))[0].tolist()
    nearest = int(np.searchsorted(stored.solution.t, t))
    speed = float(np.linalg.norm(stored.solution.x[nearest, VELOCITY]))
    return Event(t, "pass", gate + 1, lap + 1, (0.0, 0.0), speed, (x, y, z))
