"""Camera pictures: the cameras of a session on the page, as insets, or one of them in place of the scene."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import viser
from viser import _messages

from teleop_console.picture_streams import Picture, age_text
from teleop_console.scene import Scene

SCENE = "3-D scene"
"""Choice of the main view that shows no camera."""
LATE = 0.5
"""Age from which a picture counts as late [s]; its age is then told in capitals."""
_BLANK = np.full((48, 64, 3), 128, np.uint8)


class CameraPictures:
    """Controls and pictures in the present container of the page; they appear with the first picture of a camera.

    Args:
        server: The page.
        scene: Scene of the page, which gives way to a camera in the main view.
    """

    def __init__(self, server: viser.ViserServer, scene: Scene) -> None:
        self._server, self._scene = server, scene
        self._folder = server.gui.add_folder("cameras", visible=False)
        with self._folder:
            self._main = server.gui.add_dropdown(
                "main view", (SCENE,), initial_value=SCENE, hint="a camera fills the page: drive by its picture alone"
            )
        self._age: viser.GuiHtmlHandle | None = None
        self._images: dict[str, viser.GuiImageHandle] = {}
        self._shown: dict[str, int] = {}
        self._in_main = SCENE

    def draw(self, pictures: Mapping[str, Picture]) -> None:
        """Show new pictures, and the age of each."""
        for name, picture in pictures.items():
            image = self._images.get(name) or self._add(name)
            image.label = f"{name} · {age_text(picture.age)}"
            if self._shown.get(name) == picture.stamp_ns:
                continue
            self._shown[name] = picture.stamp_ns
            held: Any = image
            held._format, held._data = picture.form, picture.data  # the bytes as they came: nothing is encoded again
            if name == self._main.value:
                self._fill(picture)
        self._choose(pictures.get(self._main.value))

    def _add(self, name: str) -> viser.GuiImageHandle:
        with self._folder:
            self._images[name] = self._server.gui.add_image(_BLANK, label=name)
        self._folder.visible = True
        self._main.options = (SCENE, *self._images)
        return self._images[name]

    def _fill(self, picture: Picture) -> None:
        """Show a picture behind all that the scene shows."""
        background = _messages.BackgroundImageMessage(format=picture.form, rgb_data=picture.data, depth_data=None)  # type: ignore[arg-type]
        scene: Any = self._server.scene
        scene._websock_interface.queue_message(background)

    def _choose(self, picture: Picture | None) -> None:
        """Hide the scene while a camera is in the main view, and tell the age of its picture there."""
        chosen = self._main.value
        if chosen != self._in_main:
            self._in_main = chosen
            self._scene.give_way(is_hidden=chosen != SCENE)
            if picture is not None:
                self._fill(picture)
            else:
                self._server.scene.set_background_image(None)
        text = ""
        if picture is not None:
            age = age_text(picture.age)
            text = f'<p class="t-role">{chosen}: {age.upper() if picture.age > LATE else age}</p>'
        if self._age is None and text:
            self._age = self._server.gui.add_html(text, order=-9.0)  # above the tabs, as it is needed to drive
        elif self._age is not None and self._age.content != text:
            self._age.content = text
