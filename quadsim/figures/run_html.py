"""Show a run as HTML in notebooks: its path from above, and its numbers."""

from __future__ import annotations

from collections.abc import Iterator

from quadsim.figures.html import block, facts, image, paragraph, text
from quadsim.figures.run_figure import draw_map
from quadsim.files.strict_yaml import FileError
from quadsim.record.run import RecordedRun
from quadsim.report.estimate_metrics import lost_estimate
from quadsim.report.given_state import given_state
from quadsim.report.run_metrics import RunMetrics
from quadsim.report.run_text import (
    chatter_text,
    crash_place,
    flown_with,
    lap_times,
    learned_text,
    limit_text,
    motor_text,
    not_comparable,
    planning_text,
)


def run_html(run: RecordedRun, metrics: RunMetrics) -> str:
    """Return a run as HTML, with a picture if the course is readable."""
    head = f"<b>{text(run.course_name)}</b>, {text(flown_with(run.spec))}"
    parts = [head, facts(_facts(run, metrics))]
    remark = not_comparable(run.spec)
    if remark:
        parts.append(paragraph(remark))
    try:
        course = run.course
    except FileError:
        return block(*parts)
    described = f"The flown path on {run.course_name} from above, coloured by speed."
    return block(*parts, image(draw_map(run, course), described))


def _facts(run: RecordedRun, metrics: RunMetrics) -> Iterator[tuple[str, str]]:
    """Yield the rows of the table beside the picture."""
    laps = f"{len(run.laps)} of {run.spec['laps']} laps in {run.duration:.3f} s"
    yield "outcome", f"{run.outcome}, {laps}{crash_place(run)}"
    for name, line in (("state", given_state(run.spec)), ("estimate", lost_estimate(run))):
        if line:
            yield name, line.removeprefix(f"{name} ")
    if learned := learned_text(run):
        yield "learned in flight", learned
    if run.laps:
        yield "lap times", lap_times(run)
    if metrics.above_limit is not None:
        yield "limit", limit_text(metrics)
    yield "speed", f"{metrics.top_speed:.1f} m/s at most, {metrics.mean_speed:.1f} m/s on average"
    yield "thrust chatter", chatter_text(metrics)
    if metrics.motor_variation is not None:
        yield "motor commands", motor_text(metrics)
    yield "planning time", planning_text(metrics)
