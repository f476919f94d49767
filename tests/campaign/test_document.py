"""Claims about documents, which a terminal, Markdown, HTML and JSON show alike."""

import msgspec
from matplotlib.figure import Figure

from quadsim.campaign.document import Document, Heading, Line, Note, Picture, Table
from quadsim.console import as_text

TABLE = Table(("name", "lap\n[s]"), (("<b>", "5.5"), ("[red]", "6.0")))
BLOCKS = (
    Heading("figure8", "2 laps"),
    TABLE,
    Line("first"),
    Line("second"),
    Note("mind this"),
    Picture("paths"),
)
DOCUMENT = Document(BLOCKS)


def test_lines_stand_together_and_empty_lines_keep_all_else_apart():
    printed = as_text(*DOCUMENT.renderables()).splitlines()
    assert printed == [
        "figure8  2 laps",
        "",
        "         lap",
        "  name   [s]",
        "  <b>    5.5",
        "  [red]  6.0",
        "",
        "  first",
        "  second",
        "",
        "  mind this",
    ]
    assert DOCUMENT.markdown("a.png").split("\n\n") == [
        "## figure8",
        "2 laps.",
        "| name | lap [s] |\n| --- | ---: |\n| <b> | 5.5 |\n| [red] | 6.0 |",
        "* first\n* second",
        "* mind this",
        "![](a.png)\n",
    ]


def test_a_notebook_shows_every_text_as_text_and_the_figure_in_its_place():
    html = DOCUMENT.html(Figure())
    assert html.index("mind this") < html.index('alt="paths"')
    assert "&lt;b&gt;" in html
    assert "<b>" not in html


def test_a_saved_document_is_read_again_from_its_blocks(tmp_path):
    files = DOCUMENT.save(tmp_path, "a", Figure())
    assert [file.name for file in files] == ["a.md", "a.json", "a.png", "a.svg"]
    assert msgspec.json.decode(files[1].read_bytes(), type=Document) == DOCUMENT
    assert files[0].read_text() == DOCUMENT.markdown("a.png")
