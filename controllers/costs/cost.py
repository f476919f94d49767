"""Costs q(x): tuples of terms, each a plain function over named scalars, like the systems.

    q = sum_k w_k term_k(x, x_next, u, target, p),     J = (1/T) sum_t q_t

A term returns one number for one step of one sample, which leads from x to x_next under the control
u. `target` is the sample's target row, the numbers that describe its current target, and `p` the
parameters of the cost. Two more functions of the same kind control the sample: `reached` moves the
sample to its next target row, `crash` marks it as crashed for the rest of its rollout. A third one,
`risk`, adds a number to that mark, such as the probability of a crash.

    def clearance(x, x_next, u, gate, p):
        step = at_gate(x, x_next, gate)
        missing = maximum(step.outside + gate.margin * step.span, 0.0)
        return where(step.within, missing, 0.0)

See quadsim.dynamics for the arithmetic that these functions may use.
"""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, NamedTuple, NoReturn, Protocol, cast

import numpy as np

from quadsim.files.yaml_errors import did_you_mean, shown_value

if TYPE_CHECKING:
    from quadsim.dynamics.estimate import Estimate

# Numbers of target rows that count to the finish: distance [m] and time [s] from a target on
TO_GO = ("to_go", "later")

Weight = float | np.ndarray  # one number, or one for each step of the horizon (T,)

# (x, x_next, u, target, p) -> a number or a condition, over named scalars
StepFunction = Callable[[Any, Any, Any, Any, Any], Any]
# (x, target, p) -> a number, over named scalars
StateFunction = Callable[[Any, Any, Any], Any]


class NumberTuple(Protocol):
    """A NamedTuple of numbers, by the members that all NamedTuples have."""

    _fields: tuple[str, ...]

    def __iter__(self) -> Iterator[Any]: ...

    def __getitem__(self, index: Any, /) -> Any: ...

    def _asdict(self) -> dict[str, Any]: ...

    @classmethod
    def _make(cls, iterable: Iterable[Any]) -> Any: ...


class NoParams(NamedTuple):
    """The parameters of a cost without parameters."""


NO_PARAMS = NoParams()


def crash(x, x_next, u, target, p):
    """Represent the crash flag of a sample: 1 from a crash on, 0 before.

    As a term it is the cost of a crash, per step. The function is never called: the rollout uses
    the sample's flag instead.

    Examples:
        >>> from quadsim import Term
        >>> from quadsim.controllers import crash
        >>> Term(crash, weight=1000.0)
        Term(crash, weight=1000.0)
    """
    raise NotImplementedError("the rollout puts the flag of a crashed sample in this term's place")


def is_weight(value: object) -> bool:
    """Return whether a value is a finite number, or an array or a list of finite numbers.

    Its length is checked when the horizon is known, see Cost.numbers.
    """
    try:
        numbers = np.asarray(value)
    except ValueError:  # lists of different lengths
        return False
    return numbers.dtype.kind in "fiu" and bool(np.isfinite(numbers).all())


class Term:
    """One term of a cost: a function and the weight of the number that it returns.

    Args:
        function: (x, x_next, u, target, p) -> number, a plain function over named scalars. It may
            be a lambda, a closure, a method, a functools.partial or an object that can be called;
            numbers that it holds are compiled into the rollouts.
        weight: factor on its number; a term of weight zero is left out of the rollouts.
        name: the name in telemetry and reports, an identifier; default: the name of the function,
            or of the class of an object.
        parameters: numbers of its own, which `p` then holds in place of the cost's. Each is a
            number, or an array (T,) with one number for each step of the horizon. They can be
            changed without compiling again.

    Raises:
        ValueError: the name is no identifier, the function not callable, or a number not finite.

    Examples:
        >>> from numpy import maximum
        >>> from quadsim import Term
        >>> def band(x, x_next, u, target, p):
        ...     return maximum(p.low - x_next.pz, 0.0) + maximum(x_next.pz - p.high, 0.0)
        >>> term = Term(band, weight=50.0, low=2.0, high=3.5)
        >>> term.name, term.weight, term.parameters
        ('band', 50.0, band_parameters(low=2.0, high=3.5))
        >>> term.but(high=4.0)
        Term(band, weight=50.0, low=2.0, high=4.0)
    """

    def __init__(
        self,
        function: StepFunction | StateFunction,
        weight: Weight = 1.0,
        name: str = "",
        **parameters: Weight,
    ):
        if not callable(function):
            problem = f"expected a function (x, x_next, u, target, p), got {shown_value(function)}"
            raise ValueError(f"term: {problem}")
        self.function = function
        self.weight = weight
        self.name = name or _name_of(function)
        if not self.name.isidentifier():
            raise ValueError(
                "term: expected a name as of a variable, such as Term(..., name='band'), "
                f"got {self.name!r}"
            )
        for number in (weight, *parameters.values()):
            if not is_weight(number):
                wanted = "expected a finite number, or an array (T,) of them"
                raise ValueError(f"term {self.name}: {wanted}, got {shown_value(number)}")
        self.parameters: NumberTuple | None = None
        if parameters:
            kind: Any = namedtuple(f"{self.name}_parameters", tuple(parameters))
            self.parameters = kind(**parameters)

    def but(self, weight: Weight | None = None, **parameters: Weight) -> Term:
        """Return the term with a changed weight or changed parameters.

        Raises:
            ValueError: the term has no such parameter, or a number is not finite.
        """
        own = self.parameters._asdict() if self.parameters else {}
        for given in parameters:
            if given not in own:
                near = did_you_mean(given, ["weight", *own])
                raise ValueError(f"term {self.name}: no parameter {given!r}: {near}")
        weight = self.weight if weight is None else weight
        kinds = (kind for kind in (StateTerm, AmountTerm) if isinstance(self, kind))
        kind = next(kinds, Term)
        return kind(self.function, weight, self.name, **{**own, **parameters})

    def value(self, x: Any, x_next: Any, u: Any, target: Any, p: Any) -> Any:
        """Return the number of the term for a step from x to x_next."""
        of_step = cast(StepFunction, self.function)
        return of_step(x, x_next, u, target, p)

    def __reduce__(self) -> tuple:
        parameters = self.parameters._asdict() if self.parameters else {}
        return _term, (type(self), self.function, self.weight, self.name, parameters)

    @cached_property
    def shape(self) -> tuple:
        """The key of the compiled loop: function and parameter names, without values."""
        own = self.parameters._fields if self.parameters else None
        has_weight = bool(np.any(self.weight))
        return isinstance(self, StateTerm), self.name, _ByIdentity(self.function), own, has_weight

    def __repr__(self) -> str:
        own = self.parameters._asdict() if self.parameters else {}
        numbers = {"weight": self.weight, **own}
        shown = ", ".join(f"{name}={value}" for name, value in numbers.items())
        return f"Term({self.name}, {shown})"


class StateTerm(Term):
    """A term of a state and its target alone, which is computed at marks of the horizon only.

    Its function is (x, target, p) -> number. The marks are some steps apart (`Schedule.marks`), and
    the number at a mark stands for the steps since the mark before. It suits a number that changes
    slowly and takes long to compute.
    """

    def value(self, x: Any, x_next: Any, u: Any, target: Any, p: Any) -> Any:
        """Return the number of the term for the state x_next."""
        of_state = cast(StateFunction, self.function)
        return of_state(x_next, target, p)


class AmountTerm(Term):
    """A term whose number is an amount, such as a cost per metre flown in a step.

    The numbers of other terms count for each control period. In a step of several periods they
    count as often, but an amount counts once.
    """


class EstimatedTerm(Term):
    """A term some of whose numbers follow from the estimate with which a plan begins.

    The planner asks for these numbers before each plan and keeps a copy of them, so that the term
    itself never changes. `but` returns a Term without such numbers.
    """

    def numbers_from(self, estimate: Estimate, times: np.ndarray) -> dict[str, Weight]:
        """Return the numbers that follow from an estimate: name of a parameter -> its value.

        The name "weight" stands for the weight.

        Args:
            estimate: what is known.
            times: at which the steps of the horizon end, in the time of the others' paths [s]
                (T,).
        """
        raise NotImplementedError


class _ByIdentity:
    """A function in a key, compared by identity, as a callable object may have no hash."""

    def __init__(self, function: Callable):
        self.function = function

    def __hash__(self) -> int:
        return id(self.function)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _ByIdentity) and self.function is other.function


def number_name(term: str, name: str) -> str:
    """Return the name of a term's number among all numbers of a cost; see Cost.number_names.

    Args:
        term: name of the term.
        name: "weight", or the name of a parameter.
    """
    return f"weight_{term}" if name == "weight" else f"p_{term}_{name}"


def _name_of(function: Any) -> str:
    """Return the name of a function, or of an object's class; a lambda's is "lambda"."""
    while isinstance(function, partial):
        function = function.func
    return getattr(function, "__name__", type(function).__name__).strip("<>")


def _term(
    kind: type[Term],
    function: StepFunction | StateFunction,
    weight: Weight,
    name: str,
    parameters: dict[str, Weight],
) -> Term:
    """Make a term again in another process, as pickle does not find the type of its record."""
    return kind(function, weight, name, **parameters)


def is_record_type(kind: object) -> bool:
    """Return whether an object is a NamedTuple class."""
    return isinstance(kind, type) and issubclass(kind, tuple) and hasattr(kind, "_fields")


def is_record_of_numbers(record: object) -> bool:
    """Return whether an object is a NamedTuple of finite numbers, or of arrays of them."""
    if not isinstance(record, tuple) or not is_record_type(type(record)):
        return False
    return all(map(is_weight, record))


@dataclass(frozen=True)
class Obstacles:
    """Obstacles for all samples, independent of their targets.

    A sample that touches an obstacle has crashed. A sample on the way to its last target has
    finished the race and is not tested.
    """

    # (p0, p1, row) -> whether the straight line between two positions touches the obstacle
    touches: Callable[[Any, Any, Any], Any]
    # NamedTuple: the names of a row's numbers, first the corners of a box around the obstacle [m]
    row: type[NumberTuple]
    rows: np.ndarray  # (obstacles, n_obstacle)
    # (x, seconds) -> the rows that may be reached from x in this time
    near: Callable[[np.ndarray, float], np.ndarray]


@dataclass(frozen=True, eq=False)
class Cost:
    """A cost: terms, parameters and targets.

    `reached` and `crash` are functions like the terms, and return a condition; None: always false.
    A sample's crash flag is 0, and at least 1 from a crash on; `risk` adds to it in each step.

    Examples:
        >>> from typing import NamedTuple
        >>> import numpy as np
        >>> from quadsim import Cost, Term
        >>> class Goal(NamedTuple):
        ...     x: float  # [m]
        >>> def distance(x, x_next, u, goal, p):
        ...     return (x_next.px - goal.x) ** 2
        >>> cost = Cost("reach", (Term(distance, 1.0),), Goal, targets=np.array([[2.0]]))
        >>> cost.term_names
        ('distance',)
    """

    name: str
    terms: tuple[Term, ...]
    # NamedTuple: the names of a target row's numbers, see TO_GO
    row: type[NumberTuple]
    targets: np.ndarray  # the target rows, from the first target on  (targets, n_target)
    # NamedTuple of numbers, or of arrays (T,) if they depend on the step of the horizon
    params: NumberTuple = NO_PARAMS
    reached: StepFunction | None = None  # whether the sample has reached its target
    crash: StepFunction | None = None  # whether the sample crashes in this step
    # number that the step adds to the sample's crash flag, such as the probability of a crash
    risk: StepFunction | None = None
    obstacles: Obstacles | None = None
    # (x, row) -> whether x has not left the gate of the target just reached
    still_in_gate: Callable[[np.ndarray, np.ndarray], bool] | None = None
    # (target, x) -> index of the row to fly to, if there are more rows than targets
    row_ahead: Callable[[int, np.ndarray], int] | None = None
    # (target, x, T) -> controls (T, n_u) that a fraction of the samples perturbs instead of rest
    guide: Callable[[int, np.ndarray, int], np.ndarray] | None = None

    def __post_init__(self) -> None:
        self._check_types()
        self._check_names("terms", self.term_names)
        self._check_names("weights and parameters", self.number_names)

    def _check_types(self) -> None:
        """Raise ValueError if a field is of another type than its annotation."""
        if not isinstance(self.terms, tuple) or not all(isinstance(t, Term) for t in self.terms):
            others = self.terms
            if isinstance(others, tuple):
                others = next(t for t in others if not isinstance(t, Term))
            self._refuse("terms", "a tuple of Term objects", others)
        for name in ("reached", "crash", "risk", "still_in_gate", "row_ahead", "guide"):
            function = getattr(self, name)
            if not (function is None or callable(function)):
                self._refuse(name, "a function or None", function)
        for name, is_record in (("row", is_record_type), ("params", is_record_of_numbers)):
            if not is_record(getattr(self, name)):
                wanted = "a NamedTuple's class" if name == "row" else "a NamedTuple of numbers"
                self._refuse(name, wanted, getattr(self, name))
        columns = len(self.row._fields)
        targets = self.targets
        is_table = isinstance(targets, np.ndarray) and targets.dtype.kind in "fiu"
        if not is_table or targets.shape[1:] != (columns,) or not len(targets):
            self._refuse("targets", f"an array (targets, {columns}) of at least one row", targets)
        if not (self.obstacles is None or isinstance(self.obstacles, Obstacles)):
            self._refuse("obstacles", "Obstacles or None", self.obstacles)

    def _refuse(self, field: str, wanted: str, found: object) -> NoReturn:
        """Raise the ValueError of a field."""
        problem = f"expected {wanted}, got {shown_value(found)}"
        raise ValueError(f"cost {self.name}: {field}: {problem}")

    def _check_names(self, what: str, names: Sequence[str]) -> None:
        """Raise ValueError if two of the names are equal."""
        twice = [name for name in names if names.count(name) > 1]
        if twice:
            raise ValueError(
                f"cost {self.name}: expected {what} of different names, got two named {twice[0]!r}"
            )

    @property
    def term_names(self) -> tuple[str, ...]:
        """The names of the terms, in order."""
        return tuple(term.name for term in self.terms)

    @property
    def crash_term(self) -> int:
        """The index of the term that counts the steps after a crash.

        Raises:
            ValueError: there is no such term.
        """
        for k, term in enumerate(self.terms):
            if term.function is crash:
                return k
        raise ValueError(
            f"cost {self.name}: expected a term of quadsim.controllers.costs.crash, "
            "as it has obstacles"
        )

    @cached_property
    def number_names(self) -> tuple[str, ...]:
        """The names of the numbers that the compiled loops take: weights, then parameters."""
        names = [number_name(term.name, "weight") for term in self.terms]
        names += [f"p_{name}" for name in self.params._fields]
        for term in self.terms:
            if term.parameters:
                names += [number_name(term.name, name) for name in term.parameters._fields]
        return tuple(names)

    @cached_property
    def number_index(self) -> dict[str, int]:
        """The index of each of these numbers, by its name."""
        return {name: k for k, name in enumerate(self.number_names)}

    def numbers(
        self,
        horizon: int,
        given: Mapping[str, Weight] | None = None,
        lengths: Sequence[int] = (),
    ) -> np.ndarray:
        """Return weights and parameters as the compiled loops take them.

        Args:
            horizon: T.
            given: values in place of the cost's own, by the names of number_names; None: there are
                none.
            lengths: of the steps, in control periods; (): they are equal.

        Returns:
            (1, n), or (T, n) if one of them depends on the step of the horizon.

        Raises:
            ValueError: the length of an array differs from the horizon.
        """
        columns = {k: self._numbers[k] for k in self._by_step}
        for name, value in (given or {}).items():
            columns[self.number_index[name]] = value
        amounts = [
            k for k, term in enumerate(self.terms) if lengths and isinstance(term, AmountTerm)
        ]
        for k in amounts:
            columns[k] = np.divide(columns.get(k, self._numbers[k]), lengths)
        if not columns:
            return np.array([self._numbers], float)
        rows = np.empty((horizon, len(self._numbers)))
        rows[:] = self._constants
        for k, value in columns.items():
            if np.shape(value) not in ((), (horizon,)):
                name = self.number_names[k]
                raise ValueError(
                    f"cost {self.name}: {name}: expected one number or one for each of "
                    f"{horizon} steps, got shape {np.shape(value)}"
                )
            rows[:, k] = value
        return rows

    def with_numbers(self, given: Mapping[str, Weight]) -> Cost:
        """Return the cost with other weights and parameters.

        Args:
            given: values by the names of number_names. A term of weight zero keeps it, as it is
                left out of the rollouts.
        """
        if not given:
            return self
        terms = []
        for term in self.terms:
            weight = term.weight
            if np.any(weight):
                weight = given.get(number_name(term.name, "weight"), weight)
            own = term.parameters._asdict() if term.parameters else {}
            numbers = {name: given.get(number_name(term.name, name), own[name]) for name in own}
            terms.append(term.but(weight, **numbers))
        values = zip(self.params._fields, self.params, strict=True)
        shared = (given.get(f"p_{name}", value) for name, value in values)
        return replace(self, terms=tuple(terms), params=self.params._make(shared))

    def over(self, lengths: Sequence[int]) -> Cost:
        """Return the cost for steps of these lengths, in control periods.

        Args:
            lengths: of the steps; (): they are equal.
        """
        if not lengths:
            return self
        terms = (
            term.but(np.divide(term.weight, lengths)) if isinstance(term, AmountTerm) else term
            for term in self.terms
        )
        return replace(self, terms=tuple(terms))

    @cached_property
    def _numbers(self) -> list[float | np.ndarray]:
        """The weights and parameters, in the order of number_names."""
        numbers: list[float | np.ndarray] = [term.weight for term in self.terms]
        numbers += self.params
        for term in self.terms:
            numbers += term.parameters or ()
        return numbers

    @cached_property
    def _by_step(self) -> list[int]:
        """The indices of the numbers that depend on the step of the horizon."""
        return [k for k, value in enumerate(self._numbers) if np.ndim(value)]

    @cached_property
    def _constants(self) -> np.ndarray:
        """The numbers, with zeros for the ones that depend on the step.  (n,)"""
        numbers = [0.0 if np.ndim(value) else value for value in self._numbers]
        return np.array(numbers, float)

    def targets_from(self, target: int, x: np.ndarray, dtype: type = np.float32) -> np.ndarray:
        """Return the target rows from the current one on.

        Distance and time to go count from the current target, which keeps the numbers small.

        Args:
            target: number of targets reached so far.
            x: state  (n_x,).
            dtype: type of the rows.

        Returns:
            (rows, n_target)

        Raises:
            ValueError: row_ahead returns no index of a row.
        """
        nearest = self.row_ahead or self._row
        first = nearest(target, x)
        if not isinstance(first, int | np.integer) or not 0 <= first < len(self.targets):
            wanted = f"the index of one of {len(self.targets)} rows"
            self._refuse("row_ahead", wanted, first)
        rows = np.array(self.targets[first:], dtype=dtype)
        for name in TO_GO:
            if name in self.row._fields:
                to_go = self.row._fields.index(name)
                rows[:, to_go] -= rows[0, to_go]
        return rows

    def _row(self, target: int, x: np.ndarray) -> int:
        """Return the index of the current row if there is one row for each target."""
        target = min(target, len(self.targets) - 1)
        if target == 0 or self.still_in_gate is None:
            return target
        before = target - 1
        return before if self.still_in_gate(x, self.targets[before]) else target


class Evaluated(NamedTuple):
    """A cost at one step of one sample, or of an array of samples."""

    terms: dict[str, Any]  # name -> weight times value
    reached: Any
    crashed: Any


def evaluate(
    cost: Cost,
    x: Sequence,
    x_next: Sequence,
    u: Sequence,
    target: Sequence,
    crashed: Any = 0.0,
    t: int | np.ndarray = 0,
) -> Evaluated:
    """Return the weighted terms of one step, by the functions that the rollouts inline.

    Args:
        cost: the cost; its terms of weight zero are returned too.
        x, x_next: records of the system's state, of numbers or of arrays.
        u: record of the control.
        target: a target row's numbers.
        crashed: the sample's crash flag before the step.
        t: step of the horizon, if parameters depend on it; an array, if the records hold arrays
            over several steps.
    """
    gate = cost.row._make(target)
    shared = at_step(cost.params, t)
    if cost.crash:
        certain = np.maximum(crashed, 1.0) if cost.risk else 1.0
        crashed = np.where(cost.crash(x, x_next, u, gate, shared), certain, crashed)
    if cost.risk:
        crashed = crashed + cost.risk(x, x_next, u, gate, shared)
    terms = {}
    for term in cost.terms:
        if term.function is crash:
            value = crashed
        else:
            own = at_step(term.parameters, t) if term.parameters else shared
            value = term.value(x, x_next, u, gate, own)
        terms[term.name] = number_at_step(term.weight, t) * value
    reached = cost.reached(x, x_next, u, gate, shared) if cost.reached else False
    return Evaluated(terms, reached, crashed)


def at_step(parameters: NumberTuple, t: int | np.ndarray) -> Any:
    """Return parameters at step t of the horizon, by the same names."""
    return parameters._make(number_at_step(value, t) for value in parameters)


def number_at_step(value: Weight, t: int | np.ndarray) -> Any:
    """Return a weight or parameter at step t of the horizon.

    A number is returned as it is; an array (T,) is indexed by t.
    """
    return value if np.ndim(value) == 0 else np.asarray(value)[t]
