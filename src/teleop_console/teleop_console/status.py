"""Status: the page's text about a session, the buttons that have an effect, and the button to press next."""

import html
import math

from teleop_console.answers import Situation
from teleop_console.link import ArmView, View
from teleop_core.graph.operation import State
from teleop_core.graph.topics import SLAVE_JAW_MEASURED_JS, TASK_STATE
from teleop_core.hand.input_device import UNHELD
from teleop_core.hand.tasks import Act, Miss
from teleop_core.slave.operation import Fault

_SIGNALS = {State.ENABLED: "good", State.PAUSED: "held", State.DISABLED: "idle", State.FAULT: "wrong"}
_PRESSED = (
    "All arms are stopped, latched. Next: when nobody is in danger, press Initialize: it releases "
    "the stop, resets, enables and homes. Release alone lets the arms stay where they are."
)
_RELEASED = "Released; the arms stay in FAULT. Next: press Initialize, which resets and homes them."
_NEWS = 4  # lines
_ASKED = {
    Act.PRESS: "press at the goal",
    Act.PASS: "be at the goal",
    Act.GRIP: "go to the goal, jaw closed",
    Act.LET_GO: "go to the goal, jaw open",
}
_MISSED = {
    Miss.BESIDE: "beside it",
    Miss.LATE: "too late",
    Miss.FORCE: "too hard",
    Miss.DROP: "dropped",
    Miss.WRONG: "on the wrong goal",
}


def situation(view: View) -> Situation:
    """State of a live session that every page always shows."""
    is_pressed = any(arm.operation.get("is_stopped") for arm in view.arms.values())
    is_latched = any(
        State(int(arm.operation["state"])) is State.FAULT and Fault(int(arm.operation["fault"])) is Fault.STOP
        for arm in view.arms.values()
        if arm.operation
    )
    text = _PRESSED if is_pressed else _RELEASED if is_latched else ""
    arms = ((name, arm.operation_text) for name, arm in view.arms.items() if arm.operation_text)
    state = "; ".join(f"{name} {words}".strip() for name, words in arms)
    return Situation(can_stop=True, is_stopped=is_pressed or is_latched, text=text, state=state)


def alive(view: View) -> dict[str, bool]:
    """Names of all controls that have an effect now."""
    states = {State(int(arm.operation["state"])) for arm in view.arms.values() if arm.operation}
    is_stopped = situation(view).is_stopped
    may_move = bool(states) and not is_stopped
    return {
        "Release": is_stopped and any(a.operation.get("is_stopped") for a in view.arms.values()),
        "Start": may_move and bool(states & {State.PAUSED, State.DISABLED}),
        "Pause": may_move and State.ENABLED in states,
        "Home": may_move and State.ENABLED in states,
        "mode": may_move,
        "fixture": may_move,
        "steps": may_move,
    }


def next_button(view: View) -> str:
    """Name of the button that an operator must press next; empty while all arms follow."""
    states = {State(int(arm.operation["state"])) for arm in view.arms.values() if arm.operation}
    if states & {State.FAULT, State.DISABLED}:
        return "Initialize"
    return "Start" if State.PAUSED in states else ""


_LEADERS = {
    "human": "a simulated person leads",
    "observer": "a simulated person leads",
    "gamepad": "the gamepad leads",
    "spacemouse": "the 3-D mouse leads",
    "bag": "a recording leads",
    "file": "a recording leads",
}


def leader(kind: str) -> str:
    """Text that names the mover of the hand, by the kind of operator; empty for the person at the page."""
    return "" if kind in {"", "remote"} else _LEADERS.get(kind, f"operator {kind} leads, simulated")


def next_step(view: View, *, is_led_here: bool) -> str:
    """Next action of an operator; empty if there is none.

    Args:
        view: Newest data of the session.
        is_led_here: Whether a person at the page moves the hand.
    """
    button = next_button(view)
    if button:
        return {"Initialize": "Initialize: reset, enable and home", "Start": "Start: follow again"}[button]
    rests = any(arm.state.get("is_clutched") for arm in view.arms.values())
    return "drag the stylus; letting go is the clutch" if is_led_here and rests else ""


def facts(view: View) -> str:
    """Text with rate and ticks of the slave, and the ages of command and picture; unknown values are left out."""
    whole = sum(view.phases.values()) if view.phases else math.nan
    parts = ", ".join(f"{name} {1e3 * time:.2f}" for name, time in view.phases.items())
    told = (
        (view.rate, f"{view.rate:.0f} Hz"),
        (whole, f"tick {1e3 * whole:.2f} ms ({parts})"),
        (view.delay[0], f"command {1e3 * view.delay[0]:.1f} ms"),
        (view.age, f"picture {1e3 * view.age:.0f} ms old"),
        (view.display[1], f"display {display_text(view)}"),
    )
    return " · ".join(text for value, text in told if math.isfinite(value))


def display_text(view: View) -> str:
    """Text with rate and delay of the operator's display; empty without a display."""
    rate, late = view.display
    return f"{rate:.0f} Hz, {1e3 * late:.0f} ms late" if math.isfinite(late) else ""


def mode_text(arm: ArmView) -> str:
    """Mode and gain of an arm in words; empty before the arm has reported them."""
    if not arm.state:
        return ""
    return f"{'fine' if arm.state['is_fine'] else 'coarse'} × {arm.state['gain']:g}"


def fixture_text(arm: ArmView) -> str:
    """Text about the state of an arm's fixture; empty before the arm has reported it."""
    return ("on" if arm.state["is_fixture_on"] else "off") if arm.state else ""


def task_text(arm: ArmView) -> str:
    """Text with the present step of the task and the results so far; empty without a task."""
    told = arm.get(TASK_STATE)
    if told is None or told[0] <= 0.0:
        return ""
    task = dict(zip(TASK_STATE.columns, told.tolist(), strict=True))
    text = f"Task: {_ASKED[Act(int(task['act']))]}"
    tried, done = int(task["attempts"]), int(task["successes"])
    if not tried:
        return text
    last = Miss(int(task["miss"]))
    ended = f"last {task['time']:.1f} s" + (f", {_MISSED[last]}" if last in _MISSED else "")
    return f"{text} · {done} of {tried} attempts reached their goal · {ended}"


def closes(arm: ArmView) -> bool:
    """Whether closing the hand has an effect. This is so while the arm follows, in a task or with a jaw."""
    told = arm.operation
    follows = bool(told) and State(int(told["state"])) is State.ENABLED and bool(told["is_homed"])
    return follows and (arm.get(TASK_STATE) is not None or arm.get(SLAVE_JAW_MEASURED_JS) is not None)


def status_html(view: View, title: str, doing: str, step: str = "") -> str:
    """HTML with the state of every arm, the mode, the next step, the present action, and warnings."""
    lines = [line for name, arm in view.arms.items() for line in _arm_lines(view, name, arm)]
    if step:
        lines.append(f'<span class="t-next">Next: {html.escape(step)}</span>')
    if told := facts(view):
        lines.append(html.escape(told))
    lines.append(f'<span class="t-muted">{html.escape(title)} · {html.escape(doing)}</span>')
    said = [arm.operation_text for arm in view.arms.values() if arm.operation_text]
    news = [text for text in view.news if not any(known in text for known in said)]
    lines += [_news_line(text) for text in news[:_NEWS]]
    # The height is constant, so that the elements below do not move when the text grows.
    return f'<div class="t-status">{"".join(f"<p>{line}</p>" for line in lines)}</div>'


def _news_line(text: str) -> str:
    """HTML of a warning; the report that nobody holds the stylus is shown as information."""
    signal, mark = ("muted", "ℹ") if text.endswith(UNHELD) else ("held", "⚠")
    return f'<span class="t-{signal}">{mark} {html.escape(text)}</span>'


def _arm_lines(view: View, name: str, arm: ArmView) -> list[str]:
    signal = _SIGNALS[State(int(arm.operation["state"]))] if arm.operation else "idle"
    text = arm.operation_text or "waits for the arm"
    if not view.is_fresh:
        text, signal = "no messages from the session", "wrong"
    head, _, rest = text.partition(",") if text[:1].isupper() else (text, "", "")
    label = f'<span class="t-muted">{html.escape(name)}</span> ' if name else ""
    first = f'{label}<b class="t-{signal}">● {html.escape(head)}</b>'
    lines = [f"{first}{',' if rest else ''}{html.escape(rest)}"]
    if arm.state:
        hand = "clutched" if arm.state["is_clutched"] else "follows"
        lines.append(f"{mode_text(arm)} · {hand} · fixture {fixture_text(arm)}")
    if task := task_text(arm):
        lines.append(task)
    return lines
