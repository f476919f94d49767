"""A run on one page: from above, from the side, thrust, body rates, spectrum."""

from __future__ import annotations

from matplotlib import rc_context
from matplotlib.figure import Figure

from quadsim.app.figure_signals import draw_rates, draw_spectrum, draw_thrust
from quadsim.app.figure_style import STYLE
from quadsim.app.figure_views import draw_views
from quadsim.course import parse_course
from quadsim.record.run import Run, not_comparable


def draw(run: Run) -> Figure:
    with rc_context(STYLE):
        figure = Figure(figsize=(15, 9.5), dpi=130, layout="constrained")
        left, right = figure.subfigures(1, 2, width_ratios=(1.25, 1), squeeze=False)[0]
        course = parse_course(run.spec["course_text"], run.spec["course"])
        draw_views(left, run, course)
        over_time, over_frequency = right.subfigures(2, 1, height_ratios=(3.9, 1.8), squeeze=False)[:, 0]
        thrust, *rates = over_time.subplots(4, 1, height_ratios=(1.5, 0.8, 0.8, 0.8), sharex=True)
        draw_thrust(thrust, run)
        draw_rates(rates, run)
        draw_spectrum(over_frequency.subplots(), run)
        figure.suptitle(title(run), x=0.012, ha="left", fontsize=12)
    return figure


def title(run: Run) -> str:
    spec = run.spec
    laps = ", ".join(f"{t:.3f} s" for t in run.laps[:6]) + (", ..." if len(run.laps) > 6 else "")
    what = f"{spec['course']}: {run.outcome}" + (f", laps {laps}" if laps else "")
    how = f"{spec['sampler']} sampling, preset {spec['preset']}, vehicle {spec['vehicle']['name']}, seed {spec['seed']}"
    return "\n".join(line for line in (what, how, not_comparable(spec)) if line)
