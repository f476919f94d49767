"""Pictures of the first drone's camera, as a part of the page."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Mapping

from quadsim.web.camera_pictures import At, CameraPicture, CameraPictures
from quadsim.web.lap_timing import LapTiming
from quadsim.web.page.board import Board
from quadsim.web.page.html import box, element, small, svg, text
from quadsim.web.page.tree import tree

ARM = 6.0  # half length of a corner's cross, in pixels of the camera
CORNER = "#00e5ff"


class Pictures:
    """Shows pictures to the visitors who ask for them, as each takes a tenth of a second of a core.

    A visitor has pictures of the time that it watches; one process draws those of all in turn.
    """

    def __init__(self, board: Board):
        self._board = board
        self._pictures = CameraPictures()
        self._shown: dict[int, CameraPicture] = {}

    def update(self, wanted: Mapping[int, LapTiming]) -> None:
        """Show the last pictures, and request the next one.

        wanted: the first competitor as each visitor who shows the pictures watches it.
        """
        for visitor in [one for one in self._shown if one not in wanted]:
            del self._shown[visitor]
            self._board.put("picture", tree(""), visitor)
        if not wanted:
            self.close()
            return
        self._pictures.show({visitor: At(s.entry, s.t) for visitor, s in wanted.items()})
        for visitor, picture in self._pictures.last.items():
            if picture is not self._shown.get(visitor):
                self._shown[visitor] = picture
                self._board.put("picture", tree(picture_html(picture)), visitor)

    def close(self) -> None:
        """End the drawing process."""
        self._pictures.last = {}
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
