"""Pictures of the first drone's camera, as a part of the page."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence

from quadsim.web.camera_pictures import CameraPicture, CameraPictures
from quadsim.web.lap_timing import LapTiming
from quadsim.web.page.board import Board
from quadsim.web.page.html import box, element, small, svg, text
from quadsim.web.page.tree import tree

ARM = 6.0  # half length of a corner's cross, in pixels of the camera
CORNER = "#00e5ff"


class Pictures:
    """Shows pictures on request, as each takes a tenth of a second of a core."""

    def __init__(self, board: Board):
        self._board = board
        self._pictures = CameraPictures()
        self._shown: CameraPicture | None = None

    def update(self, timings: Sequence[LapTiming], is_on: bool) -> None:
        """Show the last picture, and request the next one."""
        if not is_on or not timings:
            self.close()
            return
        first = timings[0]
        self._pictures.show(first.entry, first.t)
        if self._pictures.last is not self._shown:
            self._shown = self._pictures.last
            self._board.put("picture", tree(picture_html(self._shown) if self._shown else ""))

    def close(self) -> None:
        """End the drawing process."""
        self._shown = None
        self._board.put("picture", tree(""))
        self._pictures.last = None
        self._pictures.close()


def picture_html(picture: CameraPicture) -> str:
    """Return a picture with crosses at the corners found in it."""
    moment = picture.moment
    if picture.problem:
        return box(small(text(picture.problem)))
    caption = f"{moment.name} at {moment.t:.2f} s"
    data = b64encode(picture.jpeg).decode()
    alt = f"What the camera of {caption} sees"
    image = f'<img src="data:image/jpeg;base64,{data}" alt="{text(alt)}" style="width:100%">'
    if moment.corners:
        image += _crosses(picture)
        caption += f": {len(moment.corners.pixels)} corners of gates were found"
    return box(element("div", image, position="relative"), small(text(caption)))


def _crosses(picture: CameraPicture) -> str:
    """Return crosses as an overlay of the picture."""
    moment = picture.moment
    width, height = moment.size
    lines = []
    for u, v in moment.corners.pixels.tolist() if moment.corners else ():
        for x, y in ((ARM, ARM), (ARM, -ARM)):
            ends = {"x1": u - x, "y1": v - y, "x2": u + x, "y2": v + y}
            lines.append(svg("line", **ends, stroke=CORNER, stroke_width=2))
    style = "position:absolute;left:0;top:0;width:100%;height:100%"
    look = {"viewBox": f"0 0 {width} {height}", "preserveAspectRatio": "none", "style": style}
    return svg("svg", "".join(lines), **look)
