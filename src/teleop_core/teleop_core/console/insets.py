"""Insets: small pictures beside the scene, from the tool and from the microscope.

A browser that shows the page renders them and sends them here, and all pages show them; without a
browser there are none. They cost that browser a further picture each, so they are off at first and
rare.
"""

import threading
from collections.abc import Callable, Mapping

import numpy as np
import viser

from teleop_core.console.cameras import FIELD, Camera
from teleop_core.console.filter import PICTURE
from teleop_core.console.scene import Scene

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
            "from the tool": scene.tool, "microscope": scene.microscope
        }  # fmt: skip
        blank = np.full((*PICTURE, 3), 128, np.uint8)
        self._ends = threading.Event()
        self._thread: threading.Thread | None = None
        with gui.add_folder("picture in picture"):
            self._is_on = gui.add_checkbox(
                "show", False, hint="twice a second, rendered by one of the browsers"
            )
            self._images = {
                name: gui.add_image(blank, label=name, visible=False) for name in self._cameras
            }
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
            self._thread = threading.Thread(
                target=self._render, args=(self._ends,), name="console insets", daemon=True
            )
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
                        *PICTURE, wxyz=camera.quaternion, position=camera.position, fov=FIELD,
                        timeout=_PATIENCE, transport_format="png",
                    )  # fmt: skip
                except (TimeoutError, RuntimeError, OSError, ValueError, SyntaxError):
                    break  # the browser sleeps, has gone, or sends no picture
                if not ends.is_set():
                    self._images[name].image = picture
