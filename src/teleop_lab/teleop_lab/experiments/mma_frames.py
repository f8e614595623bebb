"""MMA frames: positions of the frames of the hybrid handle, in model and prototype (table 4.7)."""

import numpy as np

from teleop_core.evaluation.figure import FIRST, PUBLISHED, THIRD, Figure, in_space, scene
from teleop_core.robots import load_robot
from teleop_lab.experiments.bench import Bench
from teleop_lab.experiments.comparison import EXACT, Comparison, Findings, absolute
from teleop_lab.experiments.experiment import Experiment
from teleop_machines import mma_models, mobility

# Frame: printed model, measured prototype [mm].
TABLE_4_7 = {
    "4": ((160.7, 0.0, 325.2), (158.5, 0.0, 323.5)),
    "5": ((160.7, 0.0, 393.1), (158.5, 0.0, 391.0)),
    "6": ((160.7, -20.1, 393.1), (158.5, -22.9, 391.0)),
    "8": ((160.7, -55.2, 418.3), (158.5, -56.6, 417.2)),
    "9": ((122.4, -55.2, 418.3), (124.0, -56.6, 417.5)),
    "12": ((3.6, -71.3, 482.1), (3.6, -72.9, 481.5)),
}
_SERIAL_HOME = np.radians([0.0, -90.0, 90.0, 0.0, 90.0, 0.0, 0.0])
# The source prints one decimal; one of its values is cut, not rounded. The prototype was measured by hand.
_PRINTED, _BY_HAND = absolute(0.07), absolute(3.0)


def _measure(_: Bench) -> Findings:
    mma = load_robot("mma")
    found = mma_models.frames(mma_models.model_table("B", mma.geometry), _SERIAL_HOME)
    places = {name: 1e3 * found[name][:3, 3] for name in TABLE_4_7}
    rows = [
        Comparison(quantity=f"frame {name}, {letter}", unit="mm", published=column[k],
            predicted=places[name][k], within=tolerance, group=group)
        for which, group, tolerance in (
            (0, "model, home, as printed", _PRINTED), (1, "prototype, measured by hand", _BY_HAND)
        )
        for name, columns in TABLE_4_7.items()
        for column in [columns[which]]
        for k, letter in enumerate("xyz")
    ]  # fmt: skip
    gaps = [float(np.linalg.norm(places[n] - np.array(c[1]))) for n, c in TABLE_4_7.items()]
    rows += [
        Comparison(quantity="prototype off the model, largest", unit="mm", predicted=max(gaps),
            group="prototype, measured by hand"),
        Comparison(quantity="freedoms", published=7.0, predicted=float(mma.n), within=EXACT,
            group="mobility, section 3.5"),
        Comparison(quantity="independent loops", published=1.0,
            predicted=float(mobility.independent_loops(mma_models.LINKS, mma_models.JOINTS)), within=EXACT,
            group="mobility, section 3.5"),
        Comparison(quantity="freedoms of the parallelogram", published=2.0,
            predicted=float(mobility.degrees_of_freedom(5, 5, 5, space=mobility.PLANAR)), within=EXACT,
            group="mobility, section 3.5"),
    ]  # fmt: skip
    chain = np.vstack([np.zeros(3), *(1e3 * T[:3, 3] for T in found.values())])
    printed, measured = (np.array([c[k] for c in TABLE_4_7.values()]) for k in (0, 1))
    traces = [
        in_space(chain, "model", FIRST, 5, "lines+markers", size=3),
        in_space(printed, "model as printed", PUBLISHED, 1, "markers", size=4, symbol="diamond"),
        in_space(measured, "prototype as printed", THIRD, 1, "markers", size=4),
    ]
    sentence = "The handle at home: frames of our model, of the printed one, and of the prototype."
    return Findings(tuple(rows), (Figure("Frames", sentence, traces, scene("mm"), 460),))


MMA_FRAMES = Experiment(
    "mma_frames",
    "frames of the MMA handle at home, model and prototype; its mobility",
    "Singh 2014, tables 4.4 and 4.7, eq. 3.16",
    _measure,
)
