"""The user's own objects in a flight: how they are found, checked, called and recorded.

They are a sampler, terms, a cost, a plant, a controller and a referee. A flight checks what they
return, so that an error names the part, what was expected and what came. A run stores their names,
the numbers that they hold and a hash that tells them from others, not their code.

A flight without parts of the user's own uses nothing of this module.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from importlib import import_module
from inspect import Parameter, signature
from math import isfinite
from numbers import Real
from types import FunctionType
from typing import Any, cast

import numpy as np

from quadsim.config.identity import IdentityError, error_text, identity_of
from quadsim.config.settings import SettingError
from quadsim.controllers.costs import Term, Weight, is_weight
from quadsim.controllers.plan import PlanStats
from quadsim.controllers.samplers import SAMPLERS, PlainSampler, Sampling
from quadsim.dynamics.estimate import Estimate
from quadsim.dynamics.quadrotor import State
from quadsim.files.plain_values import Json, plain, qualified_name
from quadsim.files.yaml_errors import did_you_mean, shown_value
from quadsim.firmware.process import FirmwareError
from quadsim.physics.plant_state import PlantState
from quadsim.racing.events import Event
from quadsim.rotation import Vec3

Sampler = Sampling | PlainSampler
# role of the user's own object -> the method that it needs
METHODS = {"plant": "step", "controller": "control", "referee": "observe"}
WANTED_TERMS = "expected terms=[(function, weight), ...] or quadsim.controllers.costs.Term objects"
WANTED_SAMPLER = "expected a sampler: an object with sample(rng, samples, horizon, controls)"
# How a role is given otherwise, for an error in its maker
ADVICE = {
    "controller": "; give a control law as an object with control(x), and a policy as"
    " quadsim.PolicyController(policy)"
}
# Kinds of parameters that take an argument by its place
BY_PLACE = (Parameter.POSITIONAL_ONLY, Parameter.POSITIONAL_OR_KEYWORD)
# The errors that a user's own module may end in when it is imported.
UNIMPORTABLE = (Exception, SystemExit)
# The outcomes that a referee may give.
OUTCOMES = ("finished", "crashed", "stuck", "timeout")
# Largest number of a control; beyond it the vehicle's equations overflow.
LARGEST = 1e9
# Largest count of a referee
MOST = 10**9
# Shortest and longest physics step of a plant [s]
SHORTEST_STEP = 1e-6
LONGEST_STEP = 1.0
# A physics step may differ from the plant's dt by this share of it.
UNEVEN = 0.5


# How parts are found.


def own_sampler(given: object) -> Sampler:
    """Return the user's own sampler, given as an object or as "package.module:Class".

    Raises:
        SettingError: there is no such sampler.
    """
    found = given
    if isinstance(given, str):
        if ":" not in given:
            raise SettingError("sampler", f"no sampler {given!r}: {did_you_mean(given, SAMPLERS)}")
        wanted = f"expected package.module:Class without arguments, got {given!r}"
        found = _imported("sampler", given, wanted)
        if isinstance(found, type):
            try:
                found = found()
            except UNIMPORTABLE as error:
                raise SettingError("sampler", f"{wanted}: {_reason(error)}") from None
    if isinstance(found, type) or not callable(getattr(found, "sample", None)):
        raise SettingError("sampler", f"{WANTED_SAMPLER}, got {shown_value(found)}")
    return cast(Sampler, found)


def own_controller(given: object) -> Any:
    """Return a controller, or its maker, given as an object or as "package.module:Class".

    Raises:
        SettingError: there is no such controller.
    """
    if not isinstance(given, str):
        return given
    wanted = f"expected package.module:Class, got {given!r}"
    if ":" not in given:
        raise SettingError("controller", wanted)
    found = _imported("controller", given, wanted)
    if isinstance(found, type) and not _has_method("controller", found):
        problem = f"the class has no method {METHODS['controller']!r}"
        raise SettingError("controller", f"{wanted}: {problem}")
    check_part("controller", found)
    return found


def term_of_text(text: str) -> Term:
    """Return the term that "package.module:function=WEIGHT" names. Raises SettingError."""
    place, has_weight, weight = text.rpartition("=")
    wanted = f"expected package.module:function=WEIGHT, got {text!r}"
    if not has_weight:
        raise SettingError("term", f"{wanted}: the weight is missing, as in {text}=1")
    function = _imported("term", place, wanted)
    try:
        number = float(weight)
    except ValueError as error:
        raise SettingError("term", f"{wanted}: {_reason(error)}") from None
    if not callable(function) or not isfinite(number):
        raise SettingError("term", wanted)
    return _named_term("term", function, number)


def terms_of(objects: object) -> tuple[Term, ...]:
    """Return the cost terms of a list of Term objects and pairs (function, weight).

    Raises:
        SettingError: the objects are anything else.
    """
    if not isinstance(objects, tuple | list):
        raise SettingError("terms", f"{WANTED_TERMS}, got {shown_value(objects)}")
    return tuple(_term(term) for term in objects)


def _term(given: object) -> Term:
    """Return one term. Raises SettingError."""
    if isinstance(given, Term):
        return given
    if not isinstance(given, tuple | list) or len(given) != 2 or not callable(given[0]):
        raise SettingError("terms", f"{WANTED_TERMS}, got {shown_value(given)}")
    function, weight = given
    if not is_weight(weight):
        wanted = f"{WANTED_TERMS} with a finite weight"
        problem = f"{wanted}, got {shown_value(weight)} for {shown_value(function)}"
        raise SettingError("terms", problem)
    return _named_term("terms", function, float(weight) if np.ndim(weight) == 0 else weight)


def _named_term(setting: str, function: Any, weight: Weight) -> Term:
    """Return a term of a function, which has a name. Raises SettingError."""
    try:
        return Term(function, weight)
    except ValueError as error:
        raise SettingError(setting, str(error)) from None


def _imported(setting: str, text: str, wanted: str) -> Any:
    """Return the object that "package.module:name" names.

    Raises:
        SettingError: there is no such object; the message begins with `wanted`.
    """
    module, _, name = text.partition(":")
    try:
        return getattr(import_module(module), name)
    except UNIMPORTABLE as error:
        raise SettingError(setting, f"{wanted}: {_reason(error)}") from None


def _reason(error: BaseException) -> str:
    """Return the text of an error on one line, with its type if that says more."""
    text = " ".join(str(error).split())
    if isinstance(error, ModuleNotFoundError):
        text += ", in this folder or the environment (PYTHONPATH)"
    is_plain = isinstance(error, ImportError | AttributeError | TypeError | ValueError)
    return text if is_plain and text else f"{type(error).__name__} {text}".rstrip()


def check_part(role: str, part: object) -> None:
    """Check that the user's plant, controller or referee has the method that its role needs.

    Args:
        role: one of METHODS.
        part: an object with that method, or a maker, see `is_maker`.

    Raises:
        SettingError: the part is neither.
    """
    if not (is_maker(role, part) or _has_method(role, part)):
        wanted = f"expected an object with {METHODS[role]!r}, or a function that makes one"
        raise SettingError(role, f"{wanted}, got {shown_value(part)}")


def _has_method(role: str, part: object) -> bool:
    return callable(getattr(part, METHODS[role], None))


# How makers are called.


def is_maker(role: str, part: object) -> bool:
    """Return whether a part is called to make the object of its role for a flight.

    A maker is a class, or anything else that can be called and lacks the method of the role: a
    function, a bound method, a functools.partial or an object with `__call__`.
    """
    return isinstance(part, type) or (callable(part) and not _has_method(role, part))


def made(role: str, part: Any, spec: object) -> Any:
    """Return the part itself, or the object that its maker makes for this flight.

    A maker is called with the Spec, unless it can be called without arguments and none of its
    parameters is named `spec`.

    Args:
        role: one of METHODS.
        part: the part, or its maker.
        spec: the Spec.

    Raises:
        SettingError: a maker returns an object without the method of its role.
    """
    if not is_maker(role, part):
        return part
    found: Any = _make(role, part, spec)
    # What was made may be a maker itself, such as a quadsim.PolicyController.
    if is_maker(role, found) and not isinstance(found, type):
        found = _make(role, found, spec)
    if isinstance(found, type) or not _has_method(role, found):
        wanted = f"expected {shown_value(part)} to return an object with {METHODS[role]!r}"
        raise SettingError(role, f"{wanted}, got {shown_value(found)}")
    return found


def _make(role: str, maker: Callable[..., object], spec: object) -> object:
    """Return what a maker makes for a flight. An error of its own lines says why it was called."""
    given = [spec] if _takes_spec(maker) else []
    try:
        return called(role, maker, "the Spec", *given)
    except (TypeError, AttributeError) as error:
        what = "a Spec" if given else "nothing"
        error.add_note(
            f"{role}: {shown_value(maker)} was called with {what}, to make an object with"
            f" {METHODS[role]!r}{ADVICE.get(role, '')}"
        )
        raise


def _takes_spec(maker: Callable[..., object]) -> bool:
    """Return whether a maker is called with the Spec, see `made`."""
    try:
        parameters = signature(maker).parameters.values()
    except (TypeError, ValueError):  # one of C
        return True
    return any(
        one.kind is one.VAR_POSITIONAL
        or one.name == "spec"
        or (one.kind in BY_PLACE and one.default is one.empty)
        for one in parameters
    )


def called(role: str, function: Callable[..., Any], name: str, *arguments: object) -> Any:
    """Return what the user's function returns.

    Args:
        role: the setting that the function was given for.
        function: the function.
        name: of the arguments, for the error.
        arguments: the arguments.

    Raises:
        SettingError: the function cannot be called with these arguments. What the user's own lines
            raise is not changed.
    """
    try:
        return function(*arguments)
    except TypeError as error:
        # An error of the call itself, or of a function of C, comes from no further line of Python.
        if error.__traceback__ is not None and error.__traceback__.tb_next is not None:
            raise
        wanted = f"expected a function of {name}, got {shown_value(function)}"
        raise SettingError(role, f"{wanted}: {error}") from None


# What parts return in a flight. A check takes some microseconds, a plan takes milliseconds.


class OwnController:
    """A controller of the user's own, or a control law, in a flight that checks its controls."""

    def __init__(self, inner: Any, rest: Sequence[float]):
        """Take a controller.

        Args:
            inner: a Controller, or a ControlLaw, which has no `rest`.
            rest: the control that acts until the first one of a law is ready  (n_u,).

        Raises:
            SettingError: the controller's `rest` is no control.
        """
        self._inner = inner
        self._controls = len(rest)
        self._is_law = not hasattr(inner, "rest")
        self.rest = self._checked("rest", rest if self._is_law else inner.rest)

    def control(self, estimate: Estimate, /) -> tuple[np.ndarray, PlanStats]:
        """Return the control from now on and its statistics, which are empty for a law.

        Raises:
            SettingError: the controller returns anything else.
        """
        if self._is_law:
            return self._checked("control", self._of_law(estimate.x)), PlanStats(0.0, 0.0, 0.0)
        answer = self._inner.control(estimate)
        match answer:
            case (u, PlanStats(cost=Real(), ess=Real(), temperature=Real()) as stats):
                return self._checked("control", u), stats
        raise self._error("control", "a control and its PlanStats of three numbers", answer)

    def _of_law(self, x: np.ndarray) -> object:
        """Return what a law returns at a state."""
        try:
            return self._inner.control(x)
        except AttributeError as error:
            if isinstance(error.obj, np.ndarray):
                error.add_note(
                    "controller: control() is given the state x, an array, as the controller has no"
                    " `rest`; one that has it is given an Estimate, with x, t and target"
                )
            raise

    def _checked(self, member: str, given: object) -> np.ndarray:
        """Return a control as an array of float  (n_u,). Raises SettingError for another shape."""
        try:
            u = np.asarray(given)
        except ValueError:  # lists of different lengths
            u = np.array(None)
        is_row = u.dtype.kind in "fiu" and u.shape == (self._controls,)
        # A number that is not finite fails this comparison too.
        if is_row and (abs(u) <= LARGEST).all():
            return u.astype(float, copy=False)
        wanted = f"a control of {self._controls} numbers within +-{LARGEST:g}"
        raise self._error(member, wanted, given)

    def _error(self, member: str, wanted: str, got: object) -> SettingError:
        return _wrong("controller", self._inner, member, wanted, shown_value(got))


class OwnPlant:
    """A plant of the user's own, in a flight that checks its states and names their numbers.

    The states of a user's plant may be plain tuples of 17 numbers in the order of `State`. Sensors
    and records read numbers by name, so a tuple becomes a `State`.
    """

    def __init__(self, inner: Any):
        """Take a plant.

        Raises:
            SettingError: a member of the plant is missing or no number, or its state is no state.
        """
        self._inner = inner
        for member in ("dt", "state", "step", "close"):
            if not hasattr(inner, member):
                problem = f"{type(inner).__name__}: expected a member {member!r}, got none"
                raise SettingError("plant", problem)
        self.dt = inner.dt
        if not (_is_finite(self.dt) and SHORTEST_STEP <= self.dt <= LONGEST_STEP):
            wanted = f"a number [s] >= {SHORTEST_STEP:g} and <= {LONGEST_STEP:g}"
            raise self._error("dt", wanted, shown_value(self.dt))
        self.velocity_lag = getattr(inner, "velocity_lag", 0.0)
        if not _is_finite(self.velocity_lag):
            raise self._error("velocity_lag", "a finite number [s]", shown_value(self.velocity_lag))
        self.state = self._checked("state", inner.state)

    def step(self, u: Sequence[float]) -> PlantState[State]:
        """Advance by one physics step under a command in the order of Control  (4,).

        Raises:
            SettingError: the state after the step is no state, or not dt later, so that the flight
                might never end.
        """
        before = self.state.t
        after = self._checked("step", self._inner.step(u))
        if not abs(after.t - before - self.dt) <= UNEVEN * self.dt:
            wanted = f"a state {self.dt:g} s after t = {before:g}"
            raise self._error("step", wanted, f"t = {after.t!r}")
        self.state = after
        return after

    def close(self) -> None:
        """Release the resources of the plant."""
        self._inner.close()

    def _checked(self, member: str, given: Any) -> PlantState[State]:
        """Return a state with its numbers by name. Raises SettingError."""
        if not isinstance(given, PlantState):
            wanted = "a quadsim.physics.plant.PlantState"
            raise self._error(member, wanted, shown_value(given))
        if not _is_finite(given.t):
            raise self._error(member, "a finite time t [s]", shown_value(given.t))
        contacts = given.contacts
        if not (isinstance(contacts, tuple | list) and all(isinstance(c, str) for c in contacts)):
            raise self._error(member, "contacts of texts", shown_value(contacts))
        wanted = f"a state of {len(State._fields)} finite numbers"
        try:
            x = tuple(given.x)
        except TypeError:
            raise self._error(member, wanted, shown_value(given.x)) from None
        if len(x) != len(State._fields):
            raise self._error(member, wanted, str(len(x)))
        for name, number in zip(State._fields, x, strict=True):
            if not _is_finite(number):
                raise self._error(member, wanted, f"{name} = {shown_value(number)}")
        return given if isinstance(given.x, State) else PlantState(given.t, State(*x), contacts)

    def _error(self, member: str, wanted: str, got: str) -> SettingError:
        return _wrong("plant", self._inner, member, wanted, got)


class OwnReferee:
    """A referee of the user's own, in a flight that checks its events, outcome and counts."""

    outcome: str | None
    passed: int
    lap: int
    next_gate: int

    def __init__(self, inner: Any):
        """Take a referee. Raises SettingError if it has no outcome or no counts."""
        self._inner = inner
        self._read()

    def observe(
        self, t0: float, p0: Vec3, t1: float, p1: Vec3, contacts: Sequence[str] = ()
    ) -> list[Event]:
        """Return the events of a physics step, see quadsim.racing.flight.RefereeProtocol.

        Raises:
            SettingError: the referee returns anything else, or has an invalid outcome or count.
        """
        found = self._inner.observe(t0, p0, t1, p1, contacts)
        if not (isinstance(found, list) and all(isinstance(event, Event) for event in found)):
            raise self._error("observe", "a list of events", found)
        self._read()
        return found

    def _read(self) -> None:
        """Read the outcome and the counts. Raises SettingError."""
        for name in ("passed", "lap", "next_gate"):
            number = getattr(self._inner, name, None)
            if not isinstance(number, int | np.integer) or not 0 <= number <= MOST:
                raise self._error(name, f"a whole number of 0 to {MOST:g}", number)
            setattr(self, name, number)
        self.outcome = getattr(self._inner, "outcome", "")
        is_text = isinstance(self.outcome, str)
        if not (self.outcome is None or (is_text and self.outcome in OUTCOMES)):
            raise self._error("outcome", f"None or one of {', '.join(OUTCOMES)}", self.outcome)

    def _error(self, member: str, wanted: str, got: object) -> SettingError:
        return _wrong("referee", self._inner, member, wanted, shown_value(got))


def _wrong(role: str, part: object, member: str, wanted: str, got: str) -> SettingError:
    """Return the error of a part that returns something else than expected."""
    return SettingError(role, f"{type(part).__name__}.{member}: expected {wanted}, got {got}")


def _is_finite(number: object) -> bool:
    try:
        return isinstance(number, Real) and not isinstance(number, bool) and isfinite(number)
    except OverflowError:  # a whole number beyond the range of float
        return False


# What a run says of them, and of their errors.


def describe(part: object) -> dict[str, Json]:
    """Return {class, parameters, sha256} of one of the user's own objects.

    The hash comes from `identity_of`; it is None for an object without an identity.
    """
    is_code = isinstance(part, type | FunctionType)
    values = {} if is_code else getattr(part, "__dict__", {})
    return {
        "class": qualified_name(part if is_code else type(part)),
        "parameters": {name: plain(value) for name, value in values.items()},
        "sha256": _identity(part),
    }


def describe_term(term: Term) -> dict[str, Json]:
    """Return {name, function, weight, parameters, sha256} of a term."""
    record: Any = term.parameters
    return {
        "name": term.name,
        "function": qualified_name(term.function),
        "weight": plain(term.weight),
        "parameters": plain(record._asdict() if record else {}),
        "sha256": _identity(term),
    }


def _identity(part: object) -> str | None:
    """Return the identity of an object, None if it has none."""
    try:
        return identity_of(part)
    except IdentityError:
        return None


def runs_own_code(roles: Iterable[str]) -> bool:
    """Return whether parts of the user's own are called in flight: any part but a course.

    Args:
        roles: the roles of a flight's own parts.
    """
    return any(role != "course" for role in roles)


def fault_in_flight(error: Exception, has_own_parts: bool) -> str | None:
    """Return the text of an error by which a flight has ended as crashed, on one line.

    Args:
        error: what the planner or a part of the user's own has raised in flight.
        has_own_parts: whether the flight has parts of the user's own, which may raise anything.

    Returns:
        The text; None for an error that says nothing of the flight: the firmware has ended, or the
        program has a fault.
    """
    if isinstance(error, FirmwareError):
        return None
    if isinstance(error, ValueError | FloatingPointError):
        return error_text(error)
    if not has_own_parts:
        return None
    text = error_text(error)
    name = type(error).__name__
    return text if text.startswith(f"{name}: ") else f"{name}: {text}"
