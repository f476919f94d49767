"""Pictures of the first drone's camera, as a part of the page."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Mapping

from quadsim.web.page.parts.board import Board
from quadsim.web.page.parts.elements import EMPTY, Element, box, element, small
from quadsim.web.race.camera_pictures import At, CameraPicture, CameraPictures
from quadsim.web.race.lap_timing import LapTiming

ARM = 6.0  # half length of a corner's cross, in pixels of the camera


class Pictures:
    """Shows pictures to the visitors who ask for them, as each takes a tenth of a second of a core.

    A visitor has pictures of the time that it watches; one process draws for all visitors in turn.
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
            self._board.put("picture", EMPTY, visitor)
        if not wanted:
            self.close()
            return
        self._pictures.show({visitor: At(s.entry, s.t) for visitor, s in wanted.items()})
        for visitor, picture in self._pictures.last.items():
            if picture is not self._shown.get(visitor):
                self._shown[visitor] = picture
                self._board.put("picture", shown_picture(picture), visitor)

    def close(self) -> None:
        """End the drawing process."""
        self._pictures.last = {}
        self._pictures.close()


def shown_picture(picture: CameraPicture) -> Element:
    """Return a picture with crosses at the corners found in it."""
    moment = picture.moment
    if picture.problem:
        return box(small(picture.problem))
    caption = f"{moment.name} at {moment.t:.2f} s"
    data = b64encode(picture.jpeg).decode()
    alt = f"What the camera of {caption} sees"
    parts = [element("img", src=f"data:image/jpeg;base64,{data}", alt=alt)]
    if moment.corners:
        parts.append(_crosses(picture))
        caption += f": {len(moment.corners.pixels)} corners of gates were found"
    return box(element("div", *parts, look="camera-picture"), small(caption))


def _crosses(picture: CameraPicture) -> Element:
    """Return crosses as an overlay of the picture."""
    moment = picture.moment
    width, height = moment.size
    lines = [
        element("line", x1=u - x, y1=v - y, x2=u + x, y2=v + y)
        for u, v in (moment.corners.pixels.tolist() if moment.corners else ())
        for x, y in ((ARM, ARM), (ARM, -ARM))
    ]
    return element(
        "svg",
        *lines,
        look="corners",
        viewBox=f"0 0 {width} {height}",
        preserveAspectRatio="none",
    )
