"""Settings: a control for each parameter of the session, with its unit, bounds and meaning."""

import threading
from collections.abc import Callable, Mapping
from dataclasses import replace

import viser

from teleop_console.inputs import LATER, Input, default_of, form, text
from teleop_console.link import ParameterInfo, Parameters, SessionLink, Setting
from teleop_core.base.errors import TeleopError

QUICK = (
    ("motion_scaling", "mode"), ("motion_scaling", "coarse_gain"), ("motion_scaling", "fine_gain"),
    ("motion_scaling", "fixture.kind"), ("motion_scaling", "fixture.box.size"),
    ("motion_scaling", "fixture.sphere.radius"), ("motion_scaling", "reflection.architecture"),
    ("motion_scaling", "reflection.passivity"), ("slave_sim", "world.kind"),
    ("slave_sim", "world.material"), ("network", "preset"), ("slave", "reference_filter.is_on"),
    ("slave_sim", "controller.kind"), ("slave_sim", "plant.kind"), ("teleop", "delays"),
)  # fmt: skip
"""Stage and name of the parameters that people change most often."""
_USED = "most used"
_MOST = 40  # largest number of parameters that are shown together
Renew = Callable[[tuple[str, ...]], str]
"""Function that begins a new session with other settings; it returns the reason of a refusal, else an empty text."""
MayDrive = Callable[[int | None], bool]
"""Function that returns whether a browser may change parameters; if not, it shows the reason in the browser."""


class SettingsPanel:
    """Controls of all parameters in the present container of the page.

    Args:
        server: The page.
        link: The session.
        may_drive: Function that returns whether the page may change parameters; called before each change.
        renew: Function that begins a new session with texts ``node.name=value``, for parameters that are fixed while a
            session runs. It returns the reason of a refusal, else an empty text. None if the console did not start the
            session.
        of_session: Parameters of the whole session, which belong to no node.

    Attributes:
        known: All parameters with the last received or last set values.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        link: SessionLink,
        may_drive: MayDrive,
        renew: Renew | None = None,
        of_session: Parameters | None = None,
    ) -> None:
        self._gui, self._link, self._may, self._renew = server.gui, link, may_drive, renew
        self._of_session = dict(of_session or {})
        self.known: Parameters = {}
        self._listeners: list[Callable[[Parameters], None]] = []
        self._wanted: dict[tuple[str, str], Setting] = {}
        self._told = self._gui.add_markdown("loading the parameters …")
        self._search = self._gui.add_text("search", "", hint="words of names, stages and meanings")
        self._choice = self._gui.add_dropdown("show", (_USED,), hint="stage and group")
        self._only = self._gui.add_checkbox("changed only", False, hint="parameters that differ from their defaults")
        self._folder = self._gui.add_folder("values")
        reset = self._gui.add_button("Reset these", hint="to the defaults", color="gray")
        self._failed = self._gui.add_markdown("", visible=False)
        self._by_key: dict[tuple[str, str], Input] = {}
        self._controls: list[Input | viser.GuiMarkdownHandle] = []
        self._changing = threading.Lock()
        with self._gui.add_folder("fixed while it runs", visible=False) as self._pending:
            self._list = self._gui.add_markdown("")
            begin = self._gui.add_button("New session with these", color="blue")
        for choice in (self._search, self._choice, self._only):
            choice.on_update(lambda _: self._show())
        reset.on_click(lambda event: self._reset(event.client_id))
        begin.on_click(lambda event: self._begin(event.client_id))

    def on_change(self, listener: Callable[[Parameters], None]) -> None:
        """Call a function with all parameters whenever some of them have changed."""
        self._listeners.append(listener)

    def refresh(self) -> bool:
        """Read the parameters of all nodes again, and show them; this takes some time.

        Returns:
            Whether the nodes returned as many parameters as before; then all nodes have started.
        """
        before = self.known.keys()
        try:
            self._know({**self._of_session, **self._link.parameters()})
        except TeleopError as error:
            self._told.content = f"**{error}**"
            return False
        if self.known.keys() == before:
            return len(before) > len(self._of_session)
        groups = sorted({_group(*key) for key in self.known})
        self._choice.options = (_USED, *groups)
        about = "hover over a parameter for its meaning, bounds and default"
        self._told.content = f"{len(self.known)} parameters; {about}. {LATER} takes a new session"
        self._show()
        return False

    def follow(self, changes: Mapping[tuple[str, str], Setting]) -> None:
        """Show values that another source has changed: a button of the stylus, a program, or another page."""
        known = {key: value for key, value in changes.items() if key in self.known}
        if not known:
            return
        new = {key: replace(self.known[key], value=value) for key, value in known.items()}
        self._know({**self.known, **new})
        for key, value in known.items():
            if (control := self._by_key.get(key)) is not None and not control.show(value):
                self._show()

    def _know(self, known: Parameters) -> None:
        self.known = known
        for listener in self._listeners:
            listener(known)

    def keys(self) -> list[tuple[str, str]]:
        """Parameters that the search and the filters of the panel select."""
        chosen, words = self._choice.value, self._search.value.lower().split()
        keys = list(self.known)
        if words:
            texts = {key: f"{' '.join(key)} {self.known[key].doc}".lower() for key in keys}
            keys = [key for key in keys if all(word in texts[key] for word in words)]
        elif chosen != _USED:
            keys = [key for key in keys if chosen == _group(*key)]
        elif not self._only.value:
            stages = {key: (key[0].rpartition("/")[2], key[1]) for key in self.known}
            keys = [key for wanted in QUICK for key, known in stages.items() if known == wanted]
        return [key for key in keys if self._is_changed(key)] if self._only.value else keys

    def _is_changed(self, key: tuple[str, str]) -> bool:
        default = default_of(*key)
        return default is not None and default != self._wanted.get(key, self.known[key].value)

    def _show(self) -> None:
        keys, is_group = self.keys(), not self._search.value.strip() and not self._only.value
        for control in self._controls:
            control.remove()
        self._controls.clear()
        self._by_key.clear()
        count = f"{_MOST} of {len(keys)}" if len(keys) > _MOST else f"{len(keys)}"
        self._folder.label = self._choice.value if is_group else f"found: {count}"
        with self._folder:
            for key in keys[:_MOST]:
                self._add(self.known[key], with_node=not is_group or self._choice.value == _USED)

    def _reset(self, client: int | None) -> None:
        """Set all shown parameters to their defaults; nodes may refuse some of them."""
        failed = [] if self._may(client) else ["you watch; take control first"]
        for key in () if failed else [key for key in self._by_key if self._is_changed(key)]:
            if refusal := self._set(self.known[key], default_of(*key)):  # type: ignore[arg-type]
                failed.append(f"{'.'.join(key)}: {refusal}")
        self._failed.content, self._failed.visible = "⚠ " + "; ".join(failed), bool(failed)
        self._show()

    def _add(self, info: ParameterInfo, *, with_node: bool) -> None:
        """Add the control of a parameter, with a line below it for the reason of a refused value."""
        label = info.name.rpartition(".")[2] if not with_node else info.name
        arm = info.node.rpartition("/")[0]
        wanted = self._wanted.get((info.node, info.name), info.value)
        control = Input(self._gui, f"{arm} {label}".strip(), replace(info, value=wanted), self._joints(info))
        why = self._gui.add_markdown("", visible=False)
        key = info.node, info.name
        self._controls += [control, why]
        self._by_key[key] = control

        control.on_change(lambda client: self._changed(client, control, why, info))

    def _changed(self, client: int | None, control: Input, why: viser.GuiMarkdownHandle, info: ParameterInfo) -> None:
        """Set the parameter to the present value of an input; the last value of a dragged slider is always set."""
        key = info.node, info.name
        with self._changing:
            before, value = self._wanted.get(key, self.known[key].value), control.value
            if client is None or value == before:
                return
            refusal = "" if value is not None else f"{control.said!r} is no {form(info)}"
            if not refusal and not self._may(client):
                refusal = "you watch; take control first"
            if not refusal and value is not None:
                refusal = self._set(info, value)
            why.content, why.visible = f"⚠ {refusal}", bool(refusal)
            if refusal:
                control.show(before)

    def _joints(self, info: ParameterInfo) -> tuple[str, ...]:
        """Names of the joints of the arm to which a parameter belongs."""
        namespace = info.node.rpartition("/")[0]
        return next((arm.robot.joint_names for arm in self._link.arms if arm.name == namespace), ())

    def _set(self, info: ParameterInfo, value: Setting) -> str:
        key = info.node, info.name
        if not info.is_fixed:
            refusal = self._link.change(*key, value)
            if not refusal:
                self._know({**self.known, key: replace(self.known[key], value=value)})
            return refusal
        if self._renew is None:
            return f"fixed while it runs: start it with --set {info.name}={text(value)}"
        self._wanted[key] = value
        self._tell_pending()
        return ""

    def _tell_pending(self, refusal: str = "") -> None:
        lines = [f"- `{n}.{p}` = {text(v)}" for (n, p), v in self._wanted.items()]
        lines += [f"\n⚠ {refusal}"] if refusal else []
        self._list.content, self._pending.visible = "\n".join(lines), True

    def _begin(self, client: int | None) -> None:
        if self._renew is None:
            return
        texts = tuple(f"{n}.{p}={text(v)}" for (n, p), v in self._wanted.items())
        is_allowed = self._may(client)
        self._tell_pending(self._renew(texts) if is_allowed else "you watch; take control first")


def _group(node: str, name: str) -> str:
    """Stage and group of a parameter, as text for the filter of the panel."""
    return " · ".join(filter(None, (node, name.rpartition(".")[0])))
