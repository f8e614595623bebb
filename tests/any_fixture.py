"""Any fixture: parameters of every shape for hypothesis, and the depth at a place."""

import math

import numpy as np
from hypothesis import strategies as st

from teleop_core.base.errors import ParameterError
from teleop_core.chain.fixtures import FIXTURES
from teleop_core.chain.fixtures.box import BoxParameters
from teleop_core.chain.fixtures.cone import ConeParameters
from teleop_core.chain.fixtures.cylinder import CylinderParameters
from teleop_core.chain.fixtures.half_space import HalfSpaceParameters
from teleop_core.chain.fixtures.keep_out_box import KeepOutBoxParameters
from teleop_core.chain.fixtures.keep_out_sphere import KeepOutSphereParameters
from teleop_core.chain.fixtures.line import LineParameters
from teleop_core.chain.fixtures.path import PathParameters
from teleop_core.chain.fixtures.sphere import SphereParameters
from teleop_core.kernels.parts import numbers_of

lengths = st.floats(1e-3, 0.1)
places = st.tuples(*[st.floats(-0.1, 0.1)] * 3)
directions = st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda v: math.hypot(*v) > 1e-3)
sizes = st.tuples(lengths, lengths, lengths)
endings = st.one_of(st.just(0.0), lengths)


def valid(group, **values):
    """Groups of parameters, those that do not fit together left out."""

    def make(chosen):
        try:
            return group(**chosen)
        except ParameterError:
            return None

    return st.fixed_dictionaries(values).map(make).filter(lambda made: made is not None)


KINDS = {
    "box": valid(BoxParameters, size=sizes),
    "sphere": valid(SphereParameters, diameter=lengths),
    "cylinder": valid(CylinderParameters, diameter=lengths, length=endings, direction=directions),
    "half_space": valid(HalfSpaceParameters, normal=directions, room=st.floats(0.0, 0.1)),
    "cone": st.builds(
        lambda axis, far, half: ConeParameters(
            axis=axis, half_angle=half, apex=tuple(-far * x / math.hypot(*axis) for x in axis)
        ),
        directions, lengths, st.floats(0.05, 1.5),
    ),
    "line": valid(
        LineParameters, direction=directions, tolerance=st.floats(0.0, 0.02), length=endings
    ),
    "path": valid(
        PathParameters, tolerance=st.floats(0.0, 0.02),
        points=st.lists(places, min_size=1, max_size=5).map(lambda rows: sum(rows, ())),
    ),
    "keep_out_sphere": valid(KeepOutSphereParameters, place=places, diameter=lengths),
    "keep_out_box": valid(KeepOutBoxParameters, place=places, size=sizes),
}  # fmt: skip


def found(name, parameters, offset):
    """Depth and way of a fixture at a place (3,)."""
    out = np.full(3, math.nan)
    depth = FIXTURES.find(name).depth(np.array(offset, dtype=float), numbers_of(parameters), out)
    return depth, out
