"""A client without a browser: viser's protocol, message by message."""

import http.client
import json
import secrets
import time
from contextlib import contextmanager

import msgspec
import viser
import websockets
import zstandard
from websockets.sync.client import connect as connected

CAMERA = {
    "type": "ViewerCameraMessage",
    "wxyz": [1.0, 0.0, 0.0, 0.0],
    "position": [0.0, 0.0, 5.0],
    "fov": 1.0,
    "near": 0.01,
    "far": 100.0,
    "image_height": 600,
    "image_width": 800,
    "look_at": [0.0, 0.0, 0.0],
    "up_direction": [0.0, 0.0, 1.0],
}
PROTOCOL = websockets.Subprotocol(f"viser-v{viser.__version__}")
PATIENCE = 10.0  # for an answer [s]
NO_SEAT = "a_seat_that_no_page_names"


class Client:
    """An open page. It keeps all frames that it is sent until they are read."""

    def __init__(self, socket):
        self.socket = socket

    def send(self, **message):
        self.socket.send(msgspec.msgpack.encode(message))

    def received(self, seconds=PATIENCE):
        """The messages of the next frame from the server. Raises TimeoutError."""
        frame = self.socket.recv(seconds)
        size = int.from_bytes(frame[8:16], "little")
        data = zstandard.ZstdDecompressor().decompress(frame[16 : 16 + size])
        return msgspec.msgpack.decode(data)["messages"]

    def waiting(self):
        """All messages that have come."""
        found = []
        while True:
            try:
                found += self.received(0.0)
            except TimeoutError:
                return found


def open_socket(port, host="127.0.0.1", seat="", **options):
    """A websocket by viser's protocol. Raises what websockets raises for one that is refused."""
    return connected(
        f"ws://{host}:{port}/scene/{seat or NO_SEAT}",
        subprotocols=[PROTOCOL],
        max_size=None,
        max_queue=None,
        **options,
    )


@contextmanager
def connect(port, **options):
    """A client that the server counts."""
    with open_socket(port, **options) as socket:
        client = Client(socket)
        client.send(**CAMERA)
        yield client


class LinkClient:
    """The link of an open page, whose scene has a seat."""

    def __init__(self, socket, seat=""):
        self.socket = socket
        self.seat = seat

    def send(self, kind, **fields):
        self.socket.send(json.dumps({"type": kind, **fields}))

    def got(self, kind):
        """The next message of a type. Raises TimeoutError."""
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            message = json.loads(self.socket.recv(PATIENCE))
            if message["type"] == kind:
                return message
        raise TimeoutError(kind)

    def types_until(self, kind):
        """The types of all messages before the next one of this type. Raises TimeoutError."""
        found = []
        while True:
            found.append(json.loads(self.socket.recv(PATIENCE))["type"])
            if found[-1] == kind:
                return found

    def ask(self, answer, kind, **fields):
        self.send(kind, **fields)
        return self.got(answer)

    def part(self, name):
        """What this visitor is shown in a part, once there is something."""
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            parts = self.ask("parts", "ask", have={}, shows=[name], seat=self.seat)["parts"]
            if name in parts:
                return parts[name]["content"]
        raise TimeoutError(name)

    def form(self, name):
        """The fields of a form by their names, and the row that they are of."""
        content = self.part(name)
        return {field["name"]: field for field in content["fields"]}, content["of"]

    def set(self, form, field, value, of=None):
        """Set a field, of the row that is edited; return why it is not taken, "" if it is."""
        of = self.form(form)[1] if of is None else of
        return self.ask("answered", "set_field", form=form, field=field, value=value, of=of)[
            "problem"
        ]

    def press(self, form, field):
        """Press a button of a form; return why nothing came of it, "" if it acts."""
        of = self.form(form)[1]
        return self.ask("answered", "press", form=form, field=field, of=of)["problem"]


@contextmanager
def link(port, seat="", **options):
    address = f"ws://127.0.0.1:{port}/link"
    with connected(address, max_size=None, max_queue=None, **options) as socket:
        yield LinkClient(socket, seat)


@contextmanager
def visit(port, **options):
    """A whole page: a client and its link, at one seat."""
    seat = secrets.token_urlsafe(18)
    with connect(port, seat=seat, **options) as client, link(port, seat, **options) as linked:
        linked.part("groups")  # asks with its seat
        yield client, linked


def press_start(port, **options):
    """START, of a visitor who leaves then."""
    with link(port, **options) as linked:
        linked.send("start")


def get(port, path="/", host=None, **headers):
    """Status and headers of a page asked for under any name."""
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=5)
    connection.putrequest("GET", path, skip_host=True)
    connection.putheader("Host", host or f"127.0.0.1:{port}")
    for name, value in headers.items():
        connection.putheader(name.replace("_", "-"), value)
    connection.endheaders()
    answer = connection.getresponse()
    answer.read()
    return answer.status, dict(answer.getheaders())
