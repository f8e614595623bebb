"""View tab: what the page shows, and from where; for each browser its own camera, and its role.

Insets are small pictures beside the scene. A browser that shows the page renders them and sends
them here, and all pages show them; without a browser there are none. They cost that browser a
further picture each, so they are off at first and rare.
"""

import threading
import time
from collections.abc import Callable, Mapping

import numpy as np
import viser

from teleop_console.cameras import FIELD, Camera
from teleop_console.drivers import Drivers
from teleop_console.filter import PICTURE
from teleop_console.hooks import Server
from teleop_console.scene import Scene


class ViewTab:
    """Controls of the scene in the present container of the page.

    Args:
        server: The page.
        scene: What they control.
    """

    def __init__(self, server: Server, scene: Scene) -> None:
        self._server, self._scene = server, scene
        gui = server.gui
        with gui.add_folder("camera"):
            self._camera("Work", "tips and styli, as near as they fit", scene.work)
            self._camera("Whole", "all arms and their masters", scene.whole)
            self._camera("From the tool", "as the tool of the first arm sees it now", scene.tool)
            self._camera("Microscope", "fixed, over where the tip starts", scene.microscope)
        with gui.add_folder("show"):
            self._box("frames", False, scene.show_frames, "axes of all bodies")
            self._box("reference posture", False, scene.show_ghost, "where the setpoints are")
            self._box("paths", True, scene.show_tails, "of the tip, wanted and measured, 10 s")
            self._box("dark", False, self._darken, "dark page")

    def _camera(self, label: str, hint: str, find: Callable[[], Camera]) -> None:
        button = self._server.gui.add_button(label, hint=hint, color="gray")
        self._server.make_public(button)

        @button.on_click
        def _(event: viser.GuiEvent[viser.GuiButtonHandle]) -> None:
            if event.client is not None:
                find().give(event.client)

    def _box(self, label: str, is_on: bool, show: Callable[[bool], None], hint: str) -> None:
        box = self._server.gui.add_checkbox(label, is_on, hint=hint)
        box.on_update(lambda _: show(box.value))

    def _darken(self, is_dark: bool) -> None:
        theme(self._server, is_dark=is_dark)
        self._scene.set_dark(is_dark=is_dark)


def theme(server: viser.ViserServer, *, is_dark: bool) -> None:
    """Take colours and layout of the page; what would reach other hosts is left out."""
    server.gui.configure_theme(
        control_layout="floating", control_width="medium", dark_mode=is_dark, show_logo=False, show_share_button=False
    )


PERIOD = 0.5
"""Time between two pictures of an inset [s]."""
_PATIENCE = 10.0  # for a browser that does not answer [s]


class Insets:
    """Controls and pictures in the present container of the page.

    Args:
        server: The page.
        scene: What is seen.
    """

    def __init__(self, server: viser.ViserServer, scene: Scene) -> None:
        self._server, gui = server, server.gui
        self._cameras: Mapping[str, Callable[[], Camera]] = {
            "from the tool": scene.tool,
            "microscope": scene.microscope,
        }
        blank = np.full((*PICTURE, 3), 128, np.uint8)
        self._ends = threading.Event()
        self._thread: threading.Thread | None = None
        with gui.add_folder("picture in picture"):
            self._is_on = gui.add_checkbox("show", False, hint="twice a second, rendered by one of the browsers")
            self._images = {name: gui.add_image(blank, label=name, visible=False) for name in self._cameras}
        self._is_on.on_update(lambda event: self.show(event.target.value))

    def show(self, is_shown: bool) -> None:
        """Begin with pictures, or end with them."""
        for image in self._images.values():
            image.visible = is_shown
        if self._thread is not None:
            self._ends.set()
            self._thread = None
        if is_shown:
            self._ends = threading.Event()
            self._thread = threading.Thread(target=self._render, args=(self._ends,), name="console insets", daemon=True)
            self._thread.start()

    def _render(self, ends: threading.Event) -> None:
        while not ends.wait(PERIOD):
            client = next(iter(self._server.get_clients().values()), None)
            if client is None:
                continue
            for name, find in self._cameras.items():
                camera = find()
                try:
                    picture = client.get_render(
                        *PICTURE,
                        wxyz=camera.quaternion,
                        position=camera.position,
                        fov=FIELD,
                        timeout=_PATIENCE,
                        transport_format="png",
                    )
                except (TimeoutError, RuntimeError, OSError, ValueError, SyntaxError):
                    break  # the browser sleeps, has gone, or sends no picture
                if not ends.is_set():
                    self._images[name].image = picture


_SETTLING = 4.0  # until a window has its panel beside it [s]


class Visitors:
    """What each browser gets for itself.

    Args:
        server: The page.
        drivers: Who drives.
        scene: What is seen.
        is_live: Whether it is a session, and not a recording.
    """

    def __init__(self, server: viser.ViserServer, drivers: Drivers, scene: Scene, *, is_live: bool) -> None:
        self._server, self._drivers, self._scene, self._is_live = server, drivers, scene, is_live
        self._lines: dict[int, viser.GuiHtmlHandle] = {}
        self._fitted: dict[int, tuple[float, float]] = {}  # since when, for which picture

    def look(self) -> None:
        """Welcome who has come, and tell everybody whether he drives or watches."""
        clients = self._server.get_clients()
        for number, client in clients.items():
            text = f'<p class="t-role">{self._role(number)}</p>'
            self._fit(number, client)
            if number not in self._lines:
                self._lines[number] = client.gui.add_html(text, order=-10.0)
            elif self._lines[number].content != text:
                self._lines[number].content = text
        for number in self._lines.keys() - clients.keys():
            del self._lines[number], self._fitted[number]

    def _role(self, number: int) -> str:
        if self._is_live:
            return self._drivers.role(number)
        return f"replay: {'you play it' if self._drivers.may_drive(number) else 'another page plays it'}"

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
