"""View tab: the visible parts of the scene, and the camera and the role of each browser.

Insets are small pictures beside the scene. One of the browsers renders them and sends them to the server, and all pages
show them. For each inset this browser renders one more picture, so insets are off by default and updated rarely.
"""

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import viser

from teleop_console.cameras import FIELD, Camera
from teleop_console.drivers import Drivers
from teleop_console.filter import PICTURE
from teleop_console.hooks import Server
from teleop_console.scene import Scene
from teleop_console.stylus import GRIP

_SHOWN = (
    ("frames", "axes", "axes of all bodies"),
    ("ghost", "ghost", "the commanded posture, at the setpoints"),
    ("reach", "reach", "reachable positions of the tip, from some thousand postures within the limits"),
    ("paths", "paths", "paths of the tip, wanted and measured, of the last 10 s"),
)


class ViewTab:
    """Controls of the scene in the present container of the page.

    Args:
        server: The page.
        scene: Scene of the page.
        visitors: Visitors whose cameras are moved.
    """

    def __init__(self, server: Server, scene: Scene, visitors: "Visitors") -> None:
        self._server, self._scene, self._visitors = server, scene, visitors
        gui = server.gui
        with gui.add_folder("camera"):
            self._camera("Work", "styli, and all that the tips have met: fixtures, objects, goals", None)
            self._camera("Whole", "all arms and their masters", scene.whole)
            self._camera("From the tool", "goes with the first arm's tool until another is chosen", scene.tool, True)
            self._camera("Microscope", "fixed camera above the start of the tip", scene.microscope)
        with gui.add_folder("show"):
            for label, what, hint in _SHOWN:
                self._box(label, what == "paths", partial(scene.show, what), hint)
            self._box("dark", False, self._darken, "dark page")

    def _camera(self, label: str, hint: str, find: Callable[[], Camera] | None, is_riding: bool = False) -> None:
        button = self._server.gui.add_button(label, hint=hint, color="gray")
        self._server.make_public(button)

        @button.on_click
        def _(event: viser.GuiEvent[viser.GuiButtonHandle]) -> None:
            if event.client is not None:
                self._visitors.give(event.client, find, is_riding=is_riding)

    def _box(self, label: str, is_on: bool, show: Callable[..., None], hint: str) -> None:
        box = self._server.gui.add_checkbox(label, is_on, hint=hint)
        box.on_update(lambda _: show(is_shown=box.value))

    def _darken(self, *, is_shown: bool) -> None:
        theme(self._server, is_dark=is_shown)
        self._scene.set_dark(is_dark=is_shown)


def theme(server: viser.ViserServer, *, is_dark: bool) -> None:
    """Set colours and layout of the page; elements that would load from other hosts are left out."""
    server.gui.configure_theme(
        control_layout="floating", control_width="medium", dark_mode=is_dark, show_logo=False, show_share_button=False
    )


PERIOD = 0.5
"""Time between two pictures of an inset [s]."""
_PATIENCE = 10.0  # longest wait for a browser that does not answer [s]


class Insets:
    """Controls and pictures in the present container of the page.

    Args:
        server: The page.
        scene: Scene of the page.
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
        self._told = ""

    def say(self, display: str) -> None:
        """Show rate and delay of the operator's display beside the pictures; an empty text without a display."""
        if display != self._told:
            self._told = display
            for name, image in self._images.items():
                image.label = " · ".join(filter(None, (name, display and f"display {display}")))

    def show(self, is_shown: bool) -> None:
        """Start or stop the pictures."""
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
                    break  # the browser sleeps, is closed, or sends no picture
                if not ends.is_set():
                    self._images[name].image = picture


_SETTLING = 4.0  # time until the panel of a new window has its final size [s]
_LOOK = 1.0  # time between two checks whether the work has left the picture [s]
_GROWN = 0.08  # smallest motion of a camera that counts as a new view, as a share of the viewing distance
_STILL = 1e-4  # smallest motion with which a camera follows a body, as a share of the viewing distance


@dataclass(frozen=True)
class _Fit:
    """View of one browser's camera.

    Attributes:
        since: Time at which the page was opened [s].
        aspect: Width of the browser's picture divided by its height.
        looked: Time at which the picture was last compared with the work [s].
        camera: Camera that was last set for the browser.
        is_own: Whether the person at the browser has chosen another view.
    """

    since: float
    aspect: float = 0.0
    looked: float = 0.0
    camera: Camera | None = None
    is_own: bool = False


def _is_moved(client: viser.ClientHandle, given: Camera) -> bool:
    """Whether a person has moved the camera since it was last set."""
    camera = client.camera
    now = Camera(np.asarray(camera.position), np.asarray(camera.look_at), given.up)
    return now.is_elsewhere(given, _GROWN)


class Visitors:
    """Elements that each browser gets separately.

    Args:
        server: The page.
        drivers: Object that knows which page drives.
        scene: Scene of the page.
        is_live: Whether the page shows a live session; false for a recording.
    """

    def __init__(self, server: Server, drivers: Drivers, scene: Scene, *, is_live: bool) -> None:
        self._server, self._drivers, self._scene, self._is_live = server, drivers, scene, is_live
        self._lines: dict[int, viser.GuiHtmlHandle] = {}
        self._fitted: dict[int, _Fit] = {}
        self._riding: dict[int, Callable[[], Camera]] = {}
        self._grips: dict[int, tuple[bool, float]] = {}

    def look(self) -> None:
        """Add the elements of new pages, and show on every page whether the page drives or watches."""
        clients = self._server.get_clients()
        for number, client in clients.items():
            text = f'<p class="t-role">{self._role(number)}</p>'
            self._fit(number, client)
            self._show_grips(number)
            if number not in self._lines:
                self._lines[number] = client.gui.add_html(text, order=-10.0)
            elif self._lines[number].content != text:
                self._lines[number].content = text
        for number in self._lines.keys() - clients.keys():
            del self._lines[number], self._fitted[number], self._grips[number]
            self._riding.pop(number, None)

    def give(self, client: viser.ClientHandle, find: Callable[[], Camera] | None, *, is_riding: bool = False) -> None:
        """Set the camera of a browser.

        Args:
            client: The browser.
            find: Function that returns the camera; None for a camera that shows the whole work.
            is_riding: Whether the camera follows a moving body.
        """
        number, now = client.client_id, time.monotonic()
        camera = None if find is None else find()
        self._riding.pop(number, None)
        if find is not None and is_riding:
            self._riding[number] = find
        if camera is not None:
            camera.give(client)
        self._fitted[number] = _Fit(now - _SETTLING, camera=camera, is_own=camera is not None)

    def _role(self, number: int) -> str:
        if self._is_live:
            return self._drivers.role(number)
        return f"replay: {'you play it' if self._drivers.may_drive(number) else 'another page plays it'}"

    def _show_grips(self, number: int) -> None:
        """Show the handles of the styli on a page that may drive; on other pages the handles are hidden each time.

        This is needed because viser shows the handles again on all pages, including pages that only watch.
        """
        may_drive, now = self._drivers.may_drive(number), time.monotonic()
        before, told = self._grips.setdefault(number, (True, -_LOOK))
        if may_drive == before and (may_drive or now - told < _LOOK):
            return
        self._grips[number] = (may_drive, now)
        for node in self._scene.masters.values():
            self._server.show_on(number, f"{node}/{GRIP}", is_shown=may_drive)

    def _fit(self, number: int, client: viser.ClientHandle) -> None:
        """Point the camera of a new page at the work, and again when the window's size changes or the work grows."""
        now, aspect = time.monotonic(), client.camera.aspect
        fit = self._fitted.setdefault(number, _Fit(now))
        if (find := self._riding.get(number)) is not None:
            camera = find()
            if fit.camera is None or camera.is_elsewhere(fit.camera, _STILL):
                camera.give(client)
                self._fitted[number] = replace(fit, camera=camera)
            return
        is_settling = now - fit.since < _SETTLING and abs(aspect - fit.aspect) > 0.02 * aspect
        if not is_settling and (now - fit.looked < _LOOK or fit.is_own):
            return
        camera, given = self._scene.work(aspect), fit.camera
        is_moved = given is not None and not is_settling and _is_moved(client, given)
        if given is None or is_settling or (not is_moved and camera.is_elsewhere(given, _GROWN)):
            camera.give(client)
            given = camera
        self._fitted[number] = replace(fit, aspect=aspect, looked=now, camera=given)

    def close(self) -> None:
        """Remove the elements of all pages."""
        for line in self._lines.values():
            line.remove()
        self._lines.clear()
