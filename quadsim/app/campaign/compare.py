"""`race compare`: variants against each other on courses, paired by seed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

from msgspec import Meta
from tyro.conf import DisallowNone, FlagCreatePairsOff, OmitArgPrefixes, Positional, arg

from quadsim.app.campaign.common_flags import (
    CAMPAIGN,
    INTERRUPTED,
    Campaign,
    FlightWords,
    Workers,
    read_with_flight,
)
from quadsim.app.campaign.report import present, sections
from quadsim.app.campaign.runner import Runner
from quadsim.app.campaign.variants import parse_variants
from quadsim.app.flags import UsageError, otherwise


@dataclass(frozen=True)
class Compare:
    """Fly variants against each other and say which is faster, safer, smoother, and by how much.

    Attempt i of every variant flies seed --seed + i: the same start, gusts and vehicle under --randomize.
    Every flag of `race fly` holds for all variants. What has been flown before is not flown again.

    race compare paper_flat --preset paper --variants gaussian,colored --attempts 100 --randomize 1

    race compare split_s_swift --variants colored,soft=race+target-ess=200,wild=gaussian+sigma=3:3:.6:6
    """

    courses: Annotated[tuple[str, ...], Positional, arg(metavar="COURSE")] = ()  # see `race courses`, or FILE.yaml
    variants: Annotated[str, arg(metavar="ARM,ARM")] = "gaussian,colored"  # samplers, or NAME=preset+flag=value+...
    attempts: Annotated[int, Meta(ge=1, le=100_000)] = 10  # of each variant on each course
    workers: OmitArgPrefixes[Workers] = field(default_factory=Workers)
    campaign: Campaign = CAMPAIGN  # where attempts are kept
    this_commit: FlagCreatePairsOff[bool] = False  # count only attempts that this commit has flown
    out: Annotated[str | None, DisallowNone, otherwise("beside the campaign")] = None  # folder of Markdown and figures
    json: FlagCreatePairsOff[bool] = False  # one JSON object instead of tables
    flight: FlightWords = ()

    @classmethod
    def from_argv(cls, argv: Sequence[str]) -> Compare:
        flags = read_with_flight(cls, "race compare", argv)
        if not flags.courses:
            raise UsageError("expected one COURSE or more, got none (race courses lists them)")
        return flags

    def run(self) -> int:
        variants = parse_variants(self.variants, self.courses, self.flight, "race compare")
        campaign = Path(self.campaign)
        try:
            with Runner(campaign, self.workers, self.this_commit) as conduct:
                rows = conduct(variants, self.attempts)
        except KeyboardInterrupt:
            return INTERRUPTED
        folder = Path(self.out) if self.out else campaign.with_suffix(".report")
        present(sections(variants, rows, campaign), campaign, folder, self.json)
        return 0 if all(len(landed) == self.attempts for landed in rows) else 1
