"""Packets of several programs to `race serve`, whole, damaged and with any numbers.

Nothing raises; only the pilot's messages change what flies; each program is told each thing once,
in texts that a message holds; and what is flown is within the vehicle's limits.
"""

from __future__ import annotations

import random
import sys
from collections import Counter
from dataclasses import replace
from functools import partial
from math import inf, isfinite, nan
from typing import Any

from quadsim.course import Start
from quadsim.mavlink.commands import Phase
from quadsim.mavlink.messages import (
    MESSAGES,
    CommandLong,
    Message,
    SetAttitudeTarget,
    SetPositionTargetLocalNed,
    Statustext,
    layout,
)
from quadsim.mavlink.packets import Packer, parse
from quadsim.mavlink.udp_link import Address, Received
from quadsim.physics.plant_state import start_state
from quadsim.vehicle import load_vehicle
from tests.fuzz.harness import Case
from tests.mavlink.world import ARM, FORWARD, World

NUMBERS = (0.0, 1.0, -1.0, 0.3, 5.0, nan, inf, -inf, 3e38)
SENDERS: tuple[Address, ...] = (("127.0.0.1", 14550), ("127.0.0.1", 2), ("127.0.0.1", 3))
COMMANDS = (176, 400, 400, 511, 512, 520, 31000, 22, 999)
VEHICLE = load_vehicle("archer")
STATE = start_state(Start((0.0, 0.0, 1.0), 0.3), VEHICLE.radius)

# The number of the sender in SENDERS, and a datagram
Datagram = tuple[int, bytes]


def mavlink_clients(rng: random.Random) -> Case:
    """Return a case with some datagrams of three programs."""
    datagrams = [(rng.randrange(len(SENDERS)), _datagram(rng)) for _ in range(rng.randint(1, 40))]
    call = partial(serve, datagrams)
    return Case("mavlink_clients", repr(datagrams), (), call=call, codes=frozenset({0}))


def serve(datagrams: list[Datagram]) -> int:
    """Obey the datagrams; return the exit code."""
    world = World()
    told: Counter[tuple[Any, Address]] = Counter()
    for number, data in datagrams:
        problem = _problem(world, SENDERS[number], data)
        told.update(a for a in world.link.answers if isinstance(a[0], Statustext))
        if problem or world.commands.phase is Phase.RESET:
            break
    else:
        problem = ""
    if not problem and any(count > 1 for count in told.values()):
        problem = f"a text is sent twice: {told.most_common(1)}"
    if problem:
        print(problem, file=sys.stderr)
    return 1 if problem else 0


def _problem(world: World, sender: Address, data: bytes) -> str:
    """Obey a datagram; return what went wrong, or ""."""
    link, commands = world.link, world.commands
    before = (link.pilot, world.client.law, commands.is_armed, commands.phase)
    link.given = [Received(one.message, sender, one.member) for one in parse(data).packets]
    link.answers.clear()
    commands.listen_until(0.0)
    if commands.phase is Phase.START and commands.is_armed:
        commands.begin_race()
        before = (link.pilot, world.client.law, commands.is_armed, commands.phase)
    after = (link.pilot, world.client.law, commands.is_armed, commands.phase)
    if link.pilot not in (None, sender) and after != before:
        return f"{sender} has changed what flies"
    if any(to != sender for _, to in link.answers):
        return "an answer goes to another program"
    if world.client.law is not None:
        control = world.client.law(STATE)
        if not all(map(isfinite, control)) or not 0.0 <= control.thrust <= VEHICLE.thrust_max:
            return f"{control} is flown"
    return ""


def _datagram(rng: random.Random) -> bytes:
    """Return a datagram of one to three packets, damaged once in a while."""
    packer = Packer(rng.randrange(256), rng.randrange(256))
    data = bytearray(b"".join(packer.packet(_message(rng)) for _ in range(rng.randint(1, 3))))
    if rng.random() < 0.1:
        data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
    if rng.random() < 0.05:
        del data[rng.randrange(len(data)) :]
    return bytes(data)


def _message(rng: random.Random) -> Message:
    """Return a message: often one that flies, with any numbers in any field."""
    match rng.randrange(6):
        case 0:
            return ARM
        case 1:
            return replace(FORWARD, type_mask=rng.randrange(4096))
        case 2:
            return _drawn(SetPositionTargetLocalNed, rng, coordinate_frame=rng.choice((1, 7, 8, 9)))
        case 3:
            return _drawn(SetAttitudeTarget, rng)
        case 4:
            return _drawn(CommandLong, rng, command=rng.choice(COMMANDS))
        case _:
            return _drawn(rng.choice(list(MESSAGES.values())), rng)


def _drawn(kind: type[Message], rng: random.Random, **given: Any) -> Message:
    """Return a message with random numbers; target_system is its receiver's more often."""
    values: dict[str, Any] = {}
    shape = layout(kind)
    for name, field in zip(shape.names, shape.types, strict=True):
        if field.name == "float":
            numbers = [rng.choice(NUMBERS) for _ in range(field.count)]
        else:
            numbers = [rng.randrange(2 ** (8 * field.size - 1)) for _ in range(field.count)]
        if field.length and field.name != "float":
            values[name] = bytes(1 + n % 126 for n in numbers)
        else:
            values[name] = tuple(numbers) if field.length else numbers[0]
    if "target_system" in values:
        values["target_system"] = rng.choice((0, 1, 1, 77))
    return kind(**values | given)
