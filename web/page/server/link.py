"""Link: messages between the page's own scripts and the server, beside viser's.

Whatever the page's scripts ask for, such as a number of a form or the sticks of a gamepad, is sent
as JSON over a separate websocket, at LINK_PATH of the same server. A message is an object whose
`type` names its form:

    {"type": "seek", "t": 1.25}

Receivers register a form of messages with `Link.on`; messages of other forms are dropped. The Guard
applies the same checks to the link as to the page itself.
"""

from __future__ import annotations

import asyncio
import traceback
from collections.abc import Callable
from contextlib import suppress
from itertools import count
from typing import Any, TypeVar, Union

import msgspec
from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ConnectionClosed

from quadsim.files.yaml_errors import cut

LINK_PATH = "/link"
MAX_LINK_BYTES = 100_000  # largest message that a page may send, such as a course
OPENING = 0.05  # time between two looks whether the page is built [s]
MAX_WAITING = 64  # largest number of unread messages to a page; further ones are dropped


class Message(msgspec.Struct, tag_field="type", forbid_unknown_fields=True):
    """A message, whose class has a `tag` for the field `type`."""


AnyMessage = TypeVar("AnyMessage", bound=Message)


class LinkVisitor:
    """An open page.

    Attributes:
        number: unique number on this server.
    """

    def __init__(self, number: int, loop: asyncio.AbstractEventLoop):
        self.number = number
        self._loop = loop
        self._waiting: asyncio.Queue[bytes] = asyncio.Queue(MAX_WAITING)

    def send(self, message: Message) -> None:
        """Send a message to the page. Any thread may call it; a closed page gets none."""
        data = msgspec.json.encode(message)
        self.soon(lambda _: self._queue(data))

    def soon(self, function: Callable[[LinkVisitor], object]) -> None:
        """Call a function with this visitor on the server's event loop. Any thread may call it."""
        with suppress(RuntimeError):  # the server has ended
            self._loop.call_soon_threadsafe(function, self)

    def _queue(self, data: bytes) -> None:
        with suppress(asyncio.QueueFull):
            self._waiting.put_nowait(data)

    async def pass_on(self, connection: ServerConnection) -> None:
        """Send the waiting messages, until cancelled."""
        while True:
            await connection.send((await self._waiting.get()).decode())


Coming = Callable[[LinkVisitor], object]


class Link:
    """The messages of all pages of one server.

    Handlers run one after another on the server's event loop, in the order of the messages, so they
    must be short; longer work belongs on a different thread.
    """

    def __init__(self) -> None:
        self._handlers: dict[type[Message], Callable[[LinkVisitor, Any], None]] = {}
        self._arriving: list[Coming] = []
        self._leaving: list[Coming] = []
        self._decoder: msgspec.json.Decoder[Any] | None = None
        self._numbers = count(1)
        self._visitors: dict[int, LinkVisitor] = {}
        self._is_open = False

    def open(self) -> None:
        """Begin to handle messages, once all receivers are registered.

        The port listens before: an address that is opened meanwhile asks for its runs, and is heard
        when the page is built.
        """
        self._is_open = True

    def on(
        self, form: type[AnyMessage], handler: Callable[[LinkVisitor, AnyMessage], None]
    ) -> None:
        """Set the handler of the messages of one form, replacing an earlier handler.

        Args:
            form: class of the messages.
            handler: called with the page and the message.
        """
        self._handlers[form] = handler
        forms = tuple(self._handlers)
        self._decoder = msgspec.json.Decoder(Union[forms])  # noqa: UP007  a union of a tuple

    def on_arrive(self, handler: Coming) -> None:
        """Call a function whenever a page is opened, or has connected again."""
        self._arriving.append(handler)

    def on_leave(self, handler: Coming) -> None:
        """Call a function whenever a page is closed, or its connection is lost."""
        self._leaving.append(handler)

    def send_all(self, message: Message) -> None:
        """Send a message to every open page. Any thread may call it."""
        for visitor in self.visitors:
            visitor.send(message)

    @property
    def visitors(self) -> tuple[LinkVisitor, ...]:
        """The open pages."""
        return tuple(self._visitors.values())

    async def serve(self, connection: ServerConnection) -> None:
        """Handle the messages of one page until it is closed."""
        visitor = LinkVisitor(next(self._numbers), asyncio.get_running_loop())
        self._visitors[visitor.number] = visitor
        sending = asyncio.create_task(visitor.pass_on(connection))
        has_logged = False
        try:
            while not self._is_open and connection.close_code is None:
                await asyncio.sleep(OPENING)
            for arrive in self._arriving:
                arrive(visitor)
            while True:
                data = await connection.recv()
                problem = self._handle(visitor, data)
                # Log only the first one, as a page could fill the log.
                if problem and not has_logged:
                    has_logged = True
                    connection.logger.warning("race web: a message was dropped: %s", problem)
        except ConnectionClosed:
            pass
        finally:
            sending.cancel()
            del self._visitors[visitor.number]
            for leave in self._leaving:
                leave(visitor)

    def _handle(self, visitor: LinkVisitor, data: str | bytes) -> str:
        """Handle a message; return one line with the reason of a rejection, "" if accepted."""
        if self._decoder is None:
            return "nothing on this page takes messages"
        if len(data) > MAX_LINK_BYTES:
            return f"expected at most {MAX_LINK_BYTES} bytes, got {len(data)}"
        try:
            message = self._decoder.decode(data)
        except (msgspec.DecodeError, RecursionError, UnicodeDecodeError) as error:
            # The text may quote the message, with line feeds and control characters.
            return cut(str(error).encode("unicode_escape").decode())
        try:
            self._handlers[type(message)](visitor, message)
        except Exception:
            # An error in one handler must not close the page's link.
            traceback.print_exc()
        return ""
