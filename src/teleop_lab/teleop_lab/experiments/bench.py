"""Bench: runs the sessions of experiments, each only once."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from teleop_core.base.errors import ParameterError, UnknownNameError
from teleop_core.base.workers import workers
from teleop_core.evaluation import Score
from teleop_core.graph.topics import NO_COMMAND_NS
from teleop_core.hand.operators import Motion
from teleop_core.kernels.geometry import Array
from teleop_core.session.recording import Recording, Stream
from teleop_core.session.runner import silent
from teleop_core.slave.pair import ArmParameters
from teleop_core.slave.parameters import SlaveParameters
from teleop_core.slave.slave_sim import SlaveSimParameters

Setting = float | str | bool | tuple[float, ...] | tuple[str, ...]
Settings = Mapping[str, Setting]
Progress = Callable[[int, int], None]
Job = TypeVar("Job")
Result = TypeVar("Result")
_WHOLE = 16  # number of sessions whose streams stay in memory, 25 MB each
SEEDS = 3
"""Number of sessions, each with a different hand, over which results are averaged."""
# Topics that experiments read. All other topics of a recording are deleted, because they fill most of the memory.
_KEPT = (
    "master/measured_cp",
    "slave/servo_cp",
    "slave/servo_jp",
    "slave/setpoint_js",
    "slave/setpoint_cp",
    "slave/measured_js",
    "slave/measured_cp",
    "slave/true_cp",
    "teleop/state",
)
_OF_SLAVE = ("slave/setpoint_js", "slave/setpoint_cp", "slave/measured_js", "slave/true_cp")


@dataclass(frozen=True, eq=False)
class ScoredSession:
    """Score of one session, and the streams that experiments read.

    Attributes:
        name: Name of the scenario.
        seed: Seed of the session.
        judge: Function that returns the score of the session.
        read: Function that returns the streams by topic.
    """

    name: str
    seed: int
    judge: Callable[[], Score]
    read: Callable[[], Mapping[str, Stream]]

    @property
    def score(self) -> Score:
        """Score of the session. A session that was not scored is run again and gives exactly the same data."""
        return self.judge()

    @property
    def streams(self) -> Mapping[str, Stream]:
        """Streams by topic.

        If memory no longer contains them, the session is run again and gives exactly the same data.
        """
        return self.read()

    def __getitem__(self, topic: str) -> Stream:
        """Return the stream of a topic.

        Raises:
            UnknownNameError: The topic was not recorded, or its stream is not in memory.
        """
        streams = self.streams
        if topic not in streams:
            raise UnknownNameError("topic", topic, streams)
        return streams[topic]

    def places_mm(self, topic: str) -> Array:
        """Positions (N, 3) [mm] of a stream of poses, in the slave's base."""
        return 1e3 * self[topic][["x", "y", "z"]]

    @property
    def time(self) -> Array:
        """Times (N,) [s] of the slave's poses since the recording began."""
        return self["slave/measured_cp"].time

    @property
    def is_followed(self) -> NDArray[np.bool_]:
        """Whether the slave follows the hand, for each pose of the slave (N,); false before following begins."""
        return self["slave/setpoint_cp"].stamp_ns > NO_COMMAND_NS


class Bench:
    """Runs sessions in virtual time, and remembers them.

    Args:
        seed: First seed; sessions of several hands also use the following seeds.
        progress: Called with the progress of the running session.
        settings: Parameters of every session; they override the scenario.
        workers: Number of processes over which :meth:`map` distributes work. With more than 1, a program must call this
            below ``if __name__ == "__main__":``.

    Raises:
        ParameterError: The seed is negative.
    """

    def __init__(
        self, seed: int = 1, progress: Progress = silent, settings: Settings | None = None, workers: int = 1
    ) -> None:
        if seed < 0:
            raise ParameterError("seed", seed, "0 or more")
        self.seed, self.progress, self.workers = seed, progress, workers
        self._settings = dict(settings or {})
        self._known: dict[object, ScoredSession] = {}
        self._streams: dict[object, Mapping[str, Stream]] = {}  # streams of the last sessions

    @property
    def seeds(self) -> range:
        """Seeds of several hands."""
        return range(self.seed, self.seed + SEEDS)

    @property
    def runs(self) -> int:
        """How many sessions ran so far."""
        return len(self._known)

    def session(
        self, scenario: str, seed: int | None = None, settings: Settings | None = None, *, is_scored: bool = True
    ) -> ScoredSession:
        """Return a session; it is run unless the bench has run an equal session before.

        Args:
            scenario: One of ``teleop scenarios``.
            seed: Seed of all random numbers of the session; None for the bench's first seed.
            settings: Parameters that override the scenario and the bench's settings.
            is_scored: Whether the score is needed; scoring takes longer than the session itself.

        Raises:
            TeleopError: A setting or the scenario is wrong.
        """
        number = self.seed if seed is None else seed
        given = self._settings | dict(settings or {})
        key = (scenario, number, tuple((name, repr(given[name])) for name in sorted(given)))
        if key not in self._known:
            recording = self._run(scenario, number, given)
            score = recording.score() if is_scored else None
            self._keep(key, _aligned(recording))

            def read() -> Mapping[str, Stream]:
                if key not in self._streams:
                    self._keep(key, _aligned(self._run(scenario, number, given)))
                return self._streams[key]

            @cache
            def judge() -> Score:
                return score or self._run(scenario, number, given).score()

            self._known[key] = ScoredSession(scenario, number, judge, read)
        return self._known[key]

    def _keep(self, key: object, streams: Mapping[str, Stream]) -> None:
        """Store the streams of a session in memory, and delete the oldest streams if there are too many."""
        self._streams[key] = streams
        if len(self._streams) > _WHOLE:
            del self._streams[next(iter(self._streams))]

    def sessions(
        self, scenario: str, settings: Settings | None = None, *, is_scored: bool = True
    ) -> list[ScoredSession]:
        """Run one session for each of several hands; see :meth:`session`."""
        return [self.session(scenario, seed, settings, is_scored=is_scored) for seed in self.seeds]

    def slave(self, settings: Settings | None = None) -> ArmParameters:
        """Parameters of a slave with the bench's settings and further settings, for experiments with the slave alone.

        Raises:
            TeleopError: A setting is wrong.
        """
        from teleop_core.session.api import configuration

        given = {"seed": self.seed, **self._settings, **dict(settings or {})}
        made = configuration(settings=given)
        return ArmParameters.of(made.of(SlaveParameters), made.of(SlaveSimParameters))

    def signals(
        self, scenario: str, seconds: float, settings: Settings | None = None, motion: Motion | None = None
    ) -> Mapping[str, Array]:
        """Run a session and return the outputs of its stages, a row for each tick.

        This is faster than a scored session.

        Args:
            scenario: One of ``teleop scenarios``.
            seconds: Duration of the session [s].
            settings: Parameters that override the scenario and the bench's settings.
            motion: Wanted motion of the hand; it replaces the scenario's operator.

        Raises:
            TeleopError: A setting or the scenario is wrong.
        """
        from teleop_core.session.api import configuration
        from teleop_core.session.virtual import VirtualTime

        given = {"seed": self.seed, **self._settings, **dict(settings or {})}
        session = VirtualTime(configuration(scenario, settings=given, operator=motion))
        rows = session.run(round(seconds * 1e3))
        return {name: rows[name] for name in rows.dtype.names or ()}

    def map(self, work: Callable[["Bench", Job], Result], jobs: Sequence[Job]) -> list[Result]:
        """Results of ``work(bench, job)`` in the order of the jobs, computed in parallel.

        Args:
            work: A function of a module. Its argument ``bench`` has the seed and the settings of this bench.
            jobs: Values that can be sent to another process.
        """
        do = partial(_work, work, self.seed, self._settings)
        if self.workers == 1:
            return list(self._counted(map(do, jobs), len(jobs)))
        with workers(self.workers) as pool:
            return list(self._counted(pool.map(do, jobs), len(jobs)))

    def _counted(self, results: Iterable[Result], total: int) -> Iterator[Result]:
        for done, result in enumerate(results, start=1):
            self.progress(done, total)
            yield result

    def _run(self, scenario: str, seed: int, settings: Settings) -> Recording:
        from teleop_core.session.api import run

        return run(scenario, seed=seed, settings=settings, progress=self.progress)


def _work(work: Callable[[Bench, Job], Result], seed: int, settings: Settings, job: Job) -> Result:
    return work(Bench(seed, settings=settings), job)


def _aligned(recording: Recording) -> Mapping[str, Stream]:
    """Streams of the slave, aligned so that a row belongs to one sample; the measured pose is recorded a tick later."""
    streams = {name: recording[name] for name in _KEPT}
    for name in _OF_SLAVE:
        streams[name] = streams[name].part(slice(0, -1))
    later = streams["slave/measured_cp"]
    return streams | {"slave/measured_cp": later.part(slice(1, None))}


def mean(values: Iterable[float]) -> float:
    """Mean of some numbers, at least one."""
    return float(np.mean(list(values)))


def rms(values: Array) -> float:
    """Root mean square of an array of any shape."""
    return float(np.sqrt(np.mean(np.square(values))))


def pooled(values: Iterable[float]) -> float:
    """Total RMS of sessions of equal length, computed from the RMS of each session."""
    return rms(np.array(list(values)))
