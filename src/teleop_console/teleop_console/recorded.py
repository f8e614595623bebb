"""Recorded link: access of the page to a recording, like to a session, at any time of the recording."""

import math
import threading
from pathlib import Path
from types import MappingProxyType

import numpy as np

from teleop_console.link import ArmView, Parameters, SessionLink, View
from teleop_console.recorded_arms import configuration_of, parameters_of, recorded_arms
from teleop_console.recorded_past import Recorded
from teleop_core.bags.reader import Bag
from teleop_core.base.errors import ParameterError
from teleop_core.graph.topics import Topic
from teleop_core.kernels.geometry import Array

_PATH = 200  # largest number of points of a path


class RecordedLink(SessionLink):
    """A link to a recording; it refuses all commands of a session.

    A view contains, for each stream, the last sample that was recorded before the present time of the replay.
    :meth:`advance` advances this time; the caller provides the clock.

    Args:
        recording: Path of the recording, or the recording itself.

    Attributes:
        duration: Time from the first to the last message [s].
        loop: Whether the replay starts again at the end.
        thinning: Every ``thinning``-th sample is loaded; 1 means all samples.
        past: Columns of the recording, with all samples.
        recording: Path of the recording.

    Raises:
        RecordingError: The recording cannot be read, or lacks the robot's name or the joint positions. The message
            names the missing data.
    """

    is_live = False

    def __init__(self, recording: Bag | Path | str) -> None:
        bag = recording if isinstance(recording, Bag) else Bag(recording)
        self._bag, self.title = bag, bag.path.name
        self._start_ns = bag.start_ns
        self.duration = (bag.end_ns - bag.start_ns) * 1e-9
        self.loop = False
        self._time, self._speed, self._is_playing = 0.0, 1.0, False
        self._lock = threading.RLock()
        configuration = configuration_of(bag)
        self._recorded, self.thinning = recorded_arms(bag, configuration)
        self.arms = tuple(recorded.arm for recorded in self._recorded)
        self.past = Recorded(bag, {arm.name: arm.robot for arm in self.arms})
        self.recording = bag.path
        self._parameters = parameters_of(configuration)

    # -- seeing ----------------------------------------------------------------------------------

    def view(self, time: float | None = None) -> View:
        """Data at a time of the replay [s]; a time of None stands for the present time."""
        time = self._time if time is None else time
        view = View(
            time=time,
            arms={arm.name: ArmView() for arm in self.arms},
            is_fresh=True,
            news=self._news(),
            recording=self._bag.path,
        )
        time_ns = self._start_ns + round(time * 1e9)
        for recorded in self._recorded:
            recorded.show(time_ns, view.arms[recorded.arm.name])
        return view

    def _news(self) -> tuple[str, ...]:
        if self.thinning == 1:
            return ()
        return (f"a long recording: one of {self.thinning} samples is shown",)

    def path(self, topic: Topic, arm: str, length: float) -> tuple[Array, Array]:
        """Samples of a stream up to the present time.

        Args:
            topic: A stream; the result is empty if it was not recorded.
            arm: Namespace of the arm.
            length: Duration before the present time [s].

        Returns:
            Times (N,) [s] and rows (N, width), with N at most some hundreds.
        """
        one = next(recorded for recorded in self._recorded if recorded.arm.name == arm)
        track = one.tracks.get(topic.name)
        if track is None:
            return np.empty(0), np.empty((0, topic.width(one.arm.robot.n)))
        now_ns = self._start_ns + round(self._time * 1e9)
        begin, end = track.at(now_ns - round(length * 1e9)) + 1, track.at(now_ns) + 1
        chosen = np.unique(np.linspace(begin, max(begin, end - 1), _PATH).astype(int))
        chosen = chosen[chosen < end]
        times = np.asarray((track.log_ns[chosen] - self._start_ns) * 1e-9, np.float64)
        return times, track.values[chosen]

    def parameters(self) -> Parameters:
        """Parameters of the recorded session; empty if the recording does not contain them."""
        return MappingProxyType(self._parameters)

    # -- time ------------------------------------------------------------------------------------

    @property
    def time(self) -> float:
        """Present time of the replay [s], 0 to :attr:`duration`."""
        return self._time

    @property
    def is_playing(self) -> bool:
        """Whether the replay is running."""
        return self._is_playing

    @property
    def speed(self) -> float:
        """Speed of the replay relative to real time; a new speed must be from 0.01 to 100.

        Raises:
            ParameterError: The speed is out of this range.
        """
        return self._speed

    @speed.setter
    def speed(self, speed: float) -> None:
        if not 0.01 <= speed <= 100.0:  # NaN too
            raise ParameterError("speed", speed, "0.01 to 100")
        self._speed = float(speed)

    def seek(self, time: float) -> None:
        """Set the time of the replay [s]; it is limited to the begin and the end of the recording.

        Raises:
            ParameterError: The time is NaN.
        """
        if math.isnan(time):
            raise ParameterError("time", time, f"0 to {self.duration:.3f} s")
        with self._lock:
            self._time = min(max(float(time), 0.0), self.duration)

    def play(self) -> None:
        """Start the replay; if it is at the end, it starts again at the begin."""
        with self._lock:
            if self._time >= self.duration:
                self._time = 0.0
            self._is_playing = True

    def pause(self) -> None:
        """Pause the replay."""
        self._is_playing = False

    def advance(self, dt: float) -> None:
        """Advance the replay after ``dt`` [s] of real time; nothing happens while the replay is paused."""
        with self._lock:
            if not self._is_playing:
                return
            self.seek(self._time + self._speed * max(0.0, dt))
            if self._time >= self.duration:
                if self.loop:
                    self._time = 0.0
                else:
                    self.pause()
