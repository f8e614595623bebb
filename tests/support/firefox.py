"""Firefox: the same tab in a Firefox, whose WebDriver BiDi answers to the commands of DevTools that tests use."""

import json
import os
import re
import shutil
import subprocess
from itertools import count
from pathlib import Path
from typing import Any

import pytest
from websockets.sync.client import connect

from browser import Tab
from headless import SILENCE

BROWSERS = ("firefox-esr", "firefox")
SCREEN = "xvfb-run"
"""Without a screen Firefox draws no WebGL: it gets one in memory."""
PREFERENCES = {
    "webgl.force-enabled": True,
    "dom.w3c_touch_events.enabled": 1,
    "browser.shell.checkDefaultBrowser": False,
}
KEYS = {
    "Enter": "\ue007", "Tab": "\ue004", "Escape": "\ue00c", "Home": "\ue011", "End": "\ue010", "ArrowLeft": "\ue012",
    "ArrowUp": "\ue013", "ArrowRight": "\ue014", "ArrowDown": "\ue015",
}  # fmt: skip
MOVES = {"mouseMoved": "pointerMove", "mousePressed": "pointerDown", "mouseReleased": "pointerUp"}


class Firefox(Tab):
    """One tab of a Firefox of its own; the test is skipped where there is none."""

    has_focus = False  # no window manager makes its window the active one

    def __init__(self, folder: Path, width: int = 1400, height: int = 900) -> None:
        browser = next(filter(None, map(shutil.which, BROWSERS)), None)
        if browser is None or shutil.which(SCREEN) is None:
            pytest.skip(f"needs one of {', '.join(BROWSERS)}, and {SCREEN}")
        profile = folder / "profile"
        profile.mkdir(parents=True)
        lines = (f'user_pref("{name}", {json.dumps(value)});\n' for name, value in PREFERENCES.items())
        (profile / "user.js").write_text("".join(lines))
        words = [SCREEN, "-a", "-s", f"-screen 0 {max(width, 1400)}x{max(height, 1000)}x24", browser, "--no-remote"]
        process: Any = subprocess.Popen(
            [*words, "--profile", str(profile), "--remote-debugging-port", "0"],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            env=os.environ | {"MOZ_CRASHREPORTER_DISABLE": "1"},
        )
        self._process, self._said = process, process.stderr
        found = (re.search(r"ws://\S+", line) for line in process.stderr)
        self._socket = connect(next(filter(None, found))[0] + "/session", max_size=None, ping_interval=None)
        self._numbers, self._touches = count(1), list[Any]()
        self.said, self.errors, self.asked, self.answers = [], [], [], {}
        self._say("session.new", capabilities={})
        self._context = self._say("browsingContext.getTree")["contexts"][0]["context"]
        self._say("session.subscribe", events=["log.entryAdded", "network.responseCompleted"])
        self.resize(width, height)

    def __exit__(self, *error: object) -> None:
        self._say("browser.close")
        self._socket.close()
        self._process.wait(30)
        self._said.close()

    def _say(self, method: str, **parameters: Any) -> Any:
        """Answer to a command of BiDi."""
        number = next(self._numbers)
        self._socket.send(json.dumps({"id": number, "method": method, "params": parameters}))
        while True:
            told = json.loads(self._socket.recv(timeout=SILENCE))
            if told.get("id") == number:
                assert told["type"] == "success", f"{method}: {told}"
                return told["result"]
            self._hear(told)

    def _hear(self, told: Any) -> None:
        event = told.get("params", {})
        if told.get("method") == "log.entryAdded":
            self.said.append(event["text"])
            if event["level"] == "error":
                self.errors.append(event["text"])
        elif told.get("method") == "network.responseCompleted":
            self.asked.append(event["request"]["url"])
            self.answers[event["request"]["url"]] = event["response"]["status"]

    def call(self, method: str, **told: Any) -> Any:
        """Do what a command of DevTools asks for."""
        return getattr(self, f"_{method.partition('.')[2]}")(told)

    def _navigate(self, told: Any) -> None:
        self._say("browsingContext.navigate", context=self._context, url=told["url"], wait="interactive")

    def _reload(self, _: Any) -> None:
        self._say("browsingContext.reload", context=self._context, wait="none")

    def _setDeviceMetricsOverride(self, told: Any) -> None:
        size = {"width": told["width"], "height": told["height"]}
        self._say("browsingContext.setViewport", context=self._context, viewport=size, devicePixelRatio=1.0)

    def _captureScreenshot(self, _: Any) -> Any:
        return self._say("browsingContext.captureScreenshot", context=self._context)

    def _evaluate(self, told: Any) -> Any:
        where = {"context": self._context}
        found = self._say("script.evaluate", expression=told["expression"], target=where, awaitPromise=True)
        if found["type"] == "exception":
            return {"exceptionDetails": found["exceptionDetails"]["text"]}
        return {"result": {"value": plain(found["result"])}}

    def _act(self, **source: Any) -> None:
        self._say("input.performActions", context=self._context, actions=[source])

    def _dispatchMouseEvent(self, told: Any) -> None:
        place = {"x": round(told["x"]), "y": round(told["y"])}
        if told["type"] == "mouseWheel":
            turn = {"type": "scroll", "deltaX": told["deltaX"], "deltaY": told["deltaY"], **place}
            self._act(type="wheel", id="wheel", actions=[turn])
            return
        kind = MOVES[told["type"]]
        acts: list[Any] = [{"type": "pointerMove", **place}]
        is_second = told.get("clickCount") == 2  # a double click is one act: two that come late are none
        if is_second and kind == "pointerUp":
            acts += [{"type": one, "button": 0} for one in ("pointerDown", "pointerUp") * 2]
        elif kind != "pointerMove" and not is_second:
            acts.append({"type": kind, "button": 0})
        self._act(type="pointer", id="mouse", actions=acts)

    def _dispatchKeyEvent(self, told: Any) -> None:
        kind = {"keyDown": "keyDown", "keyUp": "keyUp"}[told["type"]]
        self._act(type="key", id="keys", actions=[{"type": kind, "value": KEYS.get(told["key"], told["key"])}])

    def _insertText(self, told: Any) -> None:
        acts = [{"type": kind, "value": letter} for letter in told["text"] for kind in ("keyDown", "keyUp")]
        self._act(type="key", id="keys", actions=acts)

    def _dispatchTouchEvent(self, told: Any) -> None:
        kind, points = told["type"], told["touchPoints"]
        ends = {"touchStart": ["pointerMove", "pointerDown"], "touchMove": ["pointerMove"], "touchEnd": ["pointerUp"]}
        sources = []
        for number, point in enumerate(points or self._touches):
            place = {"x": round(point["x"]), "y": round(point["y"])}
            acts = [{"type": one, **(place if one == "pointerMove" else {"button": 0})} for one in ends[kind]]
            sources.append(
                {"type": "pointer", "id": f"finger{number}", "parameters": {"pointerType": "touch"}, "actions": acts}
            )
        self._touches = points
        self._say("input.performActions", context=self._context, actions=sources)


def plain(told: Any) -> Any:
    """Value that BiDi tells with its types."""
    kind, value = told["type"], told.get("value")
    if kind in {"array", "nodelist", "htmlcollection"}:
        return [plain(one) for one in value]
    if kind == "object":
        return {name: plain(one) for name, one in value or ()}  # deeper than BiDi tells: none
    if kind == "number" and isinstance(value, str):
        return float(value.replace("Infinity", "inf"))
    return value
