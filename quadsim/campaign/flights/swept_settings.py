"""A sweep changes one setting, or one number of the vehicle or of a sensor.

    link_hz                               a setting of `race fly`
    latency                               the one setting whose name ends in it, link_latency
    vehicle.mass                          a number of the vehicle, vehicle.rotors.motor_tau too
    sensing.camera.noise                  a number of a sensor
    sensing.camera.fx+sensing.camera.fy   several that take the same value, 320 425, or one each,
                                          320/320 425/424; together they may make a sensor

The planner's model follows the vehicle. What the planner does not know is a number of its model:
model_thrust_gain 1 1.1 flies a planner that expects a tenth more of each thrust than it gets.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from quadsim.campaign.run.variants import Variant
from quadsim.config.setting_texts import (
    Place,
    Settings,
    parse_part,
    resolve,
    sampler_of,
    settings_of_other_samplers,
    with_shared,
)
from quadsim.config.settings import SETTINGS, SettingError
from quadsim.config.spec import Spec
from quadsim.files.yaml_errors import did_you_mean, shown_value
from quadsim.sensing import PERFECT, Sensing, load_sensing

DEFAULT = "default"  # text of a value: the setting is not given
LINKED = "+"  # joins the names of settings that change together
EACH = "/"  # joins the values that each of them takes
# Parts of a flight whose numbers can be swept, as "vehicle.mass"
PARTS = ("vehicle", "sensing")
FEWEST_VALUES = 2


class SweptValue(NamedTuple):
    """A step of a sweep: its label, and the value of each setting that changes."""

    label: str  # as tables and figures show it
    # What each setting is given, a text for it, or None for its default
    values: tuple[Any, ...]


class SweptSetting(NamedTuple):
    """A setting, or several that change together, and the values that it takes in turn."""

    names: tuple[str, ...]
    values: tuple[SweptValue, ...]

    @property
    def name(self) -> str:
        """The name in tables and figures."""
        return LINKED.join(self.names)

    @property
    def title(self) -> str:
        """The name with its unit, if it has one; joined names have it if they share it."""
        units = {SETTINGS[name].unit if name in SETTINGS else "" for name in self.names}
        unit = units.pop() if len(units) == 1 else ""
        return f"{self.name} [{unit}]" if unit else self.name


def swept_settings(over: Mapping[str, Sequence[Any]]) -> list[SweptSetting]:
    """Return the settings that a sweep changes.

    Args:
        over: the values of each setting by its name, two or more. A value may be the text that
            a variant has for it, None or "default" for the setting's default. Settings that
            change together take the same value, or one each of a text such as ".13/5".

    Raises:
        SettingError: a name is no setting, or the values are too few or not different.
    """
    if not over:
        raise _wrong("expected a setting and its values, got none")
    found: dict[str, SweptSetting] = {}
    for given, values in over.items():
        names = tuple(_full_name(name) for name in given.split(LINKED))
        swept = SweptSetting(names, _values(names, values))
        if swept.name in found:
            raise _wrong(f"expected different settings, got {swept.name} twice")
        found[swept.name] = swept
    return list(found.values())


def _full_name(given: str) -> str:
    """Return the full name of a setting that is given by its name or by a unique end of it."""
    name = given.strip().replace("-", "_")
    part, dot, number = name.partition(".")
    if dot and part in PARTS and number:
        return name
    if name in SETTINGS:
        return name
    ending = [setting for setting in SETTINGS if setting.endswith(f"_{name}")]
    if len(ending) == 1:
        return ending[0]
    near = did_you_mean(name, [*SETTINGS, *ending])
    raise _wrong(f"no setting {given!r} (a number of a part is vehicle.mass, say): {near}")


def _values(names: tuple[str, ...], values: Any) -> tuple[SweptValue, ...]:
    """Return the values of a setting, or of several that change together.

    Raises:
        SettingError: there are too few of them, two are the same, or there is none for a setting.
    """
    name = LINKED.join(names)
    is_list = isinstance(values, Sequence) and not isinstance(values, str)
    if not is_list or len(values) < FEWEST_VALUES:
        wanted = f"{name}: expected {FEWEST_VALUES} values or more"
        raise _wrong(f"{wanted}, got {shown_value(values)}")
    found = tuple(SweptValue(_label(value), _of_each(names, value)) for value in values)
    labels = [value.label for value in found]
    repeated = next((label for label in labels if labels.count(label) > 1), None)
    if repeated is not None:
        raise _wrong(f"{name}: expected different values, got {repeated} twice")
    return found


def _of_each(names: tuple[str, ...], value: Any) -> tuple[Any, ...]:
    """Return the value of each setting at one step of a sweep.

    Raises:
        SettingError: the value is a text with values for more or fewer settings.
    """
    parts: list[Any] = [value] * len(names)
    if len(names) > 1 and isinstance(value, str) and EACH in value:
        parts = value.split(EACH)
        if len(parts) != len(names):
            wanted = f"expected one value, or {len(names)} joined by {EACH}"
            raise _wrong(f"{LINKED.join(names)}: {wanted}, got {value}")
    return tuple(_parsed(name, part) for name, part in zip(names, parts, strict=True))


def _label(value: Any) -> str:
    """Return a value as tables show it."""
    if value is None:
        return DEFAULT
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:g}"
    if isinstance(value, list | tuple):
        return ":".join(map(_label, value))
    name = getattr(value, "name", None)  # of a Vehicle, a Sensing
    return name if isinstance(name, str) else str(value)


def _parsed(name: str, value: Any) -> Any:
    """Return a value in the type of its setting."""
    if value is None or value == DEFAULT:
        return None
    if not isinstance(value, str):
        return value
    if "." in name:
        return _number(value)
    _, parsed = parse_part(f"{name}={value}")
    return parsed


def _number(text: str) -> Any:
    """Return the number or the numbers of a text, or the text."""
    if ":" in text:
        return [_number(each) for each in text.split(":")]
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


def swept_variant(
    course: Place,
    name: str,
    own: Settings,
    shared: Settings,
    swept: SweptSetting,
    value: SweptValue,
) -> Variant:
    """Return a variant at one value of a sweep.

    Args:
        course: a name, a file or a course.
        name: name of the variant.
        own: settings of the variant.
        shared: settings of all variants.
        swept: the swept setting.
        value: its value.

    Raises:
        SettingError: a setting is invalid, or the variant has a value of its own, or its sampler
            lacks the setting.
        FileError: a file cannot be read.
        ValueError: course, laps and vehicle do not fit together.
    """
    given = dict(zip(swept.names, value.values, strict=True))
    plain = {each: number for each, number in given.items() if "." not in each}
    for each in plain:
        if each in own:
            raise _wrong(f"{each}: expected variants without a value of their own, got {name}")
    lacking = plain.keys() & settings_of_other_samplers(sampler_of(own, shared))
    if lacking:
        problem = f"{min(lacking)}: expected variants whose sampler has it, got {name}"
        raise _wrong(f"{problem}: leave it out")
    # A setting without a value has its default, whatever the variants share.
    others = {each: number for each, number in shared.items() if each not in plain}
    changed = {each: number for each, number in plain.items() if number is not None}
    settings = with_shared(own, others | changed)
    numbers = {each: number for each, number in given.items() if "." in each and number is not None}
    if numbers:
        settings |= _with_numbers(course, settings, numbers)
    return Variant(f"{name}+{swept.name}={value.label}", resolve(course, settings))


def remarks_on_gamma(swept: SweptSetting, variants: Sequence[Variant]) -> Iterator[str]:
    """Yield a remark if an exponent of the noise is swept under a cut-off.

    Args:
        swept: the swept settings.
        variants: one variant at each of the values.
    """
    if "gamma" not in swept.names or "cutoff" in swept.names:
        return
    samplings = [variant.spec.planner.sampling for variant in variants]
    cutoffs = [cutoff for each in samplings for cutoff in getattr(each, "cutoff", ()) if cutoff]
    if cutoffs:
        yield (
            f"gamma: the cut-off of {min(cutoffs):g} Hz stays, above which the spectrum falls at "
            "any gamma, so that gamma 0 is not white; --cutoff none takes it away."
        )


def _with_numbers(course: Place, settings: Settings, numbers: Mapping[str, Any]) -> dict[str, Any]:
    """Return the settings that change numbers of the vehicle or of sensors.

    Args:
        course: a name, a file or a course.
        settings: settings of the flight.
        numbers: numbers by names such as "vehicle.mass" and "sensing.camera.noise".

    Raises:
        SettingError: the flight has no such number, or it cannot be used.
    """
    spec = Spec.of(course, **settings)
    changes: dict[str, dict[str, Any]] = {}
    for name, value in numbers.items():
        part, *keys, last = name.split(".")
        of_part = changes.setdefault(part, {})
        for key in keys:
            of_part = of_part.setdefault(key, {})
        of_part[last] = value
    _expect_sensors(spec.sensing, changes.get("sensing", {}))
    found: dict[str, Any] = {}
    for part, changed in changes.items():
        # A flight on the true state has no sensing.
        base = getattr(spec, part) or load_sensing(PERFECT)
        try:
            found[part] = base.but(**changed)
        except SettingError as error:
            raise _wrong(f"{part}.{error.name}: {error.problem}") from None
    if "vehicle" in found:
        # The ratio has been applied to the vehicle that is changed.
        found["thrust_to_weight"] = None
    return found


def _expect_sensors(sensing: Sensing | None, changes: Mapping[str, Any]) -> None:
    """Check that a flight has the sensors whose numbers are changed.

    Several numbers that change together may make a sensor that the flight lacks.

    Args:
        sensing: the sensors of the flight; None: it has the true state.
        changes: the numbers of each sensor.

    Raises:
        SettingError: the flight lacks a sensor.
    """
    for sensor, numbers in changes.items():
        makes = isinstance(numbers, Mapping) and len(numbers) > 1
        if getattr(sensing, sensor, None) is None and not makes:
            wanted = f"expected a flight on sensors with {sensor} (--sensing)"
            held = sensing.name if sensing else "the true state"
            number = f".{next(iter(numbers))}" if isinstance(numbers, Mapping) else ""
            raise _wrong(f"sensing.{sensor}{number}: {wanted}, got {held}")


def _wrong(problem: str) -> SettingError:
    return SettingError("over", problem)
