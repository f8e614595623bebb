"""Panel: what an operator's console has: state, commands, stop, save, settings, plots, scores."""

import html
import math
import subprocess
import sys
import time
from collections.abc import Callable
from functools import partial
from typing import Literal

import numpy as np
import viser

from teleop_core.console.history import SPAN, History, LiveScores
from teleop_core.console.link import Link, Parameters, View
from teleop_core.console.plots import Plots
from teleop_core.console.settings import Renew, SettingsPanel
from teleop_core.console.tails import is_jump
from teleop_core.errors import TeleopError
from teleop_core.operation import State

_PERIOD = 0.2  # between two drawings of the texts [s]
_RECALLED = 300  # points of a plot
_PATIENCE = 3.0  # for an arm that must be at rest first [s]
_WATCHING = "You watch. Take control first."
_COLORS = {
    State.ENABLED: "#2f9e44", State.PAUSED: "#e8a100", State.DISABLED: "#868e96",
    State.FAULT: "#e03131",
}  # fmt: skip
_BUTTONS: dict[str, Literal["blue", "teal", "green", "orange"]] = {
    "Take control": "blue", "Initialize": "teal", "Start": "green", "Stop": "orange",
}  # fmt: skip
_ACTIONS = (
    ("Initialize", "release, reset, enable and home", ("reset", "enable", "home")),
    ("Start", "follow the stylus", ("enable",)),
    ("Stop", "pause: hold still until Start", ("pause",)),
    ("Home", "move smoothly to the home posture", ("home",)),
)


class Panel:
    """Everything beside the scene.

    Args:
        server: The page.
        link: The session.
        may_drive: Whether a browser may command the arm.
        take: Makes a browser the one that drives.
        driver: Says who drives: the number of a browser, or None.
        renew: Begins a new session with other settings, and returns why it does not, empty if it
            does; None where the session is not ours.
        of_session: Parameters of the session as a whole, which no node has.
    """

    def __init__(
        self, server: viser.ViserServer, link: Link, may_drive: Callable[[int], bool],
        take: Callable[[int], None], driver: Callable[[], int | None],
        renew: Renew | None = None,
        of_session: Parameters | None = None,
    ) -> None:  # fmt: skip
        self._server, self._gui, self._link = server, server.gui, link
        self._may_drive, self._take, self._driver = may_drive, take, driver
        self._drawn, self._is_saving = 0.0, False
        self._recorded: Callable[[float], View] | None = None
        self._time = 0.0
        self.histories = {arm.name: History(arm) for arm in link.arms}
        self.scores = {arm.name: LiveScores() for arm in link.arms}
        self._plots: list[Plots] = []
        self._gui.main_panel.dock_right()  # beside the scene, not over it
        if link.is_live:
            self._add_stop()
        self._status = self._gui.add_html("")
        tabs = self._gui.add_tab_group()
        if link.is_live:
            with tabs.add_tab("Drive"):
                self._add_drive()
        with tabs.add_tab("Plots"):
            self._add_plots()
        with tabs.add_tab("Settings"):
            self.settings = SettingsPanel(server, link, self._guard, renew, of_session)
        with tabs.add_tab("Scores"):
            self._add_scores()
        self.view_tab = tabs.add_tab("View")

    # -- parts -----------------------------------------------------------------------------------

    def _add_stop(self) -> None:
        """Emergency stop: in a window of its own, so that it is seen whatever else is shown."""
        window = self._gui.add_panel(order=-1.0)
        with window.add_tab("Emergency stop"):
            stop = self._gui.add_button(
                "EMERGENCY STOP", color="red", hint="stops all arms at once; the space key too"
            )
            self._button("release", "then Initialize", self._release)
        window.float(x=15, y=-15, width=230)
        # Anybody who watches may stop; letting the arm go again is the driver's.
        stop.on_click(self._stop)
        command = self._gui.add_command(
            "Emergency stop", description="stops all arms at once", hotkey="space"
        )
        command.on_trigger(self._stop)

    def _stop(self, _: object) -> None:
        self._link.press(is_pressed=True)

    def _release(self, client: int) -> None:
        self._link.press(is_pressed=False)

    def _add_drive(self) -> None:
        self._button("Take control", "one browser drives, the others watch", self._take)
        for label, hint, words in _ACTIONS:
            self._button(label, hint, partial(self._command, words))
        with self._gui.add_folder("stylus"):
            for name, label in (("mode", "coarse ↔ fine"), ("fixture", "box on ↔ off")):
                self._button(label, f"the {name} button of the stylus", partial(self._press, name))
            self.stylus_folder = self._gui.add_folder("small steps", expand_by_default=False)
        with self._gui.add_folder("recording"):
            self._name = self._gui.add_text("name", "run_1", hint="letters, digits, . _ -")
            self._button("Save as", "closes the recording under this name", self._save)
            self._saved = self._gui.add_markdown("")
        self._told = self._gui.add_markdown("")

    def _button(
        self, label: str, hint: str, action: Callable[[int], None]
    ) -> viser.GuiButtonHandle:
        """Button that acts for the browser that drives, and tells others why it does not."""
        button = self._gui.add_button(label, hint=hint, color=_BUTTONS.get(label, "gray"))

        @button.on_click
        def _(event: viser.GuiEvent[viser.GuiButtonHandle]) -> None:
            client = -1 if event.client_id is None else event.client_id
            if action == self._take or self._may_drive(client):
                action(client)
            else:
                self._tell(client, _WATCHING)

        return button

    def _tell(self, client: int, text: str) -> None:
        handle = self._server.get_clients().get(client)
        if handle is not None:
            handle.add_notification("Not done", text, auto_close_seconds=5.0, color="yellow")

    def _add_plots(self) -> None:
        for name, history in self.histories.items():
            if len(self.histories) > 1:
                with self._gui.add_folder(name or "first arm"):
                    self._plots.append(Plots(self._gui, history))
            else:
                self._plots.append(Plots(self._gui, history))

    def _add_scores(self) -> None:
        self._live = self._gui.add_markdown("")
        again = self._gui.add_button("begin anew", hint="the figures, not the recording")
        again.on_click(lambda _: self._begin_scores())
        self._score = self._button("Score the last saved recording", "evaluate", self._evaluate)
        self._score.disabled = True
        self._scored = self._gui.add_markdown("")

    # -- actions ---------------------------------------------------------------------------------

    def _guard(self, client: int | None) -> bool:
        return client is not None and self._may_drive(client)

    def _command(self, words: tuple[str, ...], client: int) -> None:
        """Send commands to every arm; what is refused is told."""
        if words[0] == "reset":
            self._link.press(is_pressed=False)
        told = []
        for arm in self._link.arms:
            for word in words:
                is_taken, text = self._insist(word, arm.name)
                told.append(f"- {'✓' if is_taken else '⚠'} {text}")
                if not is_taken and len(words) == 1:
                    self._tell(client, text)
        self._told.content = "\n".join(told)

    def _insist(self, word: str, arm: str) -> tuple[bool, str]:
        """Send a command; an arm that is coming to rest is asked again for a while."""
        until = time.monotonic() + _PATIENCE
        while True:
            is_taken, text = self._link.command(word, arm)
            if is_taken or "rest" not in text or time.monotonic() > until:
                return is_taken, text
            time.sleep(_PERIOD)

    def _press(self, name: str, client: int) -> None:
        for arm in self._link.arms:
            self._link.press_button(arm.name, name)

    def _save(self, client: int) -> None:
        if self._is_saving:
            return
        self._is_saving = True
        try:
            self._last = self._link.save(self._name.value.strip())
            self._saved.content = f"saved: `{self._last}`"
            self._score.disabled = False
            self._name.value = _next_name(self._name.value)  # type: ignore[misc]
        except TeleopError as error:
            self._saved.content = f"⚠ {html.escape(str(error))}"
        finally:
            self._is_saving = False

    def _begin_scores(self) -> None:
        for name in self.scores:
            self.scores[name] = LiveScores()

    def _evaluate(self, client: int) -> None:
        """Score in a process of its own, with what the session leaves of the processors."""
        self._scored.content = "scoring …"
        command = ["nice", "-n", "15", sys.executable, "-m", "teleop_core.cli", "evaluate"]
        done = subprocess.run(
            [*command, str(self._last)], capture_output=True, text=True, check=False
        )
        self._scored.content = f"```\n{done.stdout or done.stderr}\n```"

    # -- drawing ---------------------------------------------------------------------------------

    def remember(self, recorded: Callable[[float], View]) -> None:
        """Take plots from a recording wherever time jumps; without that they begin anew there.

        Args:
            recorded: What was known at a time [s].
        """
        self._recorded = recorded

    def _recall(self, recorded: Callable[[float], View], now: float) -> None:
        """Fill the plots with what was before a time [s]."""
        for history in self.histories.values():
            history.clear()
        for at in np.linspace(max(0.0, now - SPAN), now, _RECALLED, endpoint=False).tolist():
            for name, arm in recorded(at).arms.items():
                self.histories[name].add(at, arm, math.nan)

    def draw(self, view: View) -> None:
        """Take note of what is known now, and show it a few times a second."""
        if self._recorded is not None and is_jump(self._time, view.time):
            self._recall(self._recorded, view.time)
        self._time = view.time
        for name, arm in view.arms.items():
            self.histories[name].add(view.time, arm, view.delay[0])
            self.scores[name].add(view.time, arm)
        for plots in self._plots:
            plots.draw()
        now = time.monotonic()
        if now - self._drawn < _PERIOD:
            return
        self._drawn = now
        doing = self._doing(view) if self._link.is_live else "replay"
        self._set(self._status, _status_html(view, self._link.title, doing))
        tables = [
            (f"**{name}**\n\n" if len(self.scores) > 1 else "") + scores.text()
            for name, scores in self.scores.items()
        ]
        if self._live.content != (text := "\n\n".join(tables)):
            self._live.content = text

    def _doing(self, view: View) -> str:
        """Run, recording, and who drives."""
        where = view.recording.name if view.recording else "not recording"
        driver = self._driver()
        who = "nobody drives" if driver is None else f"browser {driver + 1} drives"
        return f"run {view.run + 1} · {where} · {who}"

    @staticmethod
    def _set(handle: viser.GuiHtmlHandle, text: str) -> None:
        if handle.content != text:
            handle.content = text


def _next_name(name: str) -> str:
    """``run_2`` after ``run_1``."""
    head, digits = name.rstrip("0123456789"), name[len(name.rstrip("0123456789")) :]
    return f"{head}{int(digits) + 1}" if digits else f"{name}_2"


def _status_html(view: View, title: str, doing: str) -> str:
    """State of every arm, mode, what is being done, and warnings."""
    lines = []
    for name, arm in view.arms.items():
        state = State(int(arm.operation["state"])) if arm.operation else None
        color = _COLORS[state] if state is not None else "#868e96"
        text = html.escape(arm.operation_text or "waits for the arm")
        if not view.is_fresh:
            text, color = "nothing comes from the session", "#e03131"
        badge = f'<b style="color:{color}">●</b> <b>{html.escape(name)}</b> {text}'
        lines.append(badge)
        if arm.state:
            is_fine = "fine" if arm.state["is_fine"] else "coarse"
            hand = "clutched" if arm.state["is_clutched"] else "follows"
            box = "box on" if arm.state["is_fixture_on"] else "no box"
            lines.append(f"{is_fine} × {arm.state['gain']:g} · {hand} · {box}")
    lines.append(f"{html.escape(title)} · {html.escape(doing)}")
    said = [arm.operation_text for arm in view.arms.values() if arm.operation_text]
    news = [text for text in view.news if not any(known in text for known in said)]
    lines += [f'<span style="color:#e8a100">⚠ {html.escape(text)}</span>' for text in news[:4]]
    body = "<br>".join(lines)
    # Of one height, so that what is below stays where it is when there is more to say.
    style = "padding:0 0.9em;font-size:0.8em;line-height:1.5;height:9em;overflow-y:auto"
    return f'<div style="{style}">{body}</div>'
