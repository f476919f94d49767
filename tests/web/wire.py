"""A client without a browser: viser's protocol, message by message."""

import http.client
from contextlib import asynccontextmanager

import msgspec
import viser
import websockets
import zstandard

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


class Client:
    def __init__(self, socket):
        self._socket = socket

    async def send(self, **message):
        await self._socket.send(msgspec.msgpack.encode(message))

    async def set(self, handle, value, name="value"):
        await self.send(type="GuiUpdateMessage", uuid=handle._impl.uuid, updates={name: value})

    async def click(self, handle):
        await self.set(handle, True)


def open_socket(port, host="127.0.0.1", **options):
    """A websocket by viser's protocol. Raises what websockets raises for one that is refused."""
    protocol = websockets.Subprotocol(f"viser-v{viser.__version__}")
    address = f"ws://{host}:{port}"
    return websockets.connect(address, subprotocols=[protocol], max_size=None, **options)


@asynccontextmanager
async def connect(port, **options):
    """A client that the server counts."""
    async with open_socket(port, **options) as socket:
        client = Client(socket)
        await client.send(**CAMERA)
        yield client


def get(port, path="/", host=None, **headers):
    """Status and headers of a page asked for under any name."""
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=5)
    connection.putrequest("GET", path, skip_host=True)
    connection.putheader("Host", host or f"127.0.0.1:{port}")
    for name, value in headers.items():
        connection.putheader(name, value)
    connection.endheaders()
    answer = connection.getresponse()
    answer.read()
    return answer.status, dict(answer.getheaders())


async def button(client, wanted, most=200):
    """uuid of the first button with this label, from what the server sends a new client."""
    for _ in range(most):
        for message in await received(client):
            if message["type"] == "GuiButtonMessage" and message["props"]["label"] == wanted:
                return message["uuid"]
    raise LookupError(wanted)


async def received(client):
    """The messages of the next frame from the server."""
    frame = await client._socket.recv()
    size = int.from_bytes(frame[8:16], "little")
    return msgspec.msgpack.decode(zstandard.ZstdDecompressor().decompress(frame[16 : 16 + size]))[
        "messages"
    ]
