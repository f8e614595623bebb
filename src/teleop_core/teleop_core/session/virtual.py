"""Virtual time: runs a graph in one process, tick by tick, as fast as the machine allows."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from teleop_core.bags.arms import PLAYED_KEY
from teleop_core.base import PartError, ShapeError, TeleopError
from teleop_core.graph import BUILT_IN, TICK_NS, Runner, assign, topics
from teleop_core.graph.stage import joints_of
from teleop_core.hand.operators.behaviour import insist_on_virtual
from teleop_core.kernels import records
from teleop_core.session.compose import Rings, Tick, block_dtype, compose
from teleop_core.session.configuration import Configuration

BLOCK = 1000
"""Largest number of ticks in one call of the composed tick."""


class VirtualTime:
    """A session in virtual time. Each tick gives one row with all topics.

    Between two runs a program may read the rows, and command or retune the stages. For a program that moves the hand,
    :class:`~teleop_core.session.stepped.Session` is simpler.

    Args:
        configuration: Configuration of the session.
        tick_ns: Length of a tick [ns].
        played: Last stage whose topics come from recorded samples, ``operator`` or ``haptic_master``, see
            :meth:`replay`; empty if no stage is played.

    Attributes:
        configuration: As given.
        graph: Graph of the session.
        stages: Running stages, by the names of their members.
        joint_names: Joint names of each arm by its namespace; empty for an arm without a robot.
        now_ns: Time of the last tick [ns]; the first tick is one tick after 0.
        plays_file: Whether the played samples were not made by a simulated session, so that they may have gaps.
    """

    plays_file = False

    def __init__(self, configuration: Configuration, tick_ns: int = TICK_NS, *, played: str = "") -> None:
        self.configuration, self.graph = configuration, configuration.graph
        self._tick_ns, self._last_played = tick_ns, played
        groups, dt = configuration.groups, tick_ns / 1e9
        self._played = frozenset(m.name for m in self.graph.played(played))
        for member in self.graph.members:
            if member.name not in self._played:
                insist_on_virtual(member.name, groups[member.name])
        self.stages: dict[str, Runner] = {
            member.name: member.stage.run(groups[member.name], dt)
            for member in self.graph.members
            if member.name not in self._played
        }
        self.joint_names = {arm: self._joints(groups, arm) for arm in self.graph.namespaces}
        joints = {arm: len(names) for arm, names in self.joint_names.items()}
        self._dtype = block_dtype(self.graph, joints)
        self._ahead = min([BLOCK, *(stage.ahead for stage in self.stages.values())])
        self._rings: Rings = {}
        self._begin = {name: stage.signals.copy() for name, stage in self.stages.items()}
        self._tick = self._composed()
        self._empty = {place: ring.copy() for place, ring in self._rings.items()}
        self.now_ns = 0

    def _composed(self) -> Tick:
        """Composed tick of the stages with their current arguments."""
        self._arguments = [stage.arguments for stage in self.stages.values()]
        dt = self._tick_ns / 1e9
        return compose(self.graph, self.stages, self._dtype, dt, self._ahead, self._played, self._rings)

    def _is_stale(self) -> bool:
        """Whether a stage has new arguments since the tick was composed, for example another kind of fixture."""
        now = (stage.arguments for stage in self.stages.values())
        return any(old is not new for old, new in zip(self._arguments, now, strict=True))

    def _joints(self, groups: dict[str, Any], arm: str) -> tuple[str, ...]:
        names = [m.name for m in self.graph.members if m.arm == arm]
        return next((found for name in names if (found := joints_of(groups[name]))), ())

    @property
    def lead(self) -> int:
        """Number of ticks until all arms can follow, for example because they first move to their start."""
        return max(stage.lead for stage in self.stages.values())

    @property
    def needed_topics(self) -> tuple[topics.Topic, ...]:
        """Topics of :attr:`played_topics` that a recording must contain for a replay."""
        members = [m for m in self.graph.members if m.stage.name == self._last_played]
        return tuple(t for member in members for t in member.writes if t.kind is topics.Kind.POSE)

    @property
    def about(self) -> dict[str, str]:
        """Metadata for a recording of this session, in addition to its configuration."""
        return {PLAYED_KEY: self._last_played} if self.plays_file else {}

    @property
    def played_topics(self) -> tuple[topics.Topic, ...]:
        """Topics that :meth:`replay` takes from samples."""
        members = [m for m in self.graph.members if m.name in self._played]
        return tuple(topic for member in members for topic in member.writes)

    def rows(self, count: int) -> NDArray[np.void]:
        """New rows (count,) for the data of ticks, all zero."""
        rows: NDArray[np.void] = records(self._dtype, count)
        return rows

    def run(self, ticks: int, out: NDArray[np.void] | None = None) -> NDArray[np.void]:
        """Run the next ``ticks`` ticks of the session.

        Args:
            ticks: Number of ticks.
            out: Output rows (ticks,) from :meth:`rows`; None allocates new rows.

        Returns:
            Rows (ticks,): ``now_ns``, the fields and stamps of all topics, and the stages' notes.
            Each topic is one field, for example ``slave_measured_cp`` for ``slave/measured_cp``, with the topic's
            columns in SI units; ``slave_measured_cp_ns`` is its stamp.

        Raises:
            TeleopError: A part cannot continue, or writes NaN.
            ShapeError: ``out`` does not have ``ticks`` rows of the type of :meth:`rows`.
        """
        if out is None:
            out = self.rows(ticks)
        elif out.shape != (ticks,) or out.dtype != self._dtype:
            raise ShapeError("out, rows of this session", (ticks,), out.shape)
        return self._run(out, None)

    def reset(self) -> None:
        """Reset the session to its state before the first tick, so that the session repeats itself bit for bit.

        Changed parameters stay changed. A stage of your own is reset only by its own ``reset``.
        """
        for name, stage in self.stages.items():
            assign(stage.signals, self._begin[name])
            stage.reset()
        for place, ring in self._rings.items():
            ring[:] = self._empty[place]
        self.now_ns = 0

    def replay(self, samples: NDArray[np.void]) -> NDArray[np.void]:
        """Run ticks with recorded samples instead of simulated hands or masters.

        Args:
            samples: Rows (N,), one tick apart. Only ``now_ns`` and the fields and stamps of :attr:`played_topics` are
                used.

        Returns:
            Rows (N,), as :meth:`run` returns them.
        """
        self.now_ns = int(samples["now_ns"][0]) - self._tick_ns
        return self._run(self.rows(len(samples)), samples)

    def _run(self, block: NDArray[np.void], samples: NDArray[np.void] | None) -> NDArray[np.void]:
        if self._is_stale():
            self._tick = self._composed()
        try:
            for begin in range(0, len(block), self._ahead):
                part = block[begin : begin + self._ahead]
                for stage in self.stages.values():
                    stage.prepare(len(part))
                taken = None if samples is None else samples[begin : begin + self._ahead]
                self._tick.run(self.now_ns + self._tick_ns, self._tick_ns, taken, part)
                self.now_ns += len(part) * self._tick_ns
        except TeleopError:
            self._check(block[:begin])  # an earlier output of a user's stage may be the cause
            raise
        self._check(block)
        return block

    def _check(self, part: Any) -> None:
        """Make sure that a user's stages wrote finite numbers.

        This check is done once per block; its time hardly depends on the length of the block.

        Raises:
            PartError: A stage wrote NaN or infinity; the error text names topic and time.
        """
        for member in self.graph.members:
            if member.stage.name in BUILT_IN:
                continue
            for topic in member.writes:
                is_sound = np.isfinite(part[topic.field]).all(axis=1)
                if not is_sound.all():
                    when = part["now_ns"][int(np.flatnonzero(~is_sound)[0])] * 1e-9
                    text = f"one that writes finite numbers; {topic.name} at {when:g} s is not"
                    raise PartError("stage", member.name, text)
