"""Hooks of MkDocs that add notebooks, races, equations, and tables of the API to the site.

MkDocs calls the functions `on_...` while it builds the site (`hooks` in mkdocs.yml).
"""

from __future__ import annotations

import base64
import html
import json
import re
import tomllib
import zipfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from latex2mathml.converter import convert
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

from docs import api_reference
from docs.api_reference import Section
from quadsim.heat.archive import run_folders
from quadsim.web.page.forms.export import offline_page
from quadsim.web.race.competitor import named
from quadsim.web.race.stored_competitor import stored_competitor

NOTEBOOKS = Path("examples/notebooks")
GALLERY = Path("docs/gallery")
PROJECT = Path("pyproject.toml")
EDIT_URI = "edit/main/docs/"  # of a page's source, in the repository
# What pymdownx.arithmatex makes of $$...$$ and $...$
EQUATION = re.compile(
    r'<(?P<tag>div|span) class="arithmatex">\\(?P<kind>[\[(])(?P<latex>.*?)\\[\])]</(?P=tag)>',
    re.DOTALL,
)

CODE = re.compile(r"<pre>(?P<code>.*?)</pre>", re.DOTALL)
TAG = re.compile("<[^>]*>")
WIDEST = 100  # characters: what fits beside the menus; what is longer is a command
# Code in a sentence, and a flag in it
SPAN = re.compile(r"<code>[^<]*</code>")
FLAG = re.compile(r"--[\w-]+")
# The dash in front of the missing description of a field
UNDESCRIBED = re.compile(r"–\s*<div class=\"doc-md-description\">\s*</div>")


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Link every page to its source if pyproject.toml has the address of the repository."""
    project = tomllib.loads(PROJECT.read_text(encoding="utf-8"))["project"]
    address = project["urls"].get("Repository")
    if address is not None:
        config.repo_url = address
        config.repo_name = config.site_name
        config.edit_uri = EDIT_URI
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the notebooks as pages, and the races of the gallery as pages that play."""
    for path in sorted(NOTEBOOKS.glob("*.ipynb")):
        for name, content in _notebook(path).items():
            files.append(File.generated(config, f"notebooks/{name}", content=content))
    for path in sorted(GALLERY.glob("*.zip")):
        files.append(File.generated(config, f"gallery/{path.stem}.html", content=_race(path)))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Add to the overview of the API the names of the other pages of its section of the menu."""
    if page.file.src_uri != api_reference.OVERVIEW or page.parent is None:
        return markdown
    others = (other for other in page.parent.children if isinstance(other, Page))
    sections = [
        Section(other.file.src_uri, other.file.content_string)
        for other in others
        if other is not page
    ]
    handler = config.plugins["mkdocstrings"].get_handler("python")  # pyright: ignore
    options = handler.get_options({})

    def docstring(path: str) -> str:
        found = handler.collect(path, options).docstring
        return "" if found is None else found.value

    return f"{markdown}\n{api_reference.overview(sections, docstring)}"


def on_page_content(page_html: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Write equations as MathML, which browsers show without a script, and break lines of code."""
    page_html = EQUATION.sub(_mathml, UNDESCRIBED.sub("", page_html))
    page_html = SPAN.sub(_with_whole_flags, page_html)
    if page.file.src_uri.startswith(api_reference.FOLDER):
        section = Section(page.file.src_uri, page.file.content_string)
        page_html = api_reference.with_public_names(page_html, section)
    return CODE.sub(_broken, page_html)


def _with_whole_flags(found: re.Match[str]) -> str:
    """Return code of a sentence, whose lines are not broken within a flag."""
    return FLAG.sub(r'<span class="flag">\g<0></span>', found[0])


def _broken(found: re.Match[str]) -> str:
    """Return a block of code, whose lines are broken if one is longer than WIDEST."""
    text = html.unescape(TAG.sub("", found["code"]))
    wide = max(map(len, text.splitlines()), default=0) > WIDEST
    return f'<pre class="broken">{found["code"]}</pre>' if wide else found[0]


def _mathml(found: re.Match[str]) -> str:
    latex = html.unescape(found["latex"]).strip()
    if found["kind"] == "(":
        return convert(latex)
    return f'<div class="equation">{convert(latex, display="block")}</div>'


def _race(path: Path) -> str:
    """Return a page that plays the runs of a zip file."""
    with TemporaryDirectory() as folder, zipfile.ZipFile(path) as archive:
        archive.extractall(folder)
        runs = [
            run for name in sorted(Path(folder).iterdir()) for run in run_folders(str(name), folder)
        ]
        return offline_page(named([stored_competitor(run) for run in runs]))


def _notebook(path: Path) -> dict[str, str | bytes]:
    """Return a notebook's page, its pictures and the notebook itself, by their names."""
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    made: dict[str, str | bytes] = {path.name: path.read_bytes()}
    blocks = [_download(path.name)]
    for number, cell in enumerate(cells):
        source = "".join(cell["source"])
        if cell["cell_type"] == "markdown":
            blocks.append(source)
            continue
        blocks.append(_fenced(source, "python"))
        for place, output in enumerate(cell["outputs"]):
            picture = _picture(output)
            if picture is None:
                blocks.append(_fenced("".join(_text(output)), "text"))
            else:
                name = f"{path.stem}_{number}_{place}.png"
                made[name] = picture
                blocks.append(f"![Output of the cell above]({name})")
    # The first block of a page is its heading
    heading, *rest = blocks[1].split("\n\n", 1)
    made[f"{path.stem}.md"] = "\n\n".join([heading, blocks[0], *rest, *blocks[2:]]) + "\n"
    return made


def _download(name: str) -> str:
    return f"[Download this notebook]({name}): `examples/notebooks/{name}` of a checkout."


def _fenced(text: str, language: str) -> str:
    return f"```{language}\n{text.rstrip()}\n```"


def _picture(output: Mapping[str, Any]) -> bytes | None:
    data = output.get("data", {}).get("image/png")
    return None if data is None else base64.b64decode(data)


def _text(output: Mapping[str, Any]) -> Iterator[str]:
    yield from output.get("text", ())
    yield from output.get("data", {}).get("text/plain", ())
