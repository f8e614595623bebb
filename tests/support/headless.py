"""Headless: a Chromium without a screen, driven through its debugging pipe."""

import base64
import json
import os
import select
import subprocess
from itertools import count
from pathlib import Path
from typing import Any

FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader", "--disable-quic",
    "--no-first-run", "--disable-background-networking", "--disable-component-update",
    "--disable-sync", "--disable-extensions", "--hide-scrollbars",
    "--host-resolver-rules=MAP * ~NOTFOUND", "--remote-debugging-pipe",
)  # fmt: skip
SILENCE = 200.0
"""Time after which a browser that does not answer has failed, [s]."""


class Headless:
    """One tab; everything it says on the console is in ``said``."""

    def __init__(self, browser: str, folder: Path, width: int = 1200, height: int = 900, flags: Any = FLAGS) -> None:
        (read_here, write_there), (read_there, write_here) = os.pipe(), os.pipe()

        def connect() -> None:  # Chromium reads descriptor 3 and writes descriptor 4
            one, other = os.dup(read_there), os.dup(write_there)
            os.dup2(one, 3)
            os.dup2(other, 4)

        command = [browser, *flags, f"--user-data-dir={folder / 'profile'}", "about:blank"]
        self._process = subprocess.Popen(  # its two descriptors have fixed numbers
            command,
            preexec_fn=connect,  # noqa: PLW1509
            close_fds=False,
            stderr=subprocess.DEVNULL,
        )
        os.close(read_there)
        os.close(write_there)
        self._in, self._out, self._heard = read_here, os.fdopen(write_here, "wb"), b""
        self.said: list[Any]
        self._numbers, self._session, self.said = count(1), None, []
        targets = self.call("Target.getTargets")["targetInfos"]
        page = next(target["targetId"] for target in targets if target["type"] == "page")
        attached = self.call("Target.attachToTarget", targetId=page, flatten=True)
        self._session = attached["sessionId"]
        for domain in ("Page", "Runtime"):
            self.call(f"{domain}.enable")
        self.resize(width, height)

    def __enter__(self) -> "Headless":
        return self

    def __exit__(self, *error: object) -> None:
        self._session = None
        self.call("Browser.close")
        self._process.wait(30)
        os.close(self._in)
        self._out.close()

    def call(self, method: str, **parameters: object) -> Any:
        """Answer to a command of the DevTools protocol."""
        number = next(self._numbers)
        message = {"id": number, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        self._out.write(json.dumps(message).encode() + b"\0")
        self._out.flush()
        while True:
            answer = json.loads(self._read())
            if answer.get("id") == number:
                assert "error" not in answer, f"{method}: {answer['error']}"
                return answer["result"]
            self._note(answer)

    def _read(self) -> bytes:
        while b"\0" not in self._heard:
            assert select.select([self._in], [], [], SILENCE)[0], "the browser is silent"
            more = os.read(self._in, 1 << 16)
            assert more, "the browser has gone"
            self._heard += more
        message, _, self._heard = self._heard.partition(b"\0")
        return message

    def _note(self, event: Any) -> None:
        if event.get("method") == "Runtime.exceptionThrown":
            details = event["params"]["exceptionDetails"]
            self.said.append(details.get("exception", {}).get("description", details["text"]))
        if event.get("method") == "Runtime.consoleAPICalled":
            texts = [str(a.get("value", a.get("description"))) for a in event["params"]["args"]]
            self.said.append(" ".join(texts))

    def resize(self, width: int, height: int) -> None:
        """Size of the window, [px]."""
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)

    def value(self, script: str) -> Any:
        """Value of an expression in the page; promises are waited for."""
        answer = self.call("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def open(self, file: Any) -> None:
        """Open a report page and wait until it has drawn everything."""
        self.call("Page.navigate", url=file.as_uri())
        self.until("document.body && (document.body.dataset.finished || document.body.dataset.errors)")

    def until(self, condition: object, seconds: float = 60) -> None:
        """Wait until an expression is true, but not for ever."""
        self.value(
            "new Promise((done, fail) => { const end = performance.now() + "
            f"{1000 * seconds}; const look = () => ({condition}) ? done(true) : "
            "performance.now() > end ? fail(new Error('waited in vain')) : setTimeout(look, 20); "
            "look(); })"
        )

    def settled(self) -> None:
        """Wait until no plot is behind the visible time."""
        self.until("[...document.querySelectorAll('.times')].every((bar) => !bar.dataset.busy)")

    def mouse(self, kind: str, x: Any, y: Any, clicks: int = 1) -> None:
        """Move, press or release the left button, in pixels of the window."""
        button = "none" if kind == "mouseMoved" else "left"
        self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button=button,
                  buttons=int(kind != "mouseReleased"), clickCount=clicks)  # fmt: skip

    def drag(self, begin: Any, end: Any) -> None:
        """Drag from one point to another."""
        self.mouse("mouseMoved", *begin)
        self.mouse("mousePressed", *begin)
        for share in (0.3, 0.7, 1.0):
            point = [a + share * (b - a) for a, b in zip(begin, end, strict=True)]
            self.mouse("mouseMoved", *point)
        self.mouse("mouseReleased", *end)

    def picture(self, file: Any, clip: Any = None) -> None:
        """Screenshot of the page, or of a part of it: left, top, width and height [px]."""
        size = self.call("Page.getLayoutMetrics")["cssContentSize"]
        left, top, width, height = clip or (0, 0, size["width"], size["height"])
        part = {"x": left, "y": top, "width": width, "height": height, "scale": 1}
        shot = self.call("Page.captureScreenshot", captureBeyondViewport=True, clip=part)
        file.write_bytes(base64.b64decode(shot["data"]))
