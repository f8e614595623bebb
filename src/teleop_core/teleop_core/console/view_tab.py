"""View tab: what the page shows, and from where; for each browser its own camera."""

from collections.abc import Callable

import viser

from teleop_core.console.cameras import Camera
from teleop_core.console.hooks import Server
from teleop_core.console.scene import Scene


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
        control_layout="floating", control_width="medium", dark_mode=is_dark, show_logo=False,
        show_share_button=False,
    )  # fmt: skip
