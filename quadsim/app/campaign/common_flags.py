"""What `race compare`, `tune` and `regress` have in common: where attempts fly, and flags of `race fly` for all."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, TypeVar

from tyro.conf import DisallowNone, Suppress, arg

from quadsim.app.campaign.pool import Pool, open_pool
from quadsim.app.campaign.variants import split
from quadsim.app.flags import check, otherwise, read
from quadsim.app.flight_flags import Count

Campaign = Annotated[str, arg(metavar="FILE.sqlite")]
CAMPAIGN = "campaigns/race.sqlite"
INTERRUPTED = 130  # exit code
Scheduler = Annotated[str | None, DisallowNone, arg(metavar="tcp://HOST:PORT"), otherwise("processes here")]
FlightWords = Suppress[tuple[str, ...]]  # not read as the command's own: see read_with_flight
Command = TypeVar("Command")


@dataclass(frozen=True)
class Workers:
    """Where attempts fly."""

    jobs: Annotated[Count | None, DisallowNone, otherwise("every core")] = None  # attempts at once
    scheduler: Scheduler = None  # of a Dask cluster

    def start(self) -> Pool:
        """Raises UsageError where there is no scheduler."""
        return open_pool(self.jobs, self.scheduler)


def read_with_flight(command: type[Command], prog: str, argv: Sequence[str]) -> Command:
    """The command's own flags, checked; those of `race fly` stay words, in its field `flight`. Raises UsageError."""
    own, flight = split(argv)
    flags = read(command, prog, own)
    check(flags)
    return replace(flags, flight=tuple(flight))  # pyright: ignore[reportArgumentType]
