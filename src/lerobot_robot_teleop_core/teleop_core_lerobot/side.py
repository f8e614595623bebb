"""Side of a session for a loop of another program: what the slave's and the master's side share."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import teleop_core as tc
from teleop_core.commands.progress import shown_progress
from teleop_core.graph import TICK_NS
from teleop_core.session.runner import record_blocks
from teleop_core.slave.parameters import SlaveParameters

SECOND_NS = 1_000_000_000
FORCE = ("force.x", "force.y", "force.z")
"""Keys of the force on the slave's tip along its base [N]."""


def _with_stages(setting: str, stages: Sequence[tc.Stage]) -> str:
    """A setting; one of the session's stages gets those of the loop too."""
    found = re.fullmatch(r"(teleop\.stages)=\[(.*)\]", setting)
    if found is None:
        return setting
    names = [name for name in found[2].split(",") if name.strip()]
    return f"{found[1]}=[{','.join((*names, *(stage.name for stage in stages)))}]"


class Side:
    """One side of a session, which a loop advances period by period.

    Args:
        stages: Stages by which the loop gives.
        robot: Name of a robot, its URDF or table; empty for the one of the scenario.
        scenario: One of ``teleop scenarios``; empty for the defaults.
        settings: Parameters as ``key=value``, as ``teleop sim --set`` takes them.
        fps: Calls of the loop in a second, 1 to 1000.
        bag: Directory of a recording that :meth:`end` makes; empty for none.

    Attributes:
        joint_names: Names of the robot's joints.

    Raises:
        TeleopError: A value is wrong; the text names it.
    """

    def __init__(
        self, stages: Sequence[tc.Stage], robot: str, scenario: str, settings: Sequence[str], fps: int, bag: str = ""
    ) -> None:
        if not 1 <= fps <= 1000:
            raise tc.ParameterError("fps", fps, "1 to 1000 calls in a second")
        texts = [_with_stages(text, stages) for text in settings]
        self._configuration = tc.configuration(scenario or None, robot=robot or None, stages=stages, texts=texts)
        arms, known = self._configuration.graph.arms, self._configuration.graph.stages
        if any(stage not in known for stage in stages) or len(arms) > 1:
            needed = f"one arm, with {', '.join(stage.name for stage in stages)} among its stages"
            raise tc.ParameterError("settings", tuple(settings), needed)
        self._fps, self._bag = fps, bag
        self.joint_names: tuple[str, ...] = self._configuration.of(SlaveParameters).joint_names
        self._session: tc.VirtualTime | None = None

    @property
    def joint_keys(self) -> tuple[str, ...]:
        """Keys of the joints in actions and observations, [rad or m]."""
        return tuple(f"{name}.pos" for name in self.joint_names)

    @property
    def is_running(self) -> bool:
        """Whether it has begun and not ended."""
        return self._session is not None

    @property
    def fps(self) -> int:
        """Calls of the loop in a second."""
        return self._fps

    @property
    def topics(self) -> list[tc.Topic]:
        """Topics of the session."""
        return [topic for member in self._configuration.graph.members for topic in member.writes]

    def values(self, topic: tc.Topic) -> NDArray[np.float64]:
        """Columns of a topic in the last tick.

        Raises:
            SessionError: No session runs.
        """
        self._running  # noqa: B018 raises without a session
        return np.array(self._row[topic.field], np.float64)

    def parameters(self, stage: str) -> Any:
        """Parameter group of a stage, by the name of the stage."""
        return self._configuration.group(stage)

    def stage(self, name: str) -> Any:
        """Running stage, by its name.

        Raises:
            SessionError: No session runs.
        """
        return self._running.stages[name]

    def begin(self) -> None:
        """Begin a session, and wait until the slave is where it starts.

        Raises:
            SessionError: It runs already.
        """
        if self._session is not None:
            raise tc.SessionError("the session runs already; end it first")
        with shown_progress("starting"):  # the first start on a machine compiles kernels, for half a minute or more
            self._session = tc.VirtualTime(self._configuration)
            self._go_to_start()

    def restart(self) -> None:
        """Begin the session again, bit for bit; what was to be recorded is forgotten.

        Raises:
            SessionError: No session runs.
        """
        self._running.reset()
        self._go_to_start()

    def _go_to_start(self) -> None:
        self._periods, self._blocks = 0, list[NDArray[np.void]]()
        self._advance(max(1, self._running.lead))
        self._begin_ns = self._running.now_ns

    def end(self) -> None:
        """End the session, and make its recording if one is wanted.

        Raises:
            SessionError: It does not run.
            RecordingError: The directory exists, or cannot be written.
        """
        session, self._session = self._running, None
        if self._bag:
            ticks = session.now_ns // TICK_NS
            record_blocks(session, self._configuration, Path(self._bag), self._blocks, ticks)

    @property
    def _running(self) -> tc.VirtualTime:
        if self._session is None:
            raise tc.SessionError("no session runs; begin one first")
        return self._session

    def _given(self, stage: tc.Stage) -> Any:
        """State record of a stage by which the loop gives."""
        return self.stage(stage.name).arguments[1]

    @property
    def _slave(self) -> Any:
        return self.stage("slave")

    def _advance(self, ticks: int) -> None:
        block = self._running.run(ticks)
        self._row = block[-1].copy()
        if self._bag:
            self._blocks.append(block)

    def _advance_period(self) -> None:
        """Go on to the next call of the loop; periods are whole ticks and drift from none."""
        self._periods += 1
        until_ns = self._begin_ns + self._periods * SECOND_NS // self._fps
        self._advance((until_ns - self._running.now_ns) // TICK_NS)

    def _named(self, joints: NDArray[np.float64]) -> dict[str, float]:
        return dict(zip(self.joint_keys, joints.tolist(), strict=True))
