"""Solve the nonlinear program of a route with IPOPT."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import casadi
import numpy as np

from quadsim.limit.detours import Detour
from quadsim.limit.dynamics import Dynamics
from quadsim.limit.guess import Guess
from quadsim.limit.limits import Solution
from quadsim.limit.route import Route
from quadsim.limit.transcription import Program, Shooting, shooting, state_scale

ITERATIONS = 1500
SOLVED = ("Solve_Succeeded", "Solved_To_Acceptable_Level")
OPTIONS = {
    "print_time": False,
    "ipopt.print_level": 0,
    # No banner on stdout
    "ipopt.sb": "yes",
    "ipopt.max_iter": ITERATIONS,
    "ipopt.tol": 1e-5,
    "ipopt.mu_strategy": "adaptive",
}
# Called after each iteration with its number and the time of the race so far [s]
Show = Callable[[int, float], None]


class NotSolvedError(Exception):
    """The optimiser has found no solution. The message is its return status."""


class Watch(casadi.Callback):
    """A callback that reports each iteration; an exception in `show` stops the optimiser."""

    def __init__(self, variables: int, constraints: int, show: Show):
        """Make a callback for a program with these numbers of variables and constraints."""
        casadi.Callback.__init__(self)
        # Sizes of the outputs of a solver, which are the inputs of its callback
        self._sizes = {
            "x": variables,
            "lam_x": variables,
            "f": 1,
            "g": constraints,
            "lam_g": constraints,
        }
        self._show = show
        self._count = 0
        self.raised: BaseException | None = None
        self.construct("watch", {})

    def get_n_in(self) -> int:
        """Return the number of inputs, as CasADi asks."""
        return casadi.nlpsol_n_out()

    def get_n_out(self) -> int:
        """Return the number of outputs, as CasADi asks."""
        return 1

    def get_name_in(self, i: int) -> str:
        """Return the name of an input, as CasADi asks."""
        return casadi.nlpsol_out(i)

    def get_sparsity_in(self, i: int) -> casadi.Sparsity:
        """Return the shape of an input, as CasADi asks."""
        size = self._sizes.get(casadi.nlpsol_out(i), 0)
        return casadi.Sparsity.dense(size, 1 if size else 0)

    def eval(self, arg: Sequence[Any]) -> list[int]:
        """Report an iteration, and return whether the optimiser stops: 1 if it does, else 0."""
        time = float(arg[1])
        try:
            self._show(self._count, time)
            self._count += 1
        except BaseException as error:
            # An exception would be lost in compiled code
            self.raised = error
            return [1]
        return [0]


def solve(
    route: Route,
    model: Dynamics,
    intervals: Sequence[int],
    guess: Guess,
    show: Show | None = None,
    around: Sequence[Detour] = (),
) -> Solution:
    """Return the locally fastest flight along a route, from an initial guess.

    Args:
        route: the gates.
        model: model of the vehicle.
        intervals: number of intervals on each of the route's legs.
        guess: initial guess.
        show: see Show.
        around: detours around frames and boxes beside the route.

    Raises:
        NotSolvedError: the optimiser gave up.
        BaseException: any exception that `show` raises.
    """
    s = shooting(route, model, intervals, guess, around)
    in_segment = np.array([segment.intervals for segment in s.plan])
    time = casadi.dot(casadi.DM(in_segment), casadi.vertcat(*s.lengths))
    found = minimise(s.program, time, show)
    return _read(s, found, in_segment)


def minimise(program: Program, objective: casadi.MX, show: Show | None = None) -> dict:
    """Return CasADi's solution of a program: x, g, lam_g and so on.

    Raises:
        NotSolvedError: the optimiser gave up.
        BaseException: any exception that `show` raises.
    """
    p = program
    z = casadi.vertcat(*p.z)
    g = casadi.vertcat(*p.g)
    watch = Watch(z.shape[0], g.shape[0], show or _show_nothing)
    options = OPTIONS | {"iteration_callback": watch}
    solver = casadi.nlpsol("limit", "ipopt", {"x": z, "f": objective, "g": g}, options)
    found = solver(x0=p.start, lbx=p.low, ubx=p.high, lbg=p.g_low, ubg=p.g_high)
    if watch.raised:
        raise watch.raised
    status = solver.stats()["return_status"]
    if status not in SOLVED:
        raise NotSolvedError(status.replace("_", " ").lower())
    return found


def _show_nothing(iteration: int, time: float) -> None:
    pass


def _read(s: Shooting, found: dict, in_segment: np.ndarray) -> Solution:
    """Return the optimiser's result as a Solution, given the intervals of each segment."""
    z = casadi.vertcat(*s.program.z)
    outputs = [casadi.horzcat(*s.x), casadi.horzcat(*s.u), casadi.vertcat(*s.lengths)]
    read = casadi.Function("read", [z], outputs)
    x, u, lengths = (np.array(part) for part in read(found["x"]))
    # The multipliers of the continuity constraints are the costate, in the program's scale
    multipliers = np.array(found["lam_g"]).ravel()
    costate = np.array([multipliers[defect] for defect in s.defects]) / state_scale(s.model)
    each = np.repeat(lengths.ravel(), in_segment)
    return Solution(
        model=s.model.name,
        t=np.append(0.0, np.cumsum(each)),
        x=x.T,
        u=u.T,
        costate=costate,
        target=np.repeat([segment.target for segment in s.plan], in_segment),
    )
