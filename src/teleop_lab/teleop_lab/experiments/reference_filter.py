"""Filter: the low-pass on the joint references, and how much of the gimbal's jitter remains."""

import math

import numpy as np

from teleop_core.evaluation.figure import COMMAND, FIRST, MEASURED, Figure, axis, level, line, points, time_axis
from teleop_core.graph.signals import DT
from teleop_core.kernels.filters import lag_step
from teleop_core.kernels.geometry import Array
from teleop_core.slave.parameters import ReferenceFilterParameters
from teleop_lab.experiments.bench import Bench, ScoredSession, Settings
from teleop_lab.experiments.comparison import EXACT, Comparison, Findings, absolute, factor
from teleop_lab.experiments.experiment import Experiment

# Coefficients of eqs. 6.2.8 and 6.2.9, printed to two digits; a wrong sign is corrected.
_COEFFICIENTS = {"of the last output": 0.99, "of the last input": -0.09, "of the input": 0.1}
_STEP = (0.1, 0.109, 0.11791)
_BEFORE = 2e-3  # printed jitter before the filter [rad]
_AFTER = 5e-4  # printed jitter after the filter [rad]
_RESTS: Settings = {
    "operator.kind": "hold",
    "operator.rotation": 0.0,
    "operator.tremor_amplitude": 0.0,
    "buttons.fixture": (),
    "duration": 16.0,
}
_JUDGED = "theta5"  # theta5 turns by the gimbal's angle; near the home pose theta4 and theta6 turn by more
_WRIST = ("theta4", "theta5", "theta6")
_QUIET_S = 6.0  # time at which the approach is over and the filter has settled [s]


def lag(value: float, last_input: float, last_output: float) -> float:
    """Next output of the reference filter with the default parameters."""
    p = ReferenceFilterParameters()
    return float(lag_step(value, last_input, last_output, p.gain, p.zero, p.pole, DT))


def step_response(count: int) -> Array:
    """Response (count,) of the filter to a unit step, from rest."""
    out, last_input, last = [], 0.0, 0.0
    for _ in range(count):
        last = lag(1.0, last_input, last)
        last_input = 1.0
        out.append(last)
    return np.array(out)


def gain_at(frequency: Array) -> Array:
    """Gain of the filter at frequencies [Hz], from its difference equation."""
    z = np.exp(2j * math.pi * np.asarray(frequency) * DT)
    a, b, c = lag(0.0, 0.0, 1.0), lag(0.0, 1.0, 0.0), lag(1.0, 0.0, 0.0)
    return np.asarray(np.abs((c + b / z) / (1.0 - a / z)), dtype=np.float64)


def _measure(bench: Bench) -> Findings:
    found = (lag(0.0, 0.0, 1.0), lag(0.0, 1.0, 0.0), lag(1.0, 0.0, 0.0))
    rows = [
        Comparison(
            quantity=f"coefficient {name}",
            published=printed,
            predicted=value,
            within=EXACT,
            group="difference equation at 1 kHz",
        )
        for (name, printed), value in zip(_COEFFICIENTS.items(), found, strict=True)
    ]
    rows += [
        Comparison(
            quantity=f"unit step after {k} ticks",
            published=printed,
            predicted=value,
            within=EXACT,
            basis="law",
            group=rows[0].group,
        )
        for k, (printed, value) in enumerate(zip(_STEP, step_response(3), strict=True), start=1)
    ]
    rows += [
        Comparison(
            quantity="gain at rest", published=1.0, predicted=float(gain_at(np.zeros(1))[0]), within=EXACT, group="gain"
        ),
        Comparison(
            quantity="gain at 50 Hz",
            published=0.1,
            predicted=float(gain_at(np.array([50.0]))[0]),
            within=absolute(0.01),
            group="gain",
        ),
        Comparison(quantity="lag behind a ramp", unit="ms", predicted=_ramp_lag_ms(), group="gain"),
    ]
    session = bench.session("coarse_box", settings=_RESTS)
    jitter = {name: _jitter(session, name) for name in _WRIST}
    group = "jitter of the references with the stylus at rest, half of peak to peak"
    for when, printed, which in (("before", _BEFORE, 0), ("after", _AFTER, 1)):
        rows += [
            Comparison(
                quantity=f"{when} the filter, {name}",
                unit="rad",
                predicted=pair[which],
                published=printed if name == _JUDGED else None,
                within=factor(1.5) if name == _JUDGED else None,
                group=group,
            )
            for name, pair in jitter.items()
        ]
    return Findings(tuple(rows), (_jitter_figure(session), _gain_figure()), _NOTES)


_NOTES = (
    "The equation is printed with its pole outside the unit circle (1.01) and diverges as such. "
    "The ±2e-3 rad are what the source saw of its reference, from which the noise of the gimbal is "
    "derived; what is predicted is what comes through kinematics and filter.",
)


def _ramp_lag_ms() -> float:
    """Delay [ms] of the filter's output behind a ramp, after ten seconds."""
    last = 0.0
    ticks = 10_000
    for k in range(1, ticks + 1):
        last = lag(float(k), float(k - 1), last)
    return ticks - last


def _quiet(session: ScoredSession, name: str) -> tuple[Array, Array, Array]:
    """Times [s] and references before and after the filter [rad], while the stylus rests."""
    before, after = session["slave/servo_jp"], session["slave/setpoint_js"]
    start = float(before.time[np.argmax(session.is_followed)]) + _QUIET_S
    kept, same = before.time >= start, after.time >= start
    return before.time[kept] - start, before[name][kept], after[name][same]


def _jitter(session: ScoredSession, name: str) -> tuple[float, float]:
    """Jitter of a joint's reference before and after the filter [rad], as half of the peak-to-peak value."""
    _, before, after = _quiet(session, name)
    return 0.5 * float(np.ptp(before)), 0.5 * float(np.ptp(after))


def _jitter_figure(session: ScoredSession) -> Figure:
    times, before, after = _quiet(session, "theta5")
    middle = float(before.mean())
    traces = [
        line(times, 1e3 * (before - middle), "before the filter", COMMAND, 1.0, "mrad"),
        line(times[: len(after)], 1e3 * (after - middle), "after it", MEASURED, 1.5, "mrad"),
    ]
    drawn = [
        level(sign * 1e3 * value, f"published ±{1e3 * value:g}" if sign > 0 else "")
        for value in (_BEFORE, _AFTER)
        for sign in (1.0, -1.0)
    ]
    layout = {
        "xaxis": {**time_axis(), "range": [0.0, 2.0]},
        "yaxis": axis("reference of joint 5", "mrad"),
        "shapes": [shape for shape, _ in drawn],
        "annotations": [note for _, note in drawn],
    }
    sentence = "Reference of joint 5 around its mean with the stylus at rest, as figure 6.11."
    return Figure("Jitter that remains after the filter", sentence, traces, layout, 340)


def _gain_figure() -> Figure:
    frequency = np.logspace(-1.0, 2.6, 200)
    traces = [
        line(frequency, gain_at(frequency), "difference equation", FIRST, 2.0, ""),
        points(np.array([50.0]), np.array([0.1]), "published", "#111", "", 0),
    ]
    layout = {"xaxis": axis("frequency", "Hz", type="log"), "yaxis": axis("gain", type="log")}
    return Figure("Gain of the filter", "Gain against frequency.", traces, layout, 300)


FILTER = Experiment(
    "filter",
    "the low-pass on the references: coefficients, gain, and remaining jitter",
    "Vongbunyong 2008, eqs. 6.2.8-6.2.9, figure 6.11",
    _measure,
)
