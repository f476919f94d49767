"""Claims about what a page says of a flight's learned rotors and delay."""

from dataclasses import replace

from web_cases import competitor

from quadsim.record.run import RecordedRun, learned_by
from quadsim.web.page.parts.head import Head, head_of
from quadsim.web.race.lap_timing import lap_timings
from quadsim.web.race.snapshot import Snapshot
from tests.run_cases import SPEC, frame

SHARES = (1.0, 0.93, 0.99, 0.94, 0.91, 0.91)
DELAYS = (0.0, 0.03, 0.03, 0.0, 0.04, 0.04)


def test_at_each_frame_the_page_knows_what_a_run_that_ended_there_would_store():
    frames = [
        replace(frame(k), rotor_shares=(1.0, share, 1.0, 1.0), learned_delay=delay)
        for k, (share, delay) in enumerate(zip(SHARES, DELAYS, strict=True))
    ]
    whole = RecordedRun.from_frames(SPEC, frames).telemetry
    found = [learned_by(whole, k) for k in range(len(frames))]
    runs = [RecordedRun.from_frames(SPEC, frames[: k + 1]) for k in range(len(frames))]
    assert found == [(run.learned, run.learned_delay) for run in runs]
    assert sum(bool(one.rotors) for one in found) == 4


def test_the_head_names_a_weak_rotor_once_it_is_found():
    sound = competitor(laps=1)
    share2 = sound.x["share2"].copy()
    share2[40:] = 0.91
    weak = replace(sound, x={**sound.x, "share2": share2})
    since = float(sound.t[40])

    def warnings_at(t):
        s = Snapshot(t=t, end=99.0, competitors=(weak,))
        return head_of(s, lap_timings(s), Head("rest", [])).warnings

    told = f"{weak.name} learned in flight: rotor 2 at 91 %, from {since:.1f} s"
    assert told in warnings_at(since)
    assert told not in warnings_at(since - 0.01)
