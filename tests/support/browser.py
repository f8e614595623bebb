"""Tab: a page with a 3-D scene in a real Chromium, used as people use it: by mouse and keys."""

import json
import os
import shutil
import socket
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from headless import Headless
from patience import wait_until

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
FLAGS = (
    "--headless", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
    "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--disable-extensions", "--hide-scrollbars",
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1, EXCLUDE localhost",
    "--remote-debugging-pipe",
)  # fmt: skip
# What Chromium says about the speed of software rendering; nothing is wrong then.
ADVICE = ("GL Driver Message", "Canvas2D: Multiple readback", "THREE.Clock")
KEYS = {
    " ": ("Space", 32), "Escape": ("Escape", 27), "Enter": ("Enter", 13), "Tab": ("Tab", 9),
    "Home": ("Home", 36), "End": ("End", 35),
    "ArrowLeft": ("ArrowLeft", 37), "ArrowRight": ("ArrowRight", 39), "ArrowDown": ("ArrowDown", 40),
}  # fmt: skip


def chromium() -> str:
    """Path of a browser; the test is skipped without one, in CI it fails."""
    found = next(filter(None, map(shutil.which, BROWSERS)), None)
    if found is None:
        reason = f"no browser to open the page with; install one of {', '.join(BROWSERS)}"
        (pytest.fail if os.environ.get("CI") else pytest.skip)(reason)
    return found


VIEWER = """(() => {
    let place = document.querySelector('canvas'), key;
    const isFiber = (name) => name.startsWith('__reactFiber');
    while (!(key = Object.keys(place).find(isFiber))) place = place.parentElement;
    let fiber = place[key];
    while (!(fiber.memoizedProps && fiber.memoizedProps.value
        && fiber.memoizedProps.value.mutable)) fiber = fiber.return;
    return fiber.memoizedProps.value.mutable.current;
})()"""
"""What viser's page holds: its camera, and its nodes by name."""


def both() -> list[Any]:
    """Both browsers, for a fixture that takes them as its parameter; CI has time for one."""
    return ["Tab", pytest.param("Firefox", marks=pytest.mark.soak)]


def opened(name: Any, folder: Path, width: int = 1400, height: int = 900) -> "Tab":
    """A tab of a browser of :func:`both`."""
    from firefox import Firefox

    return {"Tab": Tab, "Firefox": Firefox}[name](folder, width, height)


class Tab(Headless):
    """One tab of a browser of its own.

    ``errors`` are the errors on its console, ``asked`` the addresses it asked for anything, ``answers`` the status of
    each answer, ``has_focus`` whether its window is the active one, in which browsers show the focus.
    """

    has_focus = True

    def __enter__(self) -> "Tab":
        return self

    def __init__(self, folder: Path, width: int = 1400, height: int = 900) -> None:
        self.answers: dict[Any, Any]
        self.asked: list[Any]
        self.errors: list[Any]
        self.errors, self.asked, self.answers = [], [], {}
        super().__init__(chromium(), folder, width, height, FLAGS)
        for domain in ("Network", "Log"):
            self.call(f"{domain}.enable")

    def clear(self, width: int = 1400, height: int = 900) -> None:
        """Show nothing, in a window of a size, and forget what was before."""
        self.call("Page.navigate", url="about:blank")
        self.value("0")
        self.resize(width, height)
        for kept in (self.errors, self.asked, self.said):
            kept.clear()

    def visit(self, url: Any) -> None:
        """Open a page of a server and wait until its scene is there."""
        self.call("Page.navigate", url=url)
        self.until("document.querySelector('canvas')")

    def reload(self) -> None:
        """Load the page again."""
        self.value("window.isOld = true")
        self.call("Page.reload")
        self.until("!window.isOld && document.querySelector('canvas')")

    def shows(self, text: Any, seconds: float = 60) -> None:
        """Wait until a text can be read on the page."""
        self.until(f"document.body.innerText.includes({json.dumps(text)})", seconds)

    def click(self, text: Any) -> None:
        """Click what has this text: a button, a tab, a label."""
        self.shows(text)
        x, y = self.place(text)
        for kind in ("mouseMoved", "mousePressed", "mouseReleased"):
            self.mouse(kind, x, y)

    def place(self, text: Any) -> Any:
        """Middle of the last visible element with a text, once it rests and nothing covers it [px].

        A click there reaches it, or the promise fails.
        """
        return self.value(f"""(async () => {{
            const said = (e) => (e.innerText || e.value || e.ariaLabel || '').trim();
            const find = () => [...document.querySelectorAll(
                'button, [role], label, a, input, span, p')].filter(
                    (e) => said(e) === {json.dumps(text)} && e.getClientRects().length).at(-1);
            const end = performance.now() + 60000;
            for (let last = '', rests = 0; performance.now() < end;) {{
                await new Promise(requestAnimationFrame);
                const element = find();
                if (!element) continue;
                element.scrollIntoView({{block: 'nearest'}});
                const box = element.getBoundingClientRect();
                const x = box.x + box.width / 2, y = box.y + box.height / 2;
                rests = last === x + ' ' + y ? rests + 1 : 0;
                last = x + ' ' + y;
                const top = document.elementFromPoint(x, y);
                if (rests > 1 && top && (element.contains(top) || top.contains(element)))
                    return [x, y];
            }}
            throw new Error('nothing that can be clicked says ' + {json.dumps(text)});
        }})()""")

    def fill(self, label: Any, text: Any) -> None:
        """Write a text, in place of what stands there, into the field beside a label."""
        self.shows(label)
        self.value(f"""(() => {{
            let near = [...document.querySelectorAll('label, span, p, div')].filter((e) =>
                e.innerText.trim() === {json.dumps(label)} && e.getClientRects().length).at(-1);
            const field = (e) => e.querySelector('input:not([type=hidden]), textarea');
            while (!field(near)) near = near.parentElement;
            field(near).focus();
            field(near).select();
        }})()""")
        self.call("Input.insertText", text=text)

    def key(self, name: Any) -> None:
        """Press and release a key."""
        code, number = KEYS.get(name, (f"Key{name.upper()}", ord(name.upper()[0])))
        text = {"text": "\r" if name == "Enter" else name} if len(name) == 1 or name == "Enter" else {}
        for kind in ("keyDown", "keyUp"):
            self.call("Input.dispatchKeyEvent", type=kind, key=name, code=code, windowsVirtualKeyCode=number, **text)
            text = {}

    def tab_to(self, wanted: str) -> None:
        """Press Tab until what a selector names has the focus, which can be seen wherever it is in an active window."""
        for _ in range(60):
            self.key("Tab")
            unseen = self.value("""(({ activeElement: e, body }) => (e === body || e.matches('html')
                || getComputedStyle(e).outlineStyle !== 'none' ? '' : e.outerHTML.slice(0, 200)))(document)""")
            assert not (unseen and self.has_focus), f"its focus cannot be seen: {unseen}"
            if self.value(f"document.activeElement.matches({json.dumps(wanted)})"):
                return
        raise AssertionError(f"the Tab key does not lead to {wanted}")

    def pull(self, begin: Any, end: Any, steps: int = 20) -> None:
        """Drag slowly, as a hand does, from one point to another [px]; the button stays down."""
        self.mouse("mouseMoved", *begin)
        self.mouse("mousePressed", *begin)
        for point in np.linspace(begin, end, steps + 1)[1:]:
            self.mouse("mouseMoved", *point)
            self.value("new Promise(requestAnimationFrame)")

    def swipe(self, begin: Any, end: Any, steps: int = 20) -> None:
        """The same by a finger, which is lifted at the end."""
        points = np.linspace(begin, end, steps + 1)
        for kind, where in zip(["Start"] + ["Move"] * steps, points, strict=True):
            touched = [{"x": float(where[0]), "y": float(where[1])}]
            self.call("Input.dispatchTouchEvent", type=f"touch{kind}", touchPoints=touched)
            self.value("new Promise(requestAnimationFrame)")
        self.call("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])

    def seen_at(self, node: Any, point: Any) -> Any:
        """Pixel at which a point of a node of viser's scene is seen, both as they are drawn.

        Args:
            node: Name of the node.
            point: Place in its frame [m].
        """
        return self.value(f"""(() => {{
            const {{ camera, nodeRefFromName }} = {VIEWER};
            const node = nodeRefFromName[{json.dumps(node)}];
            node.updateWorldMatrix(true, false);
            const times = (m, v) => [0, 1, 2, 3].map((row) =>
                v.reduce((sum, part, i) => sum + m.elements[row + 4 * i] * part, 0));
            const [x, y, , w] = [node.matrixWorld, camera.matrixWorldInverse,
                camera.projectionMatrix].reduce((v, m) => times(m, v), {json.dumps([*point, 1.0])});
            const box = document.querySelector('canvas').getBoundingClientRect();
            return [box.x + box.width * (0.5 + 0.5 * x / w),
                    box.y + box.height * (0.5 - 0.5 * y / w)];
        }})()""")

    def place_of(self, node: Any) -> str:
        """Expression of the place of a node of viser's scene in its parent's frame [m]."""
        return f"{VIEWER}.nodeRefFromName[{json.dumps(node)}].position.toArray()"

    def faults(self) -> list[Any]:
        """Errors that mean something."""
        self.value("0")  # what was said before has been heard then
        return [line for line in self.errors if not any(advice in line for advice in ADVICE)]

    def hosts(self) -> set[Any]:
        """All hosts that the page asked for anything."""
        self.value("0")
        addresses = [url for url in self.asked if not url.startswith(("data:", "blob:"))]
        return {url.split("/")[2] for url in addresses}

    def _note(self, event: Any) -> None:
        super()._note(event)
        method, told = event.get("method"), event.get("params", {})
        if method == "Runtime.exceptionThrown" or told.get("type") in {"error", "assert"}:
            self.errors.append(self.said[-1])
        elif method == "Log.entryAdded" and told["entry"]["level"] == "error":
            self.errors.append(f"{told['entry']['text']} {told['entry'].get('url', '')}")
        elif method == "Network.requestWillBeSent":
            self.asked.append(told["request"]["url"])
        elif method == "Network.webSocketCreated":
            self.asked.append(told["url"])
        elif method == "Network.responseReceived":
            self.answers[told["response"]["url"]] = told["response"]["status"]


GRIP, ARROW, PULLED = "/arm/master/grip", 0.07, 0.012
"""The stylus' gizmo, how far its arrows reach, and a pull of a test [m]."""


def arrow(tab: Any, axis: int, way: float = PULLED) -> Any:
    """Where an arrow of the stylus is seen, and where it would be a way farther [px]."""
    begin, end = np.zeros(3), np.zeros(3)
    begin[axis], end[axis] = ARROW, ARROW + way
    return tab.seen_at(GRIP, begin), tab.seen_at(GRIP, end)


def until(condition: Callable[..., object], what: str, seconds: float = 60.0) -> bool:
    """Result of a condition as soon as it is true; for what happens outside of the browser."""
    return wait_until(condition, what, seconds)


def handshake(port: int, path: str = "/", **headers: Any) -> Any:
    """First line of the answer to the opening of a WebSocket, and the socket it came on."""
    opened = socket.create_connection(("127.0.0.1", port), timeout=20)
    told = {
        "Host": f"127.0.0.1:{port}",
        "Upgrade": "websocket",
        "Connection": "Upgrade",
        "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==",
        "Sec-WebSocket-Version": "13",
    }
    told |= {name.replace("_", "-"): value for name, value in headers.items()}
    lines = [f"GET {path} HTTP/1.1", *(f"{n}: {v}" for n, v in told.items() if v), "", ""]
    opened.sendall("\r\n".join(lines).encode())
    answer = b""
    while b"\r\n" not in answer:
        answer += opened.recv(1)
    return answer.decode().split("\r\n")[0], opened
