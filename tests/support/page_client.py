"""Page client: what a browser says to the console, byte for byte, without a browser.

A hostile page is a program: it sends whatever it wants over a real WebSocket.
"""

import http.client
import json
import threading
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any

import msgspec
import viser
import zstandard
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect
from websockets.typing import Origin, Subprotocol

from browser import until

TOKEN = "token-of-the-tests"
CAMERA = {
    "type": "ViewerCameraMessage", "wxyz": [1, 0, 0, 0], "position": [1.0, 0, 0.5], "fov": 0.8,
    "near": 0.01, "far": 1000, "image_height": 600, "image_width": 800, "look_at": [0, 0, 0],
    "up_direction": [0, 0, 1],
}  # fmt: skip


class PageClient:
    """A page at a port; ``elements`` are viser's by what stands on them, ``gizmos`` their names,
    ``status`` is what it says of the session."""

    def __init__(self, port: int, *, comes_up: bool = True, token: str = TOKEN) -> None:
        self.port, self.name, self.status = port, "", ""
        self.has_all = False  # that was there when it came
        self.commands: dict[Any, Any]
        self.elements: dict[Any, Any]
        self.gizmos: list[Any]
        self.values: dict[Any, Any]
        self.elements, self.gizmos, self.commands, self.values = {}, [], {}, {}
        self.socket = connect(
            f"ws://127.0.0.1:{port}/?token={token}",
            origin=Origin(f"http://127.0.0.1:{port}"),
            compression=None,
            subprotocols=[Subprotocol(f"viser-v{viser.__version__}")],
            max_size=None,
            close_timeout=1,
        )
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        if comes_up:
            self.say(CAMERA)
            until(lambda: self.name and self.has_all, "the page comes up")

    def __enter__(self) -> "PageClient":
        return self

    def __exit__(self, *error: None) -> None:
        self.close()

    def say(self, message: Mapping[str, object]) -> None:
        """Send a message, or bytes as they are; what has been cut off says nothing."""
        self.raw(msgspec.msgpack.encode(message))

    def raw(self, data: bytes | str) -> None:
        """Send bytes, or a text."""
        try:
            self.socket.send(data)
        except (ConnectionClosed, OSError):
            self.is_cut = True

    is_cut = False

    def set(self, uuid: str, /, **updates: object) -> None:
        """Update an element as viser's page does."""
        self.say({"type": "GuiUpdateMessage", "uuid": uuid, "updates": updates})

    def click(self, label: str) -> None:
        """Press a button."""
        self.set(self.elements[label], value=True)

    def drag(
        self,
        position: Sequence[float] = (0.0, -0.06, -0.08),
        wxyz: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0),
        **more: object,
    ) -> None:
        """Say where the first gizmo shall be."""
        self.say({"type": "TransformControlsUpdateMessage", "name": self.gizmos[0],
                  "wxyz": wxyz, "position": position, "owner": ""} | more)  # fmt: skip

    def ask(self, path: str, **headers: Any) -> tuple[int, Any]:
        """Status and body of an answer, as the page's own script asks."""
        return ask(self.port, path, Teleop_Page=self.name or "new", **headers)

    def sync(self) -> None:
        """Wait until all that was said before has been judged, or this page is cut off."""
        with suppress(ConnectionClosed, OSError):
            heard = self.socket.ping()
            until(lambda: heard.wait(0.01) or self.is_cut, "the answer to a ping")

    def close(self) -> None:
        """Go."""
        self.socket.socket.close()

    def _read(self) -> None:
        try:
            for data in self.socket:
                assert isinstance(data, bytes)
                size = int.from_bytes(data[8:16], "little")
                inner = zstandard.ZstdDecompressor().decompress(data[16 : 16 + size])
                for message in msgspec.msgpack.decode(inner)["messages"]:
                    self._take(message)
        except (ConnectionClosed, OSError):
            pass
        finally:
            self.is_cut = True

    def _take(self, message: Mapping[str, Any]) -> None:
        kind = message["type"]
        content = message.get("updates", message.get("props", {})).get("content", "")
        if "t-status" in content:
            self.status = content
        if kind == "ReplayDoneMessage":
            self.has_all = True
        elif kind == "TransformControlsMessage":
            self.gizmos.append(message["name"])
        elif kind == "RegisterCommandMessage":
            self.commands[message["props"]["label"]] = message["uuid"]
        elif kind == "RunJavascriptMessage" and "teleopPage" in message["source"]:
            self.name = message["source"].split("'")[1]
        elif kind == "GuiUpdateMessage" and "value" in message["updates"]:
            self.values.setdefault(message["uuid"], []).append(message["updates"]["value"])
        elif kind.startswith("Gui") and "props" in message and "label" in message["props"]:
            self.elements[message["props"]["label"]] = message["uuid"]


def ask(port: int, path: str, *, token: str = TOKEN, **headers: str) -> Any:
    """Status and body of an answer to a request with a token, as a browser keeps it, and some headers."""
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=20)
    told = {"Cookie": f"teleop_console_{port}={token}"} | {n.replace("_", "-"): v for n, v in headers.items()}
    connection.request("GET", path, headers=told)
    answer = connection.getresponse()
    body = answer.read()
    connection.close()
    is_json = answer.headers.get("Content-Type") == "application/json"
    return answer.status, json.loads(body) if is_json else body
