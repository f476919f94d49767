"""What visitors may send: clicks, hotkeys, and values that the control itself could have sent."""

from __future__ import annotations

import logging
from collections.abc import Callable
from math import isfinite
from typing import Any

import viser
from viser import _messages as messages

LONGEST_TEXT = 200  # characters
UNUSED_MESSAGES = (  # that viser's server handles and no control of the page sends
    messages.ShareUrlRequest,
    messages.ShareUrlDisconnect,
    messages.FileTransferStartUpload,
    messages.FileTransferPart,
    messages.GuiFormSubmitMessage,
    messages.GuiFormDirtyMessage,
    messages.GuiButtonHoldMessage,
)
LOG = logging.getLogger("race web")


def one_line(record: logging.LogRecord) -> bool:
    """A log filter: what a visitor sent wrong is one line, no traceback."""
    if record.exc_info and record.exc_info[1]:
        error = record.exc_info[1]
        words = " ".join(str(error).split())[:200]
        record.msg, record.args = "race web: %s: %s: %s", (record.getMessage(), type(error).__name__, words)
        record.exc_info = None
    return True


LOG.addFilter(one_line)


def restrict_messages(server: viser.ViserServer) -> None:
    """To what controls of the page send: those that all share, and those of one visitor alone."""
    socket = server._websock_server
    server.request_share_url = lambda *_, **__: None  # type: ignore[method-assign]
    _restrict(socket, server)
    socket.on_client_connect(lambda connection: _restrict(connection, server))  # before it can send anything
    loop = socket._background_event_loop
    if loop is not None:
        loop.set_exception_handler(_log_failed_task)


def _log_failed_task(_: Any, context: dict[str, Any]) -> None:
    error = context.get("exception")
    LOG.error("a message of a visitor was dropped", exc_info=error)


def _restrict(interface: Any, server: viser.ViserServer) -> None:
    """The handlers of a server or of one connection to it."""
    handlers = interface._incoming_handlers
    for kind in UNUSED_MESSAGES:
        handlers.pop(kind, None)
    update: Callable[..., Any] = handlers[messages.GuiUpdateMessage][0]
    handles = update.__self__._gui_input_handle_from_uuid  # pyright: ignore[reportFunctionMemberAccess]

    async def checked(client_id: Any, message: Any) -> None:
        handle = handles.get(message.uuid) if isinstance(message.uuid, str) else None
        if handle is None:
            return
        if validate_input(handle, message.updates):
            await update(client_id, message)
        elif client := server.get_clients().get(client_id):  # its page shows what it sent: tell it what holds
            value = messages.GuiUpdateMessage(message.uuid, {"value": handle._impl.value})
            client._websock_connection.queue_message(value)

    handlers[messages.GuiUpdateMessage] = [checked]


def validate_input(handle: Any, updates: Any) -> bool:
    """Whether the control itself could have sent this: only its value, of its type and within its range. viser itself
    would set any attribute.
    """
    if not isinstance(updates, dict) or set(updates) != {"value"}:
        return False
    value, props, held = updates["value"], handle._impl.props, handle._impl.value
    if getattr(props, "disabled", False) or not props.visible:
        return False
    if hasattr(props, "options"):
        return isinstance(value, str) and value in props.options
    if isinstance(held, bool):
        return isinstance(value, bool)
    if not isinstance(held, int | float):
        return isinstance(value, str) and len(value) <= LONGEST_TEXT
    if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
        return False
    low, high = getattr(props, "min", None), getattr(props, "max", None)
    return (low is None or value >= low) and (high is None or value <= high)
