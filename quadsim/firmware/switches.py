"""The positions of the switches: in flight ARM is on, and the sticks command rates and thrust.

A mode of the firmware is on while a channel of the transmitter is within a range, or several are,
or another mode is on (quadsim.firmware.translation has read the lines). Pilots put ANGLE at one end
of a switch and rates at the other, so the positions are searched.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import islice, pairwise, product
from typing import NamedTuple

from quadsim.firmware.process import CHANNELS, HIGH, LOW, MIDDLE
from quadsim.firmware.translation import ConfigurationError

FIRST_AUX = 4
AUX = CHANNELS - FIRST_AUX
# The firmware's list of modes: index, mode, channel, range [us], logic, linked mode
PRINTED = re.compile(r"aux (\d+) (\d+) (\d+) (\d+) (\d+) (\d+) (\d+)")
NONE = (0, 0, 900, 900, 0, 0)  # a condition that is not configured
# The firmware takes pulses outside these for them.
LEAST, MOST = 900, 2099
ARM, AIRMODE, PREARM, PARALYZE = 0, 28, 36, 45
# Modes in which the sticks do not command body rates and thrust alone, by number
OTHER_STICKS = {
    1: "ANGLE",
    2: "HORIZON",
    3: "ALTHOLD",
    5: "MAG",
    6: "HEADFREE",
    11: "POS HOLD",
    12: "PASSTHRU",
    27: "FAILSAFE",
    30: "FPV ANGLE MIX",
    35: "FLIP OVER AFTER CRASH",
    PARALYZE: "PARALYZE",
    46: "GPS RESCUE",
    47: "ACRO TRAINER",
    49: "LAUNCH CONTROL",
    50: "MSP OVERRIDE",
    55: "CHIRP",
}
NAMES = OTHER_STICKS | {ARM: "ARM", AIRMODE: "AIR MODE", PREARM: "PREARM"}
EXAMPLE = "aux 0 0 0 1700 2100 0 0"
TRIED = 200_000  # largest number of positions that are tried

Positions = Mapping[int, float]  # {AUX channel from 0: pulse [us]}; others are at LOW


class Condition(NamedTuple):
    """A condition of a mode."""

    mode: int
    channel: int  # AUX channel, from 0
    low: int  # least pulse [us]
    high: int  # [us]; off from here on
    logic: int  # 0: one condition of the mode is enough; 1: each such condition has to hold
    linked: int  # mode that has to be on in place of a range; 0: none
    line: str

    def holds(self, positions: Positions) -> bool:
        """Return whether the channel is within the range."""
        pulse = min(max(positions.get(self.channel, LOW), LEAST), MOST)
        return self.low <= pulse < self.high


class Switches(NamedTuple):
    """The pulses of the AUX channels [us]  (12,), before arming and in flight."""

    idle: tuple[float, ...]
    flight: tuple[float, ...]
    throttle: float = LOW  # pulse at which the firmware takes the throttle as low [us]

    @property
    def pairs(self) -> list[tuple[float, float]]:
        """The pulses of each AUX channel before arming and in flight [us]."""
        return list(zip(self.idle, self.flight, strict=True))

    def channels(self, armed: bool = False) -> list[float]:
        """Return the pulses of all channels, with sticks in the middle and throttle down [us]."""
        return [MIDDLE, MIDDLE, self.throttle, MIDDLE, *(self.flight if armed else self.idle)]


def conditions_of(printed: str) -> list[Condition]:
    """Return the conditions in the firmware's printed list."""
    found = []
    for line in PRINTED.finditer(printed):
        _, *numbers = map(int, line.groups())
        if tuple(numbers) != NONE:
            found.append(Condition(*numbers, line=line[0]))
    return found


def modes_on(conditions: Sequence[Condition], positions: Positions) -> set[int]:
    """Return the modes that are on at these positions, as the firmware decides it."""
    fulfilled: set[int] = set()  # modes with a condition of logic 0 that holds
    asked: set[int] = set()  # modes with conditions of logic 1
    failed: set[int] = set()  # modes of which one of those does not hold

    def is_on(mode: int) -> bool:
        return mode in fulfilled or (mode in asked and mode not in failed)

    # Conditions on ranges come first.
    for condition in sorted(conditions, key=lambda found: found.linked != 0):
        holds = is_on(condition.linked) if condition.linked else condition.holds(positions)
        if condition.logic:
            asked.add(condition.mode)
            if not holds:
                failed.add(condition.mode)
        elif holds:
            fulfilled.add(condition.mode)
    return {condition.mode for condition in conditions if is_on(condition.mode)}


def switches_of(conditions: Sequence[Condition], name: str) -> Switches:
    """Return the positions before arming and in flight.

    In flight ARM is on, PREARM too if it has a switch, and AIR MODE if that can be; no mode is on
    that takes the sticks. Switches that decide none of these stay at their low end.

    Args:
        conditions: conditions of the modes, in the firmware's order.
        name: name of the text, for errors.

    Raises:
        ConfigurationError: there are no such positions.
    """
    conditions = _as_saved(conditions, name)
    modes = {condition.mode for condition in conditions}
    if ARM not in modes:
        raise ConfigurationError(
            f"{name}: expected a switch for ARM, such as {EXAMPLE!r}, got none"
        )
    candidates = _candidates(conditions)
    needed = {ARM, PREARM} & modes
    wished = {AIRMODE} & modes
    off = modes & set(OTHER_STICKS)
    flight = _found(conditions, candidates, needed | wished, off)
    flight = flight or _found(conditions, candidates, needed, off)
    if flight is None:
        raise ConfigurationError(_why_not(conditions, candidates, needed, off, name))

    # Before arming only the switches of ARM are elsewhere.
    of_arm = {condition.channel for condition in _deciding(conditions, {ARM})}
    idle_candidates = {
        channel: pulses if channel in of_arm else [flight[channel]]
        for channel, pulses in candidates.items()
    }
    prearm = {PREARM} & modes
    idle = None
    for on, others in ((prearm, off), (prearm, {PARALYZE}), (set[int](), {PARALYZE})):
        idle = idle or _found(conditions, idle_candidates, on, {ARM} | (others & modes))
    if idle is None:
        lines = ", ".join(repr(c.line) for c in conditions if c.mode == ARM)
        wanted = "expected a position of the switch with ARM off, from which it is armed"
        raise ConfigurationError(f"{name}: {wanted}, got {lines}: correct it")
    return Switches(_pulses(idle), _pulses(flight))


def _as_saved(conditions: Sequence[Condition], name: str) -> list[Condition]:
    """Return the conditions without the modes that the firmware removes as it saves them.

    A mode may follow another mode, but none that follows a third.

    Raises:
        ConfigurationError: ARM follows another mode, for which the firmware removes it.
    """
    following = {condition.mode for condition in conditions if condition.linked}
    removed = {c.mode for c in conditions if c.linked and (c.mode == ARM or c.linked in following)}
    if ARM in removed:
        lines = ", ".join(repr(c.line) for c in conditions if c.mode == ARM and c.linked)
        wanted = "expected ARM to follow no other mode, as Betaflight removes such switches"
        raise ConfigurationError(f"{name}: {wanted}, got {lines}: correct or remove it")
    return [condition for condition in conditions if condition.mode not in removed]


def _pulses(positions: Positions) -> tuple[float, ...]:
    return tuple(float(positions.get(channel, LOW)) for channel in range(AUX))


def _deciding(conditions: Sequence[Condition], modes: Iterable[int]) -> list[Condition]:
    """Return the conditions of some modes, and of the modes that they are linked to."""
    wanted = set(modes)
    while True:
        linked = {c.linked for c in conditions if c.mode in wanted and c.linked}
        if linked <= wanted:
            return [c for c in conditions if c.mode in wanted]
        wanted |= linked


def _candidates(conditions: Sequence[Condition]) -> dict[int, list[float]]:
    """Return pulses for each channel that decides something, the low end first."""
    deciding = [c for c in _deciding(conditions, NAMES) if not c.linked]
    return {
        channel: list(_different([c for c in deciding if c.channel == channel]))
        for channel in sorted({c.channel for c in deciding})
    }


def _different(conditions: Sequence[Condition]) -> Iterator[float]:
    """Yield pulses of a channel at which different conditions hold."""
    channel = conditions[0].channel
    ends = sorted({LEAST, MOST + 1, *(end for c in conditions for end in (c.low, c.high))})
    seen = set()
    for pulse in (LOW, *(_middle(low, high) for low, high in pairwise(ends))):
        held = tuple(c.holds({channel: pulse}) for c in conditions)
        if held not in seen:
            seen.add(held)
            yield pulse


def _middle(low: float, high: float) -> float:
    """Return the middle of a range, if possible one that the simulated switch has."""
    middle = (low + high) / 2
    within = min(max(middle, LOW), HIGH)
    return within if low <= within < high else middle


def _found(
    conditions: Sequence[Condition],
    candidates: Mapping[int, Sequence[float]],
    on: set[int],
    off: set[int],
) -> dict[int, float] | None:
    """Return the first positions at which some modes are on and others off, None if none are."""
    for pulses in islice(product(*candidates.values()), TRIED):
        positions = dict(zip(candidates, pulses, strict=True))
        active = modes_on(conditions, positions)
        if on <= active and not off & active:
            return positions
    return None


def _why_not(
    conditions: Sequence[Condition],
    candidates: Mapping[int, Sequence[float]],
    needed: set[int],
    off: set[int],
    name: str,
) -> str:
    """Return the message for modes without a position for flight."""
    on = " and ".join(NAMES[mode] for mode in sorted(needed))
    if _found(conditions, candidates, needed, set()) is None:
        lines = ", ".join(repr(c.line) for c in conditions if c.mode in needed)
        return f"{name}: expected positions of the switches with {on} on, got {lines}: correct it"
    alone = [mode for mode in sorted(off) if not _found(conditions, candidates, needed, {mode})]
    blamed = alone or sorted(off)
    taken = " and ".join(OTHER_STICKS[mode] for mode in blamed)
    lines = ", ".join(repr(c.line) for c in conditions if c.mode in blamed)
    wanted = f"expected positions of the switches with {on} on and {taken} off"
    return f"{name}: {wanted}, as in flight the sticks command body rates, got {lines}: correct it"
