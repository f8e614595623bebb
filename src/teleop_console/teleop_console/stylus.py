"""Stylus: the gizmo with which a person moves the hand, and small steps by keys and buttons."""

import threading
from collections.abc import Callable, Coroutine
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import viser
from viser import TransformControlsEvent as Event

from teleop_console.link import View
from teleop_console.poses import move
from teleop_console.scene import Scene
from teleop_core.base.errors import UnknownNameError
from teleop_core.graph.topics import MASTER_MEASURED_CP
from teleop_core.kernels.geometry import Array, turn_by

AXES = ("x", "y", "z", "rx", "ry", "rz")
"""Directions of a small step: along and about the axes of master_base."""
STEP_LENGTH = 1e-3
"""Length of a small step along an axis [m]."""
STEP_TURN = np.radians(1.0)
"""Angle of a small step about an axis [rad]."""
LINGER = 1.0
"""Time for which the stylus is held after a small step, so that the next step can follow [s]."""
GRIP = "grip"
"""Name of a gizmo's node below the node of the master."""
_SIZE = 0.175  # size of a gizmo as a share of the arm's reach: the view grows with the arm, and the handles with it
_LEAST_SIZE = 0.08  # smallest size of a gizmo, that of the device's stylus [m]


@dataclass
class _Hand:
    """Holder and wanted pose of one stylus.

    Attributes:
        gizmo: Element that a person drags; its pose is in master_base.
        measured: Last measured pose of the stylus (7,); None before the first sample.
        wanted: Wanted pose of the stylus (7,); None while no browser holds it.
        client: Browser that drags the stylus; None while small steps hold the stylus, or nothing holds it.
        remaining: Time until a small step releases the stylus [s].
    """

    gizmo: viser.TransformControlsHandle
    measured: Array | None = None
    wanted: Array | None = None
    client: int | None = None
    remaining: float = 0.0
    refused: set[int] = field(default_factory=set)


class Stylus:
    """Gizmos of all arms.

    While no browser holds the gizmo, it follows the stylus. While a browser holds the gizmo, every :meth:`tick` sends
    the wanted pose again, because silence releases the stylus.

    Args:
        server: The page.
        scene: Scene of the page; the gizmos are added to its masters.
        may_drive: Whether a browser may command the arms, by its number.
        on_hold: Called with the arm and the wanted pose (7,) in master_base.
        on_let_go: Called with the arm whose stylus is released.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        scene: Scene,
        may_drive: Callable[[int], bool],
        on_hold: Callable[[str, Array], None],
        on_let_go: Callable[[str], None],
    ) -> None:
        self._time: float | None = None
        self._may_drive, self._on_hold, self._on_let_go = may_drive, on_hold, on_let_go
        self._lock = threading.RLock()
        self._hands = {
            arm: _Hand(
                server.scene.add_transform_controls(
                    f"{node}/{GRIP}",
                    scale=max(_LEAST_SIZE, _SIZE * scene.arms[arm].bodies.size),
                    depth_test=False,
                    opacity=0.8,
                )
            )
            for arm, node in scene.masters.items()
        }
        for arm, hand in self._hands.items():
            hand.gizmo.on_update(self._listener(arm))

    def _listener(self, arm: str) -> Callable[[Event], Coroutine[None, None, None]]:
        # This is a coroutine, because the coroutines of one gesture run in order.
        async def listen(event: Event) -> None:
            self._drag(arm, -1 if event.client_id is None else event.client_id, event.phase)

        return listen

    def _drag(self, arm: str, client: int, phase: str) -> None:
        with self._lock:
            hand = self._hands[arm]
            if phase == "end":
                hand.refused.discard(client)
                if hand.client == client:
                    self._let_go(arm, hand)
                return
            is_taken = hand.client is not None and hand.client != client
            if client in hand.refused or is_taken or not self._may_drive(client):
                hand.refused.add(client)  # the refusal lasts for the whole gesture
                if hand.client == client:
                    self._let_go(arm, hand)
                return
            hand.client = client
            hand.wanted = np.concatenate((hand.gizmo.position, hand.gizmo.wxyz))
            self._on_hold(arm, hand.wanted.copy())

    def _let_go(self, arm: str, hand: _Hand) -> None:
        hand.client, hand.wanted, hand.remaining = None, None, 0.0
        self._on_let_go(arm)

    def held(self, arm: str) -> bool:
        """Whether a browser or a small step holds the stylus of an arm."""
        return self._hands[arm].wanted is not None

    def wanted(self, arm: str) -> Array | None:
        """Wanted pose (7,) of the stylus in master_base; None while nothing holds it."""
        wanted = self._hands[arm].wanted
        return None if wanted is None else wanted.copy()

    def draw(self, view: View) -> None:
        """Store the present poses of the styli, and call :meth:`tick` with the time since the last view."""
        for arm, seen in view.arms.items():
            if arm in self._hands and (pose := seen.get(MASTER_MEASURED_CP)) is not None:
                self.follow(arm, pose)
        self.tick(0.0 if self._time is None else max(0.0, view.time - self._time))
        self._time = view.time

    def follow(self, arm: str, pose: Array) -> None:
        """Store the measured pose (7,) of the stylus in master_base; a gizmo that nothing holds moves to this pose.

        A pose that is not finite counts as unknown.
        """
        if not np.isfinite(pose).all():
            return
        with self._lock:
            hand = self._hands[arm]
            hand.measured = pose.copy()
            if hand.wanted is None:
                move(hand.gizmo, pose)

    def tick(self, dt: float) -> None:
        """Send the poses of all held styli again; it must be called at least every 50 ms.

        Args:
            dt: Time since the last call [s].
        """
        with self._lock:
            for arm, hand in self._hands.items():
                if hand.wanted is None:
                    continue
                if hand.client is None:
                    hand.remaining -= dt
                    is_over = hand.remaining <= 0.0
                else:
                    is_over = not self._may_drive(hand.client)
                if is_over:
                    self._let_go(arm, hand)
                else:
                    self._on_hold(arm, hand.wanted.copy())

    def nudge(self, arm: str, axis: str, sign: int) -> None:
        """Command the stylus one small step: 1 mm along an axis, or 1° about it.

        The stylus is held for :data:`LINGER` after the last step, then released. A step has no effect before the first
        sample of the stylus, and while the stylus is dragged. The caller must check whether the page may command steps.

        Args:
            arm: Namespace of the arm.
            axis: One of :data:`AXES`.
            sign: 1 or -1.

        Raises:
            UnknownNameError: ``axis`` is unknown.
        """
        if axis not in AXES:
            raise UnknownNameError("axis", axis, AXES)
        with self._lock:
            hand = self._hands[arm]
            start = hand.measured if hand.wanted is None else hand.wanted
            if start is None or hand.client is not None:
                return
            hand.wanted, hand.remaining = stepped(start, axis, sign), LINGER
            move(hand.gizmo, hand.wanted)
            self._on_hold(arm, hand.wanted.copy())

    def let_go(self, arm: str) -> None:
        """Release a stylus from any holder; has no effect if nothing holds it."""
        with self._lock:
            hand = self._hands[arm]
            if hand.client is not None:
                hand.refused.add(hand.client)  # the rest of the gesture is ignored
            if hand.wanted is not None:
                self._let_go(arm, hand)

    def show(self, *, is_shown: bool) -> None:
        """Show the gizmos or hide them."""
        for hand in self._hands.values():
            if hand.gizmo.visible != is_shown:
                hand.gizmo.visible = is_shown


def stepped(pose: Array, axis: str, sign: int) -> Array:
    """Pose (7,) that is one small step away from ``pose``, along or about an axis of the base."""
    out = pose.copy()
    place = "xyz".index(axis[-1])
    if len(axis) == 1:
        out[place] += sign * STEP_LENGTH
        return out
    vector = np.zeros(3)
    vector[place] = sign * STEP_TURN
    turn_by(vector, out[3:])
    out[3:] /= np.linalg.norm(out[3:])
    return out


Key = Literal["arrowup", "arrowdown", "arrowleft", "arrowright", "pageup", "pagedown"]
_KEYS: dict[Key, tuple[str, int]] = {
    "arrowright": ("x", 1),
    "arrowleft": ("x", -1),
    "arrowup": ("y", 1),
    "arrowdown": ("y", -1),
    "pageup": ("z", 1),
    "pagedown": ("z", -1),
}
"""Small step of each key, in the master's base."""


class Steps:
    """Buttons for small steps in the present container of the page, and keys; with shift, a key rotates the stylus.

    Args:
        server: The page.
        stylus: Stylus that moves.
        arms: Namespaces of the arms; keys move the chosen arm.
        may_drive: Whether a browser may command the arms.
    """

    def __init__(
        self, server: viser.ViserServer, stylus: Stylus, arms: tuple[str, ...], may_drive: Callable[[int], bool]
    ) -> None:
        self._stylus, self._may_drive, self._arm = stylus, may_drive, arms[0]
        if len(arms) > 1:
            choice = server.gui.add_dropdown("arm", [arm or "first" for arm in arms])
            choice.on_update(lambda _: self._choose(arms[choice.options.index(choice.value)]))
        for axis in AXES:
            step = "1°" if axis.startswith("r") else "1 mm"
            buttons = server.gui.add_button_group(axis, ("−", "+"), hint=f"{step} in master_base")
            buttons.on_click(
                lambda event, axis=axis: self._step(  # type: ignore[misc]
                    event.client_id, axis, 1 if event.target.value == "+" else -1
                )
            )
        for key, (axis, sign) in _KEYS.items():
            self._add_key(server, key, axis, sign)

    def _add_key(self, server: viser.ViserServer, key: Key, axis: str, sign: int) -> None:
        for modifier, moved, word in ((None, axis, "1 mm along"), ("shift", f"r{axis}", "1° about")):
            command = server.gui.add_command(
                f"Stylus {word} {'+' if sign > 0 else '−'}{axis}", hotkey=key, modifier="shift" if modifier else None
            )
            command.on_trigger(
                lambda event, moved=moved: self._step(event.client_id, moved, sign)  # type: ignore[misc]
            )

    def _choose(self, arm: str) -> None:
        self._arm = arm

    def _step(self, client: int | None, axis: str, sign: int) -> None:
        if client is not None and self._may_drive(client):
            self._stylus.nudge(self._arm, axis, sign)
