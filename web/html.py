"""Small pieces of HTML. Every name that comes from a file goes through `text`."""

from __future__ import annotations

from html import escape

from quadsim.palette import style

DIM, PANEL = "#8b93a1", "#1a1c20"
MONO = "font-family:ui-monospace,Menlo,Consolas,monospace;font-variant-numeric:tabular-nums"


def text(value: object) -> str:
    return escape(str(value), quote=True)


def table(head: list[str], rows: list[list[str]], left: int = 1) -> str:
    """Cells are HTML. The first `left` columns stand left, numbers right."""

    def row(cells: list[str], tag: str, look: str) -> str:
        sides = ("left" if i < left else "right" for i in range(len(cells)))
        pad = "padding:2px 5px;white-space:nowrap"
        return (
            "<tr>"
            + "".join(
                f'<{tag} style="text-align:{s};{pad};{look}">{c}</{tag}>' for c, s in zip(cells, sides, strict=True)
            )
            + "</tr>"
        )

    top = row(head, "th", f"color:{DIM};font-weight:400;border-bottom:1px solid #3a3f48")
    body = "".join(row(cells, "td", "") for cells in rows)
    return f'<table style="width:100%;border-collapse:collapse;font-size:12px;{MONO}">{top}{body}</table>'


def swatch(sampler: str) -> str:
    """The sampler's colour and line style as a short line."""
    s = style(sampler)
    dash = " ".join(map(str, s.dash))
    line = f'<line x1="0" y1="5" x2="22" y2="5" stroke="{s.colour}" stroke-width="3" stroke-dasharray="{dash}"/>'
    return f'<svg width="22" height="10" style="vertical-align:middle;margin-right:5px">{line}</svg>'


def named(name: str, sampler: str) -> str:
    return f'{swatch(sampler)}<b style="color:{style(sampler).colour}">{text(name)}</b>'


def coloured(what: str, colour: str) -> str:
    return f'<span style="color:{colour};font-weight:600">{what}</span>'


def bar(share: float, colour: str, height: int = 5) -> str:
    share = min(max(share, 0.0), 1.0)
    fill = f'<div style="width:{100 * share:.1f}%;height:100%;background:{colour}"></div>'
    return f'<div style="height:{height}px;background:#2c3038;border-radius:2px;overflow:hidden">{fill}</div>'


def heading(what: str) -> str:
    return f'<div style="color:{DIM};font-size:11px;letter-spacing:.06em;text-transform:uppercase;margin:10px 0 4px">{what}</div>'


def box(*parts: str) -> str:
    return f'<div style="padding:4px 10px 8px;font-size:12px;line-height:1.35">{"".join(parts)}</div>'
