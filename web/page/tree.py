"""Tables and drawings as trees of elements, which dom.js builds node by node.

The page's policy allows no inline style, and nothing on it is ever parsed as HTML in the browser.
"""

from __future__ import annotations

from html.parser import HTMLParser

import msgspec

VOID = ("img", "br")  # elements without an end


class Element(msgspec.Struct):
    """An element. Names of attributes are in lower case."""

    tag: str
    attributes: dict[str, str]
    children: list[Element | str]


class _Builder(HTMLParser):
    """Builds the tree of a text that this package has written."""

    def __init__(self) -> None:
        super().__init__(convert_charrefs=True)
        self.root = Element("div", {}, [])
        self._open = [self.root]

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        found = Element(tag, {name: value or "" for name, value in attrs}, [])
        self._open[-1].children.append(found)
        if tag not in VOID:
            self._open.append(found)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        self.handle_endtag(tag)

    def handle_endtag(self, tag: str) -> None:
        if tag not in VOID and len(self._open) > 1:
            self._open.pop()

    def handle_data(self, data: str) -> None:
        self._open[-1].children.append(data)


def tree(html: str) -> Element:
    """Return the elements of a text of quadsim.web.page.html, within one more element.

    Examples:
        >>> from quadsim.web.page.tree import tree
        >>> tree("<b>1 &lt; 2</b>").children
        [Element(tag='b', attributes={}, children=['1 < 2'])]
    """
    builder = _Builder()
    builder.feed(html)
    builder.close()
    return builder.root
