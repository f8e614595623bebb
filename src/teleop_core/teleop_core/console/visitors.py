"""Visitors: the browsers on the page; each has a camera that fits its window, and a role."""

import time

import viser

from teleop_core.console.drivers import Drivers
from teleop_core.console.scene import Scene

_SETTLING = 4.0  # until a window has its panel beside it [s]


class Visitors:
    """What each browser gets for itself.

    Args:
        server: The page.
        drivers: Who drives.
        scene: What is seen.
    """

    def __init__(self, server: viser.ViserServer, drivers: Drivers, scene: Scene) -> None:
        self._server, self._drivers, self._scene = server, drivers, scene
        self._lines: dict[int, viser.GuiHtmlHandle] = {}
        self._fitted: dict[int, tuple[float, float]] = {}  # since when, for which picture

    def look(self) -> None:
        """Welcome who has come, and tell everybody whether he drives or watches."""
        clients = self._server.get_clients()
        for number, client in clients.items():
            text = f'<p class="t-role">{self._drivers.role(number)}</p>'
            self._fit(number, client)
            if number not in self._lines:
                self._lines[number] = client.gui.add_html(text, order=-10.0)
            elif self._lines[number].content != text:
                self._lines[number].content = text
        for number in self._lines.keys() - clients.keys():
            del self._lines[number], self._fitted[number]

    def _fit(self, number: int, client: viser.ClientHandle) -> None:
        """Show the whole to who has come, again where the window finds its size a moment later."""
        now, aspect = time.monotonic(), client.camera.aspect
        since, known = self._fitted.get(number, (now, 0.0))
        if abs(aspect - known) > 0.02 * aspect and now - since < _SETTLING:
            self._scene.work(aspect).give(client)
            self._fitted[number] = (since, aspect)

    def close(self) -> None:
        """Take the lines back."""
        for line in self._lines.values():
            line.remove()
        self._lines.clear()
