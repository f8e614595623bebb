"""Desk: a page of a session that does nothing, to see what a page asks of it."""

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from page_client import TOKEN
from teleop_console import app, link
from teleop_console.server import ConsoleServer
from teleop_core.graph.operation import State
from teleop_core.graph.topics import MASTER_MEASURED_CP, OPERATION
from teleop_core.kernels.geometry import Array
from teleop_core.robots import load_robot_set
from teleop_core.slave.operation import Fault, operation_text

POSE = np.array([0.0, -0.0655, -0.0881, 1.0, 0.0, 0.0, 0.0])


class Desk:
    """Link to an arm that stands still and writes down what the page asks of it.

    Its state changes with the stop alone, and only if it ``is_stoppable``. It tells ``poses`` at which the stylus was
    wanted, how often it was ``let_gos`` and it had ``looks``; what it saves is the recording ``saved``.
    """

    title, is_live = "desk", True

    def __init__(self, *, is_stoppable: bool = False) -> None:
        self.is_stoppable = is_stoppable
        self.arms: tuple[link.ShownArm, ...] = (link.ShownArm("", load_robot_set("rcrt1", ())),)
        self.asked: list[Any]
        self.known: dict[Any, Any]
        self.asked, self.stops, self.known = [], 0, {}
        self.poses, self.looks, self.let_gos, self.saved = list[Array](), 0, 0, Path()
        self.obeys = threading.Event()
        self.obeys.set()
        arm = link.ArmView({MASTER_MEASURED_CP.name: POSE}, {}, {}, dict.fromkeys(OPERATION, 0.0), "-")
        arm.operation |= {"state": float(State.ENABLED), "is_homed": 1.0, "fault_joint": -1.0}
        self._view = link.View(arms={"": arm}, is_fresh=True)

    def view(self) -> link.View:
        self.looks += 1
        self._view.time, arm = time.monotonic(), self._view.arms[""]
        arm.operation_text = operation_text(arm.operation)
        return self._view

    def press(self, *, is_pressed: bool) -> None:
        if is_pressed:
            self.stops += 1
        else:
            self.asked.append("release")
        if self.is_stoppable:
            fault = {"state": State.FAULT, "fault": Fault.STOP, "is_stopped": is_pressed}
            self.view().arms[""].operation |= {name: float(n) for name, n in fault.items()}

    def command(self, word: str, arm: str = "") -> tuple[bool, str]:
        self.obeys.wait(60)
        self.asked.append(word)
        return True, word

    def hold(self, arm: str, pose: Array) -> None:
        assert np.shape(pose) == (7,)
        self.asked.append("hold")
        self.poses.append(np.array(pose))

    def let_go(self, arm: str) -> None:
        self.let_gos += 1

    def press_button(self, arm: Any, name: Any) -> None:
        self.asked.append(name)

    def close_jaw(self, share: float) -> None:
        self.asked.append(f"jaw {share:g}")

    def parameters(self) -> dict[tuple[str, str], link.ParameterInfo]:
        return self.known

    def changes(self) -> dict[tuple[str, str], link.Setting]:
        return {}

    def change(self, node: Any, name: Any, value: Any) -> str:
        self.asked.append(name)
        return ""

    def mark(self) -> tuple[bool, str]:
        self.asked.append("mark")
        return True, "marked"

    def save(self, name: Any) -> Path:
        self.asked.append("save")
        return self.saved


def connected(server: ConsoleServer) -> list[Any]:
    """What viser keeps of each page that is connected, those that have not come up yet included."""
    return list(server.viser._websock_server._client_state_from_id.values())


@contextmanager
def shown(desk: Any, renew: Any = None, *, can_end: bool = False) -> Iterator[tuple[ConsoleServer, Desk]]:
    """Server of the page of a desk, drawn as the command draws it, and the desk; further arguments as of the page."""
    ends = threading.Event()
    with ConsoleServer(0, token=TOKEN) as server:
        console = app.Console(server, desk, renew, can_end=can_end)
        drawing = threading.Thread(target=console.run, args=(ends.is_set,))
        drawing.start()
        try:
            yield server, desk
            assert drawing.is_alive()
        finally:
            ends.set()
            drawing.join()
