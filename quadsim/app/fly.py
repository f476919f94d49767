"""`race fly`: one flight, from the flags to the report."""

from __future__ import annotations

import signal
from collections.abc import Iterable, Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass, field
from typing import Annotated

from tyro.conf import FlagCreatePairsOff, arg

from quadsim.app.console import COMPILING, complain
from quadsim.app.flags import UsageError
from quadsim.app.flight_flags import FlightFlags
from quadsim.app.progress import Progress
from quadsim.app.report import present
from quadsim.race.events import Frame
from quadsim.race.spec import Spec, build, launch
from quadsim.record.archive import RunFolder
from quadsim.record.run import Recorder, Run, RunError

EXIT = {"finished": 0, "crashed": 1, "timeout": 1, "interrupted": 130}


@dataclass(frozen=True)
class Fly:
    """Fly a course: laps, splits, crashes, chatter, plan time. `race fly` alone flies the main job.

    race fly split_s_swift --sampler gaussian --seed 3

    race fly mine.yaml --preset race --vehicle kingfisher --laps 2 --samples 2048 --model.drag 0
    """

    flight: Annotated[FlightFlags, arg(name="")] = field(default_factory=FlightFlags)
    runs_dir: str = "runs"  # where the run is kept
    json: FlagCreatePairsOff[bool] = False  # one JSON object instead of tables

    @classmethod
    def defaults(cls, argv: Sequence[str]) -> Fly:
        return cls(flight=FlightFlags.defaults(argv))

    def run(self) -> int:
        spec = self.flight.spec()
        try:
            plant, controller, referee = build(spec)
        except ValueError as error:  # laps on an open course, a gate too small for the vehicle
            raise UsageError(str(error)) from None
        with closing(plant), RunFolder.open(self.runs_dir, spec.record()) as folder:
            if not controller.is_cached:
                complain(COMPILING)
            recorder = self._record(launch(spec, plant, controller, referee), spec)
            run = recorder.run(spec.record())
            with suppress(KeyboardInterrupt), uninterrupted():  # a second one does not cost what the first one ended
                failure = save(folder, run)
        present(run, None if failure else folder.path, self.json)
        if failure:
            raise failure
        if run.outcome == "interrupted":
            complain(f"race fly: interrupted at {run.telemetry['t'][-1]:.2f} s, the flight so far is kept")
        return EXIT[run.outcome]

    def _record(self, flight: Iterable[Frame], spec: Spec) -> Recorder:
        """Every frame until the flight ends or Ctrl-C comes; KeyboardInterrupt where nothing has flown yet."""
        recorder = Recorder()
        with Progress(len(spec.course.gates), spec.laps, quiet=self.json) as line, suppress(KeyboardInterrupt):
            for frame in flight:
                recorder.add(frame)
                line.show(frame)
        if not len(recorder):
            raise KeyboardInterrupt
        return recorder


def save(folder: RunFolder, run: Run) -> RunError | None:
    """The error is handed back: the report of a flight comes first, also when it cannot be kept."""
    try:
        folder.save(run)
    except RunError as error:
        return error
    return None


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Ctrl-C and SIGTERM wait until what is inside is done: then KeyboardInterrupt comes."""
    came: list[int] = []
    signals = (signal.SIGINT, signal.SIGTERM)
    before = [signal.signal(s, lambda number, _: came.append(number)) for s in signals]
    try:
        yield
    finally:
        for s, handler in zip(signals, before, strict=True):
            signal.signal(s, handler)
    if came:
        raise KeyboardInterrupt
