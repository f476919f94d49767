"""What visitors may send: clicks, hotkeys, and values that the control itself could have sent; and
who may."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from math import inf, isfinite
from time import monotonic
from typing import Any
from weakref import WeakKeyDictionary

import viser
from viser import _messages as messages
from websockets.http11 import Request

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
PATIENCE = 5.0  # [s] between two notices to one visitor
VISITOR = "visitor"  # name of the cookie, before the port
LOG = logging.getLogger("race web")
VISITORS: WeakKeyDictionary[viser.ViserServer, Visitors] = WeakKeyDictionary()


def cookie_of(request: Request, name: str) -> str:
    pairs = (part.strip().partition("=") for part in request.headers.get("Cookie", "").split(";"))
    return next((value for key, _, value in pairs if key == name), "")


def one_line(record: logging.LogRecord) -> bool:
    """A log filter: what a visitor sent wrong is one line, no traceback."""
    if record.exc_info and record.exc_info[1]:
        error = record.exc_info[1]
        words = " ".join(str(error).split())[:200]
        record.msg, record.args = (
            "race web: %s: %s: %s",
            (record.getMessage(), type(error).__name__, words),
        )
        record.exc_info = None
    return True


LOG.addFilter(one_line)


class Visitors:
    """Who looks at the page. A browser is one visitor, known by a cookie, also after it was
    reloaded."""

    def __init__(self, server: viser.ViserServer):
        self._server, self._connections = server, server._websock_server._live_connections
        self._seen: dict[str, None] = {}  # in the order of their first visits
        self._told: dict[str, float] = {}  # when a visitor was last told to be only watching [s]
        self._pilot: str | None = None  # who started the flight
        self.only_first = False  # all but the first
        self.switch = ""  # uuid of the control of this
        self.free: set[str] = set()  # uuids of controls that every visitor may use
        server._websock_server.on_client_connect(
            lambda c: self._seen.setdefault(self.name(c.client_id))
        )

    def name(self, client_id: int) -> str:
        connection: Any = self._connections.get(client_id)  # pyright: ignore[reportArgumentType]
        cookie = (
            cookie_of(connection.request, f"{VISITOR}{self._server.get_port()}")
            if connection
            else ""
        )
        return cookie or f"client {client_id}"

    def may_use(self, client_id: int, uuid: str) -> bool:
        """Also tells a visitor who may not."""
        if uuid in self.free or not (self.only_first or uuid == self.switch):
            return True
        here = {self.name(c) for c in tuple(self._connections)}
        if self.name(client_id) == next((v for v in self._seen if v in here), None):
            return True
        self._tell(client_id)
        return False

    def _tell(self, client_id: int) -> None:
        client, name, now = (
            self._server.get_clients().get(client_id),
            self.name(client_id),
            monotonic(),
        )
        if client and now - self._told.get(name, -inf) > PATIENCE:
            self._told[name] = now
            words = (
                "Only the first visitor has the controls; your camera and the exports are yours."
            )
            client.add_notification("You are watching", words, auto_close_seconds=6.0, color="blue")

    def end_flight(self, event: Any, flying: bool, act: Callable[[], None]) -> None:
        """Do what ends a flight that is on; first ask a visitor who did not start it."""
        name = self.name(event.client_id)

        def do() -> None:
            self._pilot = name
            act()

        if not flying or self._pilot in (None, name) or event.client is None:
            do()
        else:
            ask(event.client, "Another visitor's flight is on", "End it", "Let it fly", do)


def ask(client: viser.ClientHandle, title: str, yes: str, no: str, act: Callable[[], None]) -> None:
    """A window on this visitor's page alone."""
    with client.gui.add_modal(title) as modal:
        accept, refuse = (
            client.gui.add_button(yes, color="red"),
            client.gui.add_button(no, color="gray"),
        )
    refuse.on_click(lambda _: modal.close())

    @accept.on_click
    def _(_: viser.GuiEvent) -> None:
        modal.close()
        act()


class LoopEvent(asyncio.Event):
    """Is set on its event loop alone. Whatever sends a message sets the event of its buffer twice,
    at once from its own thread and again on the loop; an asyncio.Event cannot stand the first:
    "deque mutated during iteration", where the loop adds a waiter meanwhile. Nobody reads it there,
    and the second follows.
    """

    def set(self) -> None:
        try:
            asyncio.get_running_loop()
        except RuntimeError:  # another thread
            return
        super().set()


def wake_on_the_loop(buffer: Any) -> None:
    """A buffer of messages to the server's clients, before its first one listens."""
    buffer.message_event = LoopEvent()


def restrict_messages(server: viser.ViserServer) -> None:
    """To what controls of the page send: those that all share, and those of one visitor alone."""
    socket = server._websock_server
    server.request_share_url = lambda *_, **__: None  # type: ignore[method-assign]
    visitors = VISITORS[server] = Visitors(server)
    _restrict(socket, server, visitors.may_use)
    wake_on_the_loop(socket._broadcast_buffer)

    def connected(connection: Any) -> None:  # before it can send
        _restrict(connection, server, lambda *_: True)
        wake_on_the_loop(connection.get_message_buffer())

    socket.on_client_connect(connected)
    loop = socket._background_event_loop
    if loop is not None:
        loop.set_exception_handler(_log_failed_task)


def _log_failed_task(_: Any, context: dict[str, Any]) -> None:
    error = context.get("exception")
    LOG.error("a message of a visitor was dropped", exc_info=error)


def _restrict(
    interface: Any, server: viser.ViserServer, may_use: Callable[[int, str], bool]
) -> None:
    """The handlers of a server or of one connection to it."""
    handlers = interface._incoming_handlers
    for kind in UNUSED_MESSAGES:
        handlers.pop(kind, None)
    update: Callable[..., Any] = handlers[messages.GuiUpdateMessage][0]
    gui: viser.GuiApi = update.__self__  # pyright: ignore[reportFunctionMemberAccess]
    handles, commands = gui._gui_input_handle_from_uuid, gui._command_handle_from_uuid

    async def checked(client_id: Any, message: Any) -> None:
        handle = handles.get(message.uuid) if isinstance(message.uuid, str) else None
        if handle is None:
            return
        if validate_input(handle, message.updates) and may_use(client_id, message.uuid):
            await update(client_id, message)
        # its page shows what it sent: tell it what holds
        elif client := server.get_clients().get(client_id):
            value = messages.GuiUpdateMessage(message.uuid, {"value": handle._impl.value})
            client._websock_connection.queue_message(value)

    command: Callable[..., Any] = handlers[messages.CommandTriggerMessage][0]

    async def checked_command(client_id: Any, message: Any) -> None:
        if (
            isinstance(message.uuid, str)
            and message.uuid in commands
            and may_use(client_id, message.uuid)
        ):
            await command(client_id, message)

    handlers[messages.GuiUpdateMessage] = [checked]
    handlers[messages.CommandTriggerMessage] = [checked_command]


def validate_input(handle: Any, updates: Any) -> bool:
    """Whether the control itself could have sent this: only its value, of its type and within its
    range. viser itself would set any attribute.
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
