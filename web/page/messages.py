"""Messages that visitors may send: camera, values of controls, keys, pictures, handles, clicks.

viser would set any attribute of a control to any value. Here a message passes only if it has the
form of one that the page sends, and a control's value only if that control could have it. The pose
of a handle in the scene is within FARTHEST, with a unit quaternion; viser itself passes it on to
handles that exist alone.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import chain
from math import hypot, isfinite
from typing import Annotated, Any
from urllib.parse import urlsplit

import msgspec
import viser
from websockets.asyncio.server import ServerConnection
from websockets.typing import Data

from quadsim.files.yaml_errors import cut
from web.page.link import LINK_PATH

MAX_BYTES = 16 * 1024 * 1024  # largest message; the largest that pages send is a rendered picture
MAX_TEXT = 200  # characters of a control's value
FARTHEST = 1e4  # coordinate of a handle, as of a course file [m]
UNIT = 1e-3  # greatest error of the length of a handle's quaternion

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


class Update(msgspec.Struct, forbid_unknown_fields=True):
    """The attributes of a control that may be set: its value alone."""

    value: bool | int | float | Text


class ValueMessage(
    msgspec.Struct, tag="GuiUpdateMessage", tag_field="type", forbid_unknown_fields=True
):
    """A value of a control."""

    uuid: Text
    updates: Update


class KeyMessage(
    msgspec.Struct, tag="CommandTriggerMessage", tag_field="type", forbid_unknown_fields=True
):
    """A key that was pressed."""

    uuid: Text


class PictureMessage(
    msgspec.Struct, tag="GetRenderResponseMessage", tag_field="type", forbid_unknown_fields=True
):
    """A picture that the server has asked for."""

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
    """A handle in the scene that is taken."""

    name: Text
    owner: Text = ""


class DragEndMessage(
    msgspec.Struct,
    tag="TransformControlsDragEndMessage",
    tag_field="type",
    forbid_unknown_fields=True,
):
    """A handle in the scene that is let go."""

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
    | ValueMessage
    | KeyMessage
    | PictureMessage
    | HandleMessage
    | DragStartMessage
    | DragEndMessage
    | ClickMessage
)

Control = viser.GuiInputHandle[Any] | viser.GuiButtonHandle | viser.GuiButtonGroupHandle
# returns the control with a uuid
FindControl = Callable[[str], Control | None]


def problem_of(data: Data, find_control: FindControl) -> str:
    """Return in one line why a message is not acceptable; empty: it is."""
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
    if isinstance(message, ValueMessage):
        control = find_control(message.uuid)
        if control is None or not accepts(control, message.updates.value):
            return f"no control has the value {message.updates.value!r}"
    return ""


def accepts(control: Control, value: bool | int | float | str) -> bool:
    """Return whether a person could set a control to a value."""
    if control.disabled or not control.visible:
        return False
    match control:
        case viser.GuiButtonHandle() | viser.GuiCheckboxHandle():
            return isinstance(value, bool)
        case viser.GuiDropdownHandle() | viser.GuiButtonGroupHandle():
            return value in control.options
        case viser.GuiSliderHandle() | viser.GuiNumberHandle():
            return _is_number(value) and _is_between(value, control.min, control.max)
        case viser.GuiTextHandle():
            return isinstance(value, str)
    return False


def _is_finite(camera: CameraMessage) -> bool:
    """Return whether all numbers of a camera are finite."""
    vectors = (camera.wxyz, camera.position, camera.look_at, camera.up_direction)
    numbers = (camera.fov, camera.near, camera.far, camera.image_height, camera.image_width)
    return all(map(isfinite, (*numbers, *chain(*vectors))))


def _is_pose(handle: HandleMessage) -> bool:
    """Return whether the pose of a handle can be that of a part of a course."""
    is_near = all(abs(coordinate) <= FARTHEST for coordinate in handle.position)
    return is_near and abs(hypot(*handle.wxyz) - 1.0) <= UNIT


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and isfinite(value)


def _is_between(value: Any, low: float | None, high: float | None) -> bool:
    return (low is None or value >= low) and (high is None or value <= high)


def is_link(connection: ServerConnection) -> bool:
    """Return whether a connection is that of the page's own scripts, see web.page.link."""
    request = connection.request
    return request is not None and urlsplit(request.path).path == LINK_PATH


class PageConnection(ServerConnection):
    """A connection that receives acceptable messages alone; the first other one is logged.

    The messages of a link are passed on as they are: it checks them itself.

    Args:
        find_control: returns the control with a uuid.
        arguments, keywords: arguments of websockets' own class.
    """

    def __init__(self, find_control: FindControl, *arguments: Any, **keywords: Any):
        super().__init__(*arguments, **keywords)
        self._find_control = find_control
        self._has_logged = False

    async def recv(self, decode: bool | None = None) -> Any:
        """Return the next acceptable message."""
        while True:
            data = await super().recv(decode)
            if is_link(self):
                return data
            problem = problem_of(data, self._find_control)
            if not problem:
                return data
            if not self._has_logged:
                self._has_logged = True
                self.logger.warning("race web: a message was dropped: %s", problem)
