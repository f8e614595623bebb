"""Panel: the operator's controls: state, commands, save, settings, scores."""

import html
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from functools import partial
from typing import Literal

import viser

from teleop_console.controls import CONTROLS, Control
from teleop_console.drivers import Drivers
from teleop_console.history import LiveScores
from teleop_console.hooks import Server
from teleop_console.link import Parameters, SessionLink, View
from teleop_console.settings import Renew, SettingsPanel
from teleop_console.status import alive, leader, next_button, next_step, status_html
from teleop_core.base.errors import TeleopError

WIDTH = 320.0
"""Width of the panel on a desktop [px]; on a phone it is as wide as the screen."""
_PERIOD = 0.2  # time between two updates of the texts [s]


class Panel:
    """All controls beside the scene.

    Args:
        server: The page.
        link: The session.
        drivers: Object that knows which page drives.
        renew: Function that begins a new session with other settings. It returns the reason of a refusal, else an empty
            text. None if the console did not start the session.
        of_session: Parameters of the whole session, which belong to no node.
    """

    def __init__(
        self,
        server: Server,
        link: SessionLink,
        drivers: Drivers,
        renew: Renew | None = None,
        of_session: Parameters | None = None,
    ) -> None:
        self._server, self._gui, self._link = server, server.gui, link
        self._make_public, self._may_drive = server.make_public, drivers.may_drive
        self._take, self._drawn = drivers.take, 0.0
        self.scores = {arm.name: LiveScores() for arm in link.arms}
        self._gui.main_panel.dock_right()  # the panel is beside the scene, not over it
        self._gui.main_panel.set_width(WIDTH)  # without a width, a wide screen keeps the layout of a phone
        self._buttons: dict[str, viser.GuiButtonHandle] = {}
        self._controls: list[Control] = []
        self._status = self._gui.add_html("")
        tabs = self._gui.add_tab_group()
        if link.is_live:
            with tabs.add_tab("Drive"):
                self._add_drive()
        with tabs.add_tab("Settings"):
            self.settings = SettingsPanel(
                server, link, lambda client: client is not None and self._may_drive(client), renew, of_session
            )
        with tabs.add_tab("Scores"):
            self._add_scores()
        self.view_tab = tabs.add_tab("View")

    # -- parts -----------------------------------------------------------------------------------

    def _add_drive(self) -> None:
        take = self._button("Take control", "one browser drives, the others watch", self._take)
        self._make_public(take)
        self._add_controls("")
        with self._gui.add_folder("stylus"):
            self._add_controls("stylus")
            self.stylus_folder = self._gui.add_folder("small steps", expand_by_default=False)
        with self._gui.add_folder("recording"):
            self._name = self._gui.add_text("name", "run_1", hint="letters, digits, . _ -")
            self._button("Save as", "closes the recording and gives it this name", self._save)
            self._saved = self._gui.add_markdown("")
            self._button("Mark", "adds a mark at the present time to the recording and the timeline", self._mark)
        self._told = self._gui.add_markdown("")

    def _add_controls(self, folder: str) -> None:
        for control in map(CONTROLS.find, CONTROLS):
            if control.folder == folder:
                self._controls.append(control)
                self._button(control.name, control.hint, partial(self._act, control))

    def _button(self, label: str, hint: str, action: Callable[[int], None]) -> viser.GuiButtonHandle:
        """Add a button that acts only for the driving browser; a press during an action is ignored."""
        button = self._buttons[label] = self._gui.add_button(label, hint=hint, color="gray")
        acts = threading.Lock()

        @button.on_click
        def _(event: viser.GuiEvent[viser.GuiButtonHandle]) -> None:
            client = -1 if event.client_id is None else event.client_id
            if action != self._take and not self._may_drive(client):
                return  # the filter has refused pages without control, but control may have changed since then
            if acts.acquire(blocking=False):  # presses during the action are ignored
                try:
                    action(client)
                finally:
                    acts.release()

        return button

    def _tell(self, client: int, text: str) -> None:
        """Show on one page the reason why an action was not done."""
        handle = self._server.get_clients().get(client)
        if handle is not None:
            handle.add_notification("Not done", text, auto_close_seconds=5.0, color="yellow")

    def _add_scores(self) -> None:
        self._live = self._gui.add_markdown("")
        again = self._gui.add_button(
            "begin anew", hint="resets the figures; the recording does not change", color="gray"
        )
        again.on_click(lambda _: self._begin_scores())
        self._score = self._button("Score the last saved recording", "evaluate", self._evaluate)
        self._score.disabled = True
        self._scored = self._gui.add_markdown("")

    # -- actions ---------------------------------------------------------------------------------

    def _act(self, control: Control, client: int) -> None:
        """Do the action for every arm; refusals and errors are shown to the person."""
        told: list[str] = []
        for arm in self._link.arms:
            try:
                answers = control.act(self._link, arm.name)
            except Exception as error:  # a user's own control may raise any error, which must not stop the page
                reason = " ".join(str(error).split())
                answers = [(False, f"{control.name}: {type(error).__name__}: {reason}")]
            told += [f"- {'✓' if is_taken else '⚠'} {text}" for is_taken, text in answers]
            if answers and not answers[-1][0]:
                self._tell(client, answers[-1][1])
        self._told.content = "\n".join(told)

    def _save(self, client: int) -> None:
        try:
            self._last = self._link.save(self._name.value.strip())
            self._saved.content = f"saved: `{self._last}`"
            self._score.disabled = False
            self._name.value = _next_name(self._name.value)  # type: ignore[misc]
        except TeleopError as error:
            self._saved.content = f"⚠ {html.escape(str(error))}"

    def _mark(self, client: int) -> None:
        is_noted, text = self._link.mark()
        self._saved.content = f"{'' if is_noted else '⚠ '}{html.escape(text)}"

    def _begin_scores(self) -> None:
        for name in self.scores:
            self.scores[name] = LiveScores()

    def _evaluate(self, client: int) -> None:
        """Score in a separate process at low priority, so that the session keeps its processor time."""
        self._scored.content = "scoring …"
        command = ["nice", "-n", "15", sys.executable, "-m", "teleop_core.commands.cli", "evaluate"]
        done = subprocess.run([*command, str(self._last)], capture_output=True, text=True, check=False)
        self._scored.content = f"```\n{done.stdout or done.stderr}\n```"

    # -- drawing ---------------------------------------------------------------------------------

    def draw(self, view: View) -> None:
        """Take the present view, and show it a few times a second."""
        for name, arm in view.arms.items():
            self.scores[name].add(view.time, arm)
        now = time.monotonic()
        if now - self._drawn < _PERIOD:
            return
        self._drawn = now
        doing, step = "replay", ""
        if self._link.is_live:
            doing = self._doing(view)
            step = next_step(view, is_led_here=self.is_led_here)
        self._set(self._status, status_html(view, self._link.title, doing, step))
        if self._link.is_live:
            self._draw_buttons(view)
        tables = [
            (f"**{name}**\n\n" if len(self.scores) > 1 else "") + scores.text() for name, scores in self.scores.items()
        ]
        if self._live.content != (text := "\n\n".join(tables)):
            self._live.content = text

    def _draw_buttons(self, view: View) -> None:
        """Show the state of each button, whether the button has an effect, and which button is the next step."""
        arm, soon, now = next(iter(view.arms.values())), next_button(view), alive(view)
        labels = {c.name: f"{c.name.capitalize()}: {c.text(arm)}" for c in self._controls if c.text}
        own = {c.name: c.is_alive(view) for c in self._controls if c.is_alive is not None}
        for name, button in self._buttons.items():
            label, is_dead = labels.get(name, button.label), not own.get(name, True)
            color: Literal["blue", "gray"] = "blue" if name == soon else "gray"
            if (button.label, button.color) != (label, color):
                button.label, button.color = label, color
            if name in own and button.disabled != is_dead:
                button.disabled = is_dead
        self.stylus_folder.visible = now["steps"]

    def _doing(self, view: View) -> str:
        """Text with the run and the recording, and with the mover of the hand if no person at a page moves it."""
        where = view.recording.name if view.recording else "not recording"
        return " · ".join(filter(None, (f"run {view.run + 1}", where, leader(self._kind))))

    @property
    def _kind(self) -> str:
        """Kind of the first arm's operator; empty while it is unknown."""
        name = self._link.arms[0].name
        info = self.settings.known.get((f"{name}/operator" if name else "operator", "kind"))
        return "" if info is None else str(info.value)

    @property
    def is_led_here(self) -> bool:
        """Whether a person at the page moves the hand; true while the operator is unknown."""
        return not leader(self._kind)

    @staticmethod
    def _set(handle: viser.GuiHtmlHandle, text: str) -> None:
        if handle.content != text:
            handle.content = text


def _next_name(name: str) -> str:
    """Next name of a recording: ``run_2`` follows ``run_1``."""
    head, digits = name.rstrip("0123456789"), name[len(name.rstrip("0123456789")) :]
    return f"{head}{int(digits) + 1}" if digits else f"{name}_2"
