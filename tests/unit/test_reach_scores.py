"""Reach in scores: shares of time and asked errors are those of plain counts, in any windows."""

from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from present import present
from recipes import JOINTS, START_NS, Recipe, state, terminal
from scaling_desk import ALIGNED
from teleop_core.bags import reader, reports
from teleop_core.bags.writer import BagWriter
from teleop_core.coupling.mapping.gains import MotionScalingParameters
from teleop_core.coupling.mapping.motion_scaling import MotionScaling
from teleop_core.evaluation import Score, evaluate
from teleop_core.evaluation.score_table import MET, NOT_MET, score_tables
from teleop_core.evaluation.windows import windows
from teleop_core.graph import STATE_FIELDS, TICK_NS, topics
from teleop_core.kernels.geometry import Array
from teleop_core.session.api import configuration

COUNT = 15_000  # ticks: some windows
SECOND_NS = 1_000_000_000
COLUMN = {name: index for index, name in enumerate(topics.SLAVE_REACH.columns)}
SHARES = ("followed", "joint", "workspace", "singularity", "speed", "aligning")
ALIGNING = len(topics.Limit)
# The published map of the master's axes to the slave's.
AXES = np.array([[0, 0, -1], [-1, 0, 0], [0, 1, 0]], float)
# Sums of up to 1e4 spans of time, and of positions in doubles in millimetres.
ROUNDING, EXACT_MM = 1e-9, 1e-9


class Session(Recipe):
    """A recipe with slave/reach; it stands in the file as it was recorded, second by second."""

    def __init__(self, count: int = COUNT) -> None:
        super().__init__(count)
        self.reach(self.stamps, np.zeros(count))

    def reach(
        self,
        stamp_ns: NDArray[np.int64],
        limits: Array | NDArray[np.int64],
        millimetres: float | Array = 0.0,
        degrees: float | Array = 0.0,
    ) -> None:
        """Say at some stamps (N,) what was in the way, and what was left of each command."""
        values = np.zeros((len(stamp_ns), len(COLUMN)))
        values[:, COLUMN["limit"]] = limits
        values[:, COLUMN["joint"]] = -1.0
        values[:, COLUMN["position_residual"]] = 1e-3 * millimetres
        values[:, COLUMN["rotation_residual"]] = np.radians(degrees)
        self.rows[topics.SLAVE_REACH] = (stamp_ns, values, stamp_ns)

    def tell(self, seconds: float, **values: Any) -> None:
        """Say in teleop/state what holds from some time on."""
        stamp_ns = START_NS + round(seconds * 1e9)
        self.singles.append((topics.TELEOP_STATE, stamp_ns, state(stamp_ns, **values)))

    def write(self, path: Path) -> Any:
        whole, blocks = self.rows, []
        for begin_ns in range(START_NS, int(self.stamps[-1]) + 1, SECOND_NS):
            block: Any = {}
            for topic, columns in whole.items():
                ends = np.searchsorted(columns[2], (begin_ns, begin_ns + SECOND_NS))
                block[topic] = tuple(column[slice(*ends)] for column in columns)
            blocks.append(block)
        with BagWriter(path, self.topics, JOINTS, metadata=self.metadata, start_ns=START_NS) as writer:
            for topic, log_ns, data in self.singles:
                writer.write(topic, log_ns, data)
            for block in blocks:
                writer.write_block(block)
        return reader.Bag(path)


def shares(score: Score) -> Any:
    return [getattr(score.reach, f"{name}_share") for name in SHARES]


def table_of(score: Score) -> str:
    """The table as a terminal shows it."""
    shown = terminal()
    for table in score_tables([score], 80):
        shown.print(table)
    return shown.export_text()


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "bag"


# -- shares of time --------------------------------------------------------------------------------


def irregular(rng: np.random.Generator) -> Any:
    """Stamps of commands (N,) [ns] after steps of some milliseconds, with pauses in between."""
    steps = rng.integers(1, 40, 2000)
    steps[rng.integers(0, 500, 4)] = rng.integers(400, 1500, 4)
    ticks = np.cumsum(steps)
    return START_NS + ticks[ticks < COUNT] * TICK_NS


@pytest.mark.parametrize("seed", range(4))
def test_shares_of_time_are_those_of_a_count_of_every_millisecond(path: Path, seed: int) -> None:
    rng = np.random.default_rng(seed)
    session, stamps = Session(), irregular(rng)
    limits = np.repeat(rng.integers(0, 5, len(stamps)), rng.integers(1, 60, len(stamps)))
    limits = limits[: len(stamps)]
    session.reach(stamps, limits)
    begin, away, back = 1.25, 6.0, 8.5
    session.singles = []
    for seconds, follows in ((0.0, 0.0), (begin, 1.0), (away, 0.0), (back, 1.0)):
        session.tell(seconds, is_following=follows)

    seconds = (stamps - START_NS) * 1e-9
    kinds = np.where((seconds >= away) & (seconds < back), ALIGNING, limits)[:-1]
    spans = np.diff(stamps) // TICK_NS
    kinds = np.where(spans > 500, ALIGNING, kinds)
    counted = seconds[:-1] >= begin
    every = np.repeat(kinds[counted], spans[counted])  # what is so in every millisecond
    assert len(np.unique(every)) == len(SHARES)

    bag = session.write(path)
    assert len(list(windows(bag, [topics.SLAVE_REACH]))) >= 3
    score = evaluate(bag)
    expected = np.bincount(every, minlength=len(SHARES)) / len(every)
    assert np.allclose(shares(score), expected, rtol=0, atol=ROUNDING)
    longest = max(len(list(run)) for is_off, run in groupby(every != topics.Limit.NONE) if is_off)
    assert score.reach.longest_s == pytest.approx(longest * 1e-3, abs=ROUNDING)


def test_a_stretch_goes_on_across_windows_whatever_its_cause(path: Path) -> None:
    session = Session()
    limits = np.zeros(COUNT)
    limits[500:900] = topics.Limit.SPEED
    limits[3200:6000], limits[6000:9700] = topics.Limit.JOINT, topics.Limit.WORKSPACE
    session.reach(session.stamps, limits)
    bag = session.write(path)
    assert len(list(windows(bag, [topics.SLAVE_REACH]))) >= 3
    score = evaluate(bag)
    assert score.reach.longest_s == pytest.approx(6.5, abs=ROUNDING)
    total = COUNT - 1  # milliseconds from the first command to the last
    assert score.reach.joint_share == pytest.approx(2800 / total, abs=ROUNDING)
    assert score.reach.followed_share == pytest.approx(1.0 - 6900 / total, abs=ROUNDING)


@pytest.mark.parametrize(("silence_ms", "aligning_ms"), [(500, 0), (501, 501), (3000, 3000)])
def test_silence_of_more_than_half_a_second_counts_as_aligning(path: Path, silence_ms: int, aligning_ms: int) -> None:
    session = Session()
    ticks = np.arange(0, COUNT, 10)
    ticks = np.concatenate((ticks[ticks <= 5000], ticks[ticks <= 5000] + 5000 + silence_ms))
    ticks = ticks[ticks < COUNT]
    session.reach(START_NS + ticks * TICK_NS, np.zeros(len(ticks)))
    score = evaluate(session.write(path))
    assert score.reach.aligning_share == pytest.approx(aligning_ms / np.ptp(ticks), abs=ROUNDING)
    assert score.reach.longest_s == pytest.approx(aligning_ms * 1e-3, abs=ROUNDING)


def test_clutched_time_counts_as_followed(path: Path) -> None:
    session = Session()
    session.tell(4.0, is_clutched=1.0)
    session.tell(9.0)
    assert evaluate(session.write(path)).reach.followed_share == 1.0


def test_a_slave_that_never_followed_has_no_shares(path: Path) -> None:
    session = Session()
    session.singles = []
    session.tell(0.0, is_following=0.0)
    score = evaluate(session.write(path))
    assert shares(score) == [None] * len(SHARES)
    assert score.reach.longest_s is None


def test_what_inverse_kinematics_left_is_counted_while_the_slave_follows(path: Path) -> None:
    rng = np.random.default_rng(2)
    session = Session()
    millimetres, degrees = rng.uniform(0, 5, COUNT), rng.uniform(0, 3, COUNT)
    session.reach(session.stamps, np.zeros(COUNT), millimetres, degrees)
    session.tell(5.0, is_following=0.0)
    session.tell(6.0)
    score = evaluate(session.write(path)).reach
    is_counted = np.ones(COUNT, bool)
    is_counted[5000:6000] = False
    for spread, left in ((score.residual_mm, millimetres), (score.residual_deg, degrees)):
        kept = left[is_counted]
        expected = np.sqrt(np.mean(kept**2)), np.std(kept, ddof=1), kept.max()
        assert np.allclose([present(v) for v in (spread.rms, spread.sd, spread.max)], expected, rtol=1e-9, atol=0)


# -- rate and interpolation ------------------------------------------------------------------------


def configured(interpolation: str) -> str:
    return f"slave: {{ros__parameters: {{interpolation: '{interpolation}'}}}}"


@pytest.mark.parametrize(
    ("interpolation", "period_ms", "delay_ms", "shown"),
    [
        ("linear", 8, 8.0, "linear, 8 ms"),
        ("minimum_jerk", 33, 33.0, "minimum jerk, 33 ms"),
        ("none", 8, 0.0, "none"),
        ("linear", 1, 0.0, "linear"),
    ],
)
def test_interpolation_is_late_by_a_period_of_slow_commands(
    path: Path, interpolation: str, period_ms: int, delay_ms: float, shown: str
) -> None:
    session = Session()
    session.metadata["configuration"] = configured(interpolation)
    a, b, c = session.rows[topics.SLAVE_SERVO_CP]
    session.rows[topics.SLAVE_SERVO_CP] = (a[::period_ms], b[::period_ms], c[::period_ms])
    score = evaluate(session.write(path))
    assert score.reach.master_hz == pytest.approx(1000.0 / period_ms)
    assert score.reach.interpolation == interpolation
    assert score.reach.interpolation_ms == delay_ms
    assert shown in {line.split(maxsplit=1)[1].strip() for line in lines(score, "interpolation")}


def lines(score: Score, label: str) -> list[str]:
    return [text for text in table_of(score).splitlines() if text.split()[:1] == [label]]


# -- what the hand asked for -----------------------------------------------------------------------


def hand_and_command(session: Session, gain: Array, is_held: NDArray[np.bool_], cuts: Array) -> tuple[Array, Array]:
    """Write a hand that wanders, and the command that follows it but for what is cut off."""
    rng = np.random.default_rng(4)
    hand = np.cumsum(1e-5 * rng.normal(size=(COUNT, 3)), axis=0)
    poses = session.values(topics.SLAVE_SERVO_CP).copy()
    poses[:, :3] = hand
    session.rows[topics.MASTER_MEASURED_CP] = (session.stamps, poses, session.stamps)
    command = session.values(topics.SLAVE_SERVO_CP)
    for i in range(1, COUNT):
        moved = 0.0 if is_held[i] or is_held[i - 1] else gain[i] * AXES @ (hand[i] - hand[i - 1])
        command[i, :3] = command[i - 1, :3] + moved + cuts[i]
    session.values(topics.SLAVE_MEASURED_CP)[:] = command
    return hand, command


def test_asked_error_is_what_was_cut_off_since_the_last_clutch_stroke(path: Path) -> None:
    rng = np.random.default_rng(6)
    session = Session()
    gain, is_held = np.ones(COUNT), np.zeros(COUNT, bool)
    is_held[3900:4300] = is_held[9000:9500] = True
    gain[6000:] = 0.1
    session.tell(3.9, is_clutched=1.0)
    session.tell(4.3)
    session.tell(6.0, gain=0.1)
    session.tell(9.0, gain=0.1, is_clutched=1.0)
    session.tell(9.5, gain=0.1)
    # Limits cut for some stretches, also where windows meet and where nothing moves the slave.
    cuts = np.zeros((COUNT, 3))
    for first, last in ((2000, 2600), (4950, 5100), (7000, 7900), (12_000, 12_100)):
        cuts[first:last] = 1e-5 * rng.normal(size=(last - first, 3)) + 2e-6
    hand_and_command(session, gain, is_held, cuts)

    missing, since = np.zeros(COUNT), np.zeros(3)
    for i in range(COUNT):
        is_new = i == 0 or is_held[i] or is_held[i - 1]
        since = np.zeros(3) if is_new else since + cuts[i]
        missing[i] = 1e3 * np.linalg.norm(since)
    kept = missing[~is_held]
    bag = session.write(path)
    assert len(list(windows(bag, [topics.SLAVE_SERVO_CP]))) >= 3
    error: Any = (evaluate(bag).value("asked_error_mm.rms"), evaluate(bag).value("asked_error_mm.max"))
    assert kept.max() > 0.3
    assert np.allclose(error, (np.sqrt(np.mean(kept**2)), kept.max()), rtol=0, atol=EXACT_MM)


@pytest.mark.parametrize("at", range(0, COUNT - 100, 2100))
def test_no_sample_of_the_slave_is_left_out_of_the_asked_error(path: Path, at: int) -> None:
    session = Session()
    still = np.zeros(COUNT, bool)
    hand_and_command(session, np.ones(COUNT), still, np.zeros((COUNT, 3)))
    session.values(topics.SLAVE_MEASURED_CP)[at : at + 100, 1] += 5e-3
    error = evaluate(session.write(path))
    assert error.value("asked_error_mm.max") == pytest.approx(5.0, abs=EXACT_MM)
    expected = 5.0 * np.sqrt(100 / COUNT)
    assert error.value("asked_error_mm.rms") == pytest.approx(expected, abs=EXACT_MM)


def test_an_error_against_the_setpoint_hides_what_the_asked_error_tells(path: Path) -> None:
    session = Session()
    cuts = np.zeros((COUNT, 3))
    cuts[1000:3000, 0] = 1e-5  # 20 mm in all
    hand_and_command(session, np.ones(COUNT), np.zeros(COUNT, bool), cuts)
    score = evaluate(session.write(path))
    assert present(score.command_error_mm.max) < EXACT_MM
    assert score.value("asked_error_mm.max") == pytest.approx(20.0, abs=EXACT_MM)


def turned_session(cut_from: int = COUNT, **parameters: Any) -> Any:
    """A session whose hand turns; from some tick on the tool no longer turns with it."""
    parameters = ALIGNED | parameters
    rng = np.random.default_rng(9)
    session, scaling = Session(), MotionScaling(MotionScalingParameters(**parameters))
    row = scaling.signals
    turns = Rotation.from_rotvec(2e-3 * rng.normal(size=(COUNT, 3)))
    attitude, hands, commands = Rotation.identity(), np.zeros((COUNT, 7)), np.zeros((COUNT, 7))
    row["slave_setpoint_cp"] = session.values(topics.SLAVE_SERVO_CP)[0]
    for i, stamp_ns in enumerate(session.stamps):
        attitude = turns[i] * attitude
        row["master_measured_cp"][3:] = attitude.as_quat(scalar_first=True)
        row["master_measured_cp_ns"] = stamp_ns
        row["slave_setpoint_cp_ns"] = stamp_ns - TICK_NS
        scaling.step()
        hands[i], commands[i] = row["master_measured_cp"], row["slave_servo_cp"]
        row["slave_setpoint_cp"] = row["slave_servo_cp"]
    commands[cut_from:] = commands[cut_from - 1]
    session.rows[topics.MASTER_MEASURED_CP] = (session.stamps, hands, session.stamps)
    for topic in (topics.SLAVE_SERVO_CP, topics.SLAVE_MEASURED_CP):
        session.values(topic)[:] = commands
    texts = configuration(settings={f"motion_scaling.{n}": v for n, v in parameters.items()}).text()
    session.metadata["configuration"] = texts
    return session, Rotation.from_quat(hands[:, 3:], scalar_first=True)


@pytest.mark.parametrize(
    "parameters",
    [
        {},
        {"tool_roll": 0.4},
        {"axes": ("+x", "+y", "+z"), "tool_axes": ("-x", "+y", "-z")},
        {"tool_axes": ()},
        {"axes": ("+x", "+y", "+z"), "tool_axes": ()},
    ],
)
def test_a_tool_that_turns_as_the_hand_is_where_it_was_asked_to_be(path: Path, parameters: Any) -> None:
    session, _ = turned_session(**parameters)
    assert present(evaluate(session.write(path)).asked_error_deg.max) < 1e-5


def test_asked_error_of_a_tool_that_is_held_is_the_turn_of_the_hand_since(path: Path) -> None:
    session, hand = turned_session(cut_from=7000)
    off = np.degrees((hand[6999].inv() * hand[6999:]).magnitude())
    error = evaluate(session.write(path)).asked_error_deg
    assert off.max() > 5.0
    assert error.max == pytest.approx(off.max(), abs=1e-5)
    assert error.rms == pytest.approx(np.sqrt(np.sum(off**2) / COUNT), abs=1e-4)


def test_a_tool_that_turns_less_than_the_hand_has_no_asked_orientation(path: Path) -> None:
    session, _ = turned_session(rotation_gain=0.5)
    assert evaluate(session.write(path)).asked_error_deg.max is None


# -- published figures -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("lost_ms", "told"),
    [(0, None), (149, None), (151, "98.9 % < 99 %"), (300, "97.9 % < 99 %"), (7500, "49.9 % < 99 %")],
)
def test_marks_of_published_figures_need_99_percent_and_the_table_says_so(
    path: Path, lost_ms: int, told: str | None
) -> None:
    session, limits = Session(), np.zeros(COUNT)
    limits[5000 : 5000 + lost_ms] = topics.Limit.WORKSPACE
    session.reach(session.stamps, limits)
    text = table_of(evaluate(session.write(path)))
    assert "(0.338)" in text
    body = text.split("agrees,")[0].rpartition("\n")[0]  # without the caption, which explains them
    has_marks = MET in body or NOT_MET in body
    assert has_marks is (told is None)
    assert ("too little to compare" in text) is (told is not None)
    assert told is None or told in text


def test_recordings_of_before_have_no_rows_of_reach_and_no_marks(path: Path) -> None:
    session = Session()
    del session.rows[topics.SLAVE_REACH]
    session.topics.remove(topics.SLAVE_REACH)
    known = set(STATE_FIELDS) - {"limit", "limited_joint"}
    texts = {name: str(float(name in {"gain", "is_following"})) for name in known}
    session.singles = [(topics.TELEOP_STATE, START_NS, reports.report(START_NS, "teleop", 0, "FOLLOWING", texts))]
    score: Any = evaluate(session.write(path))
    assert shares(score) == [None] * len(SHARES)
    assert score.reach.residual_mm.rms is score.reach.interpolation is None
    assert score.value("asked_error_mm.rms") is None
    text = table_of(score)
    for label in (
        "followed, time %",
        "longest not followed s",
        "at a joint's end %",
        "left by IK, RMS mm",
        "interpolation",
    ):
        assert label not in text
    line = next(line for line in text.splitlines() if "too little to compare" in line)
    assert line.strip().endswith("not known")
    assert MET not in text.split("agrees,")[0].rpartition("\n")[0]
