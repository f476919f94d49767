"""Small pieces of HTML. Every name that comes from a file goes through `text`."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from quadsim.palette import Style
from web.competitor import Competitor

# dim text, outlines of dots, background of bars and strips
DIM, MARKER_EDGE, TRACK = "#9aa3b2", "#111", "#2c3038"
# hits and crashes, as light as text on a dark page has to be; what is neither
RED, GREY = "#ff6b6b", "#e2e6ec"
MONO = "font-family:ui-monospace,Menlo,Consolas,monospace;font-variant-numeric:tabular-nums"

PHONE = "@media (max-width: 36em)"  # where viser puts all panels into one sheet at the bottom
STYLE = f"""<style>
.mantine-Notifications-root {{ top: auto !important; bottom: 1em !important }}
label, .mantine-Slider-markLabel, .mantine-Notification-description, .u-legend .u-value {{ color: #b4bcc8 !important }}
.u-legend .u-series:last-child, .u-cursor-pt:last-child {{ display: none }}
.hud-copy {{ display: none }}
{PHONE} {{
  .hud {{ display: none }}
  .hud-copy {{ display: block; position: fixed; top: 0; left: 0; right: 0; z-index: 20; background: #1f2125;
    color: #c9c9c9; font-family: sans-serif }}
  .hud-copy .numbers {{ font-size: 15px !important; gap: 0 8px !important }}
  .mantine-Notifications-root {{ bottom: 51% !important }}
  .mantine-Paper-root:has(.hud), .mantine-Paper-root:has(.hud) [style*="width: 20em"] {{ width: 100% !important }}
  .mantine-Paper-root:has(.hud) {{ max-height: 50% !important }}
  [aria-label$="panel HUD"] {{ display: none !important }}
}}
# notes stand below, where they hide neither the drone nor the numbers; a chart's last series is its
# mark
</style>"""


def head_up(*parts: str) -> str:
    """The head-up display; on a phone page.js shows a copy of it at the top of the page."""
    return f'<div class="hud">{box(*parts)}</div>'


def text(value: object) -> str:
    return escape(str(value), quote=True)


def table(head: list[str], rows: Sequence[list[str] | str], left: int = 1) -> str:
    """Cells are HTML. The first `left` columns are aligned left, the others right; a row that is
    one text spans all."""
    top = _row(head, "th", f"color:{DIM};font-weight:400;border-bottom:1px solid #3a3f48", left)
    body = ""
    for row in rows:
        wide = f'<tr><td colspan="{len(head)}" style="padding:0 4px 5px">{row}</td></tr>'
        body += wide if isinstance(row, str) else _row(row, "td", "", left)
    return f'<table style="width:100%;border-collapse:collapse;font-size:11.5px;{MONO}">{top}{body}</table>'


def _row(cells: list[str], tag: str, look: str, left: int) -> str:
    out = ""
    for i, cell in enumerate(cells):
        side = "left" if i < left else "right"
        out += f'<{tag} style="text-align:{side};padding:2px 4px;white-space:nowrap;{look}">{cell}</{tag}>'
    return f"<tr>{out}</tr>"


def svg(tag: str, content: str = "", **attributes: object) -> str:
    """An SVG element. Underscores in names become hyphens, floats get one decimal."""
    values = {
        k.replace("_", "-"): f"{v:.1f}" if isinstance(v, float) else v
        for k, v in attributes.items()
    }
    return f"<{tag} " + " ".join(f'{k}="{v}"' for k, v in values.items()) + f">{content}</{tag}>"


def small(words: str) -> str:
    return f'<div style="color:{DIM};font-size:11px">{words}</div>'


def swatch(s: Style) -> str:
    """The colour and the line style as a short line."""
    dash = " ".join(map(str, s.dash))
    line = svg(
        "line", x1=0, y1=5, x2=22, y2=5, stroke=s.colour, stroke_width=3, stroke_dasharray=dash
    )
    return svg("svg", line, width=22, height=10, style="vertical-align:middle;margin-right:5px")


def label(entry: Competitor) -> str:
    """Its name in its sampler's colour."""
    return f'{swatch(entry.style)}<b style="color:{entry.style.colour}">{text(entry.name)}</b>'


def coloured(what: str, colour: str) -> str:
    return f'<span style="color:{colour};font-weight:600">{what}</span>'


def bar(share: float, colour: str, height: int = 5, width: str = "100%") -> str:
    share = min(max(share, 0.0), 1.0)
    fill = f'<div style="width:{100 * share:.1f}%;height:100%;background:{colour}"></div>'
    look = f"height:{height}px;width:{width};background:{TRACK};border-radius:2px;overflow:hidden"
    return f'<div style="{look}">{fill}</div>'


def heading(what: str) -> str:
    look = f"color:{DIM};font-size:11px;letter-spacing:.06em;text-transform:uppercase;margin:10px 0 4px"
    return f'<div style="{look}">{what}</div>'


def box(*parts: str) -> str:
    return (
        f'<div style="padding:4px 10px 8px;font-size:12px;line-height:1.35">{"".join(parts)}</div>'
    )
