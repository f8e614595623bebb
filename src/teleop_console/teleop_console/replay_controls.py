"""Replay controls: time, speed, pause and steps of a recording, on the page."""

import viser

from teleop_console.recorded import SPEEDS, RecordedLink

_STEP = 1e-3  # of the slider [s]


class ReplayControls:
    """Controls in the present container of the page.

    Args:
        server: The page.
        link: The recording.
    """

    def __init__(self, server: viser.ViserServer, link: RecordedLink) -> None:
        self._link, gui = link, server.gui
        self._drawn, self._text = -1.0, ""
        with gui.add_folder("replay", order=-0.5):
            self._slider = gui.add_slider(
                "time", 0.0, max(link.duration, _STEP), _STEP, link.time, hint="seconds since the recording began"
            )
            self._play = gui.add_button("Play", hint="from here on; the P key too")
            self._steps = gui.add_button_group("step", ("−1 s", "−1", "+1", "+1 s"))
            self._speed = gui.add_dropdown(
                "speed",
                [f"{speed:g}" for speed in SPEEDS],
                initial_value=f"{link.speed:g}",
                hint="time of the recording per time that passes",
            )
            self._loop = gui.add_checkbox("loop", link.loop, hint="begin again at the end")
            self._told = gui.add_markdown("")
        self._listen(gui)

    def _listen(self, gui: viser.GuiApi) -> None:
        self._slider.on_update(self._seek)
        self._play.on_click(lambda _: self.toggle())
        self._steps.on_click(lambda event: self._step(event.target.value))
        self._speed.on_update(lambda event: setattr(self._link, "speed", float(event.target.value)))
        self._loop.on_update(lambda event: setattr(self._link, "loop", event.target.value))
        command = gui.add_command("Play or pause", description="the replay", hotkey="P")
        command.on_trigger(lambda _: self.toggle())

    def _seek(self, event: viser.GuiEvent[viser.GuiSliderHandle[float]]) -> None:
        if event.client_id is not None:  # by a person, not by draw()
            self._link.seek(event.target.value)

    def _step(self, label: str) -> None:
        if label.endswith("s"):
            self._link.pause()
            self._link.seek(self._link.time + (1.0 if label[0] == "+" else -1.0))
        else:
            self._link.step(1 if label[0] == "+" else -1)

    def toggle(self) -> None:
        """Play where it is held, and the other way round."""
        if self._link.is_playing:
            self._link.pause()
        else:
            self._link.play()

    def draw(self) -> None:
        """Show what the time is now."""
        link = self._link
        if abs(link.time - self._drawn) >= _STEP:
            self._drawn = link.time
            self._slider.value = round(link.time, 3)  # type: ignore[misc]  # viser sets by hand
        text = f"{link.time:.2f} s of {link.duration:.2f} s"
        if link.thinning > 1:
            text += f"; one of {link.thinning} samples"
        if text != self._text:
            self._text = self._told.content = text
        label = "Pause" if link.is_playing else "Play"
        if self._play.label != label:  # last: what is held shows its time already
            self._play.label = label
