"""AgainChoices: a stored run or race, to be repeated on the page by START."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from quadsim.config.spec import Spec
from quadsim.heat.archive import read_heat, recorded_heat
from quadsim.heat.spec import HeatSpec
from quadsim.record.archive import read_run


@dataclass(frozen=True)
class AgainChoices:
    """A stored run that is to be flown again, changes in flight included."""

    folder: Path
    # folder of runs with the solutions that planners follow
    root: str

    def base_spec(self) -> Spec:
        """Return the flight.

        Raises:
            RunError: the run is damaged.
            ValueError: the page cannot fly the run; the message is one line.
        """
        run = read_run(self.folder)
        return Spec.of_record(run.spec, runs_dir=self.root)

    def flown(self, base: Spec) -> Spec:
        """Return the flight with the recorded numbers of the sliders."""
        return base


@dataclass(frozen=True)
class HeatAgainChoices:
    """A stored race of several vehicles, to be repeated."""

    folder: Path
    root: str

    def spec(self) -> HeatSpec:
        """Return the race. Raises RunError, ValueError, see AgainChoices."""
        return recorded_heat(read_heat(self.folder).record, settings={"runs_dir": self.root})
