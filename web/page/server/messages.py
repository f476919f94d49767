"""Messages that visitors may send to the scene: camera, pictures, handles, clicks.

The scene has no controls, so that viser's messages about them are dropped. The pose of a handle has
to be within FARTHEST, with a unit quaternion; viser forwards it only to existing handles.
"""

from __future__ import annotations

import asyncio
import logging
from itertools import chain
from math import hypot, isfinite
from typing import Annotated, Any
from urllib.parse import urlsplit

import msgspec
from websockets.asyncio.server import ServerConnection
from websockets.protocol import State
from websockets.typing import Data

from quadsim.files.yaml_errors import cut
from quadsim.web.page.server.link import LINK_PATH

MAX_BYTES = 16 * 1024 * 1024  # largest message; a rendered picture is the largest of a page
MAX_TEXT = 200  # largest number of characters of a text of a message
FARTHEST = 1e4  # largest coordinate of a handle, as in a course file [m]
UNIT = 1e-3  # largest error of the norm of a handle's quaternion

Text = Annotated[str, msgspec.Meta(max_length=MAX_TEXT)]
Vector = tuple[float, float, float]


class CameraMessage(
    msgspec.Struct, tag="ViewerCameraMessage", tag_field="type", forbid_unknown_fields=True
):
    """The camera of a visitor."""

    wxyz: tuple[float, float, float, float]
    position: Vector
    fov: float
    near: float
    far: float
    image_height: float
    image_width: float
    look_at: Vector
    up_direction: Vector


class PictureMessage(
    msgspec.Struct, tag="GetRenderResponseMessage", tag_field="type", forbid_unknown_fields=True
):
    """A picture that the server has requested."""

    payload: bytes
    render_uuid: Text


class HandleMessage(
    msgspec.Struct,
    tag="TransformControlsUpdateMessage",
    tag_field="type",
    forbid_unknown_fields=True,
):
    """The pose to which a handle in the scene is dragged."""

    name: Text
    wxyz: tuple[float, float, float, float]
    position: Vector
    owner: Text = ""


class DragStartMessage(
    msgspec.Struct,
    tag="TransformControlsDragStartMessage",
    tag_field="type",
    forbid_unknown_fields=True,
):
    """The begin of a drag of a handle in the scene."""

    name: Text
    owner: Text = ""


class DragEndMessage(
    msgspec.Struct,
    tag="TransformControlsDragEndMessage",
    tag_field="type",
    forbid_unknown_fields=True,
):
    """The end of a drag of a handle in the scene."""

    name: Text
    owner: Text = ""


class ClickMessage(
    msgspec.Struct, tag="SceneNodeClickMessage", tag_field="type", forbid_unknown_fields=True
):
    """A click on a part of the scene."""

    name: Text
    instance_index: int | None
    ray_origin: Vector
    ray_direction: Vector
    screen_pos: tuple[float, float]
    modifier: Text | None
    owner: Text = ""


_DECODER = msgspec.msgpack.Decoder(
    CameraMessage
    | PictureMessage
    | HandleMessage
    | DragStartMessage
    | DragEndMessage
    | ClickMessage
)


def problem_of(data: Data) -> str:
    """Return one line with the reason why a message is rejected, "" if it is accepted."""
    if isinstance(data, str):
        return "expected a binary message, got a text"
    try:
        message = _DECODER.decode(data)
    except (msgspec.DecodeError, RecursionError, UnicodeDecodeError) as error:
        # The text may quote the message, with line feeds and control characters.
        return cut(str(error).encode("unicode_escape").decode())
    if isinstance(message, CameraMessage) and not _is_finite(message):
        return "expected a camera of finite numbers"
    if isinstance(message, HandleMessage) and not _is_pose(message):
        return f"expected a handle within {FARTHEST:g} m and a unit quaternion"
    return ""


def _is_finite(camera: CameraMessage) -> bool:
    """Return whether all numbers of a camera are finite."""
    vectors = (camera.wxyz, camera.position, camera.look_at, camera.up_direction)
    numbers = (camera.fov, camera.near, camera.far, camera.image_height, camera.image_width)
    return all(map(isfinite, (*numbers, *chain(*vectors))))


def _is_pose(handle: HandleMessage) -> bool:
    """Return whether the pose of a handle is valid for a part of a course."""
    is_near = all(abs(coordinate) <= FARTHEST for coordinate in handle.position)
    return is_near and abs(hypot(*handle.wxyz) - 1.0) <= UNIT


def is_link(connection: ServerConnection) -> bool:
    """Return whether a connection belongs to the page's own scripts, see `link`."""
    request = connection.request
    return request is not None and urlsplit(request.path).path == LINK_PATH


SILENT = logging.Logger("silent", logging.CRITICAL + 1)
# Connections that may be open without having sent a whole request
MOST_WAITING = 32


class PageConnection(ServerConnection):
    """A connection that receives only accepted messages, and logs the first rejected one.

    The messages of a link are not checked here, as the link checks them.
    """

    _has_logged = False

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Begin; the oldest of too many connections without a whole request is dropped.

        Each of them holds a file descriptor, which a visitor without the token could use up.
        """
        super().connection_made(transport)
        handlers = self.server.handlers
        waiting = [each for each in handlers if each.state is State.CONNECTING]
        too_many = max(len(waiting) - MOST_WAITING, 0)
        for oldest in waiting[:too_many]:
            # Its handler ends with an error, which nobody has to read.
            oldest.logger = SILENT
            oldest.transport.abort()

    async def recv(self, decode: bool | None = None) -> Any:
        """Return the next accepted message."""
        while True:
            data = await super().recv(decode)
            if is_link(self):
                return data
            problem = problem_of(data)
            if not problem:
                return data
            if not self._has_logged:
                self._has_logged = True
                self.logger.warning("race web: a message was dropped: %s", problem)
