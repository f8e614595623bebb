"""Decomposition: which arms have a closed form, recognised from the geometry of their axes.

The classes, in the order of the search; each is tried from the base and, reversed, from the tip:

- *spherical wrist*: six turning joints, the last three axes meet in a point;
- *three parallel axes*: six turning joints, axes 2, 3 and 4 are parallel;
- *spherical shoulder and wrist*: seven turning joints; axes 1, 2, 3 meet in a point, and axes 5, 6, 7 meet in a point;
- *arm in a plane*: three parallel turning joints, either with a slide along their axes, or with a first joint that
  turns their plane, a last joint that rolls the tool in this plane, or both.

Axes count as meeting or parallel within the tolerance :data:`NEARLY`, because some files contain 1.571 for a quarter
turn. Newton steps on the true chain remove the resulting error. Arms in a plane must fit exactly. Arms without a class
are solved by search (:mod:`teleop_core.kinematics.dh_kernels`). For arms with six directions the solution states the
deviations of their axes from the classes.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from teleop_core.kernels import Array, arctangent, dot, inverse_motion, length, product, rotation, transform
from teleop_core.kinematics import Kernels, dh_kernels
from teleop_core.kinematics.closed_form import parallel_axes, plane_arm, spherical_wrist, swivel

NEARLY = 1e-3
"""Tolerance of parallel axes [rad], and of axes that meet in a point, divided by the reach."""
_EXACT = 1e-5  # up to this deviation, one Newton step after the closed form is enough
_LEVEL = 1e-9  # the tolerance for arms in a plane
_LEAST = 1e-3  # an arm with a smaller length, divided by the reach, or a smaller sine counts as degenerate
_PARALLEL, _MEETING, _SKEW = 0.0, 1.0, 2.0
_NEAR = ", within 1e-3 of the class and finished by Newton steps"
_Z = np.array([0.0, 0.0, 1.0])
_FLIP = np.diag([1.0, -1.0, -1.0, 1.0])


@dataclass(frozen=True, kw_only=True)
class Solution:
    """Solution of an arm: description, kernels, and the constants after its geometry row."""

    text: str
    kernels: Kernels
    constants: tuple[float, ...] = ()


def _closed(ik: object, ik_all: object) -> Kernels:
    return Kernels(fk=dh_kernels.fk, jacobian=dh_kernels.jacobian, ik=ik, ik_all=ik_all)  # type: ignore[arg-type]


SEARCH = Solution(
    text="search: damped least squares from the seed, then from 24 starts or more",
    kernels=_closed(dh_kernels.ik, dh_kernels.ik_all),
)


@dataclass(kw_only=True)
class _Chain:
    """Turning joints about z with constant transforms around them, from base to tip or from tip to base.

    ``signs`` are the directions of the arm's own joints; ``order`` is -1 for a chain from the tip. ``off`` is the
    largest deviation that was neglected, an angle or a share of the reach. ``misses`` contains the reasons why the
    chain fits no class.
    """

    order: float
    signs: list[float]
    fixed: list[Array]
    reach: float
    off: float = 0.0
    misses: dict[str, str] = field(default_factory=dict)

    def is_parallel(self, joints: Sequence[int]) -> bool:
        """Whether the axes of some joints are parallel."""
        axes = [self.frames()[joint][:3, 2] for joint in joints]
        off = max(float(length(np.cross(axes[0], axis))) for axis in axes[1:])
        return self._counts(off, joints, f"are {math.degrees(math.asin(min(off, 1.0))):.3g}° from parallel")

    def do_meet(self, joints: Sequence[int]) -> bool:
        """Whether three neighbouring axes meet in a point; if so, move their frames' origins there."""
        axes = [self.frames()[joint][:3, 2] for joint in joints]
        if any(length(np.cross(a, b)) <= NEARLY for a, b in pairwise(axes)):
            return False
        first, middle, last = joints
        self.slide_next_to(middle, first)
        centre = self.frames()[middle][:3, 3]
        for joint in (first, last):
            frame = self.frames()[joint]
            self.slide(joint, float(dot(frame[:3, 2], centre - frame[:3, 3])))
        off = max(float(length(self.frames()[joint][:3, 3] - centre)) for joint in joints)
        text = f"miss a point by {1e3 * off:.3g} mm"
        return self._counts(off / self.reach, joints, text)

    def null_rule(self, rows: Array) -> tuple[float, float, float] | None:
        """Null vector (2,) of two linearly dependent rows (2, 2), and the larger row; None if they are independent."""
        sizes = length(rows)
        large = int(sizes[1] > sizes[0])
        a, b = rows[large], rows[1 - large]
        off = float(abs(a[0] * b[1] - a[1] * b[0]) / sizes[large] ** 2)
        if off > NEARLY:
            return None
        self.off = max(self.off, off)
        share = -float(dot(a, b) / dot(a, a))
        return (share, 1.0, large) if large == 0 else (1.0, share, large)

    def _counts(self, off: float, joints: Sequence[int], text: str) -> bool:
        """Whether the deviation ``off`` is negligible; if not, ``text`` is stored as the reason."""
        if off <= NEARLY:
            self.off = max(self.off, off)
            return True
        n = len(self.signs)
        names = sorted(joint + 1 if self.order > 0.0 else n - joint for joint in joints)
        self.misses[", ".join(map(str, names))] = text
        return False

    def frames(self) -> list[Array]:
        """Frame of each joint at zero in the chain's base."""
        out = [self.fixed[0]]
        for between in self.fixed[1:-1]:
            out.append(product(out[-1], between))
        return out

    def slide(self, joint: int, distance: float) -> None:
        """Move a joint's frame along the joint's axis."""
        self._move(joint, transform(np.eye(3), distance * _Z))

    def spin(self, joint: int, angle: float) -> None:
        """Rotate a joint's frame about the joint's axis."""
        self._move(joint, transform(rotation("z", angle), np.zeros(3)))

    def flip(self, joint: int) -> None:
        """Reverse a joint's axis."""
        self._move(joint, _FLIP)
        self.signs[joint] = -self.signs[joint]

    def _move(self, joint: int, by: Array) -> None:
        self.fixed[joint] = product(self.fixed[joint], by)
        self.fixed[joint + 1] = product(inverse_motion(by), self.fixed[joint + 1])

    def slide_next_to(self, joint: int, other: int) -> None:
        """Move a joint's frame along its axis to the point that is nearest to the axis of ``other``."""
        frames = self.frames()
        w, v = frames[joint][:3, 2], frames[other][:3, 2]
        gap = frames[other][:3, 3] - frames[joint][:3, 3]
        share = float(dot(w, v))
        if 1.0 - share * share > NEARLY**2:
            self.slide(joint, float(dot(gap, w) - share * dot(gap, v)) / (1.0 - share * share))

    def constants(self, groups: Sequence[float], beside: Sequence[float]) -> tuple[float, ...]:
        """Numbers of a closed form, in the order in which the module ``candidates`` reads them."""
        inverse = [inverse_motion(self.fixed[0]), inverse_motion(self.fixed[-1])]
        matrices = [*inverse, *self.fixed[1:-1]]
        rows = np.concatenate([matrix[:3].ravel() for matrix in matrices]).tolist()
        in_order = groups if self.order > 0.0 else groups[::-1]
        is_nearly = float(self.off > _EXACT)
        return (self.order, *self.signs, *in_order, *rows, *beside, is_nearly)


def _chains(kinds: Sequence[float], fixed: Sequence[Array], reach: float) -> tuple[_Chain, _Chain]:
    back = [inverse_motion(matrix) for matrix in fixed[::-1]]
    turned = [-kind for kind in kinds[::-1]]
    return (
        _Chain(order=1.0, signs=list(kinds), fixed=[m.copy() for m in fixed], reach=reach),
        _Chain(order=-1.0, signs=turned, fixed=back, reach=reach),
    )


def solution_of(kinds: Sequence[float], fixed: Sequence[Array], reach: float, task: Sequence[str]) -> Solution:
    """Return the solution of the inverse kinematics of a chain.

    Args:
        kinds: Kind of each joint: 1 for a turn, 2 for a slide; negative if it moves against its axis.
        fixed: Transforms (4, 4) before, between and after the joints, which move about z.
        reach: Length of the chain [m].
        task: Directions that the arm must control.

    Returns:
        The first class that fits, else :data:`SEARCH` with the reasons why no class fits.
    """
    if reach > 0.0 and len(task) == len(kinds) < 6:
        return _arm_in_plane(kinds, fixed, reach, task) or SEARCH
    if len(task) < 6 or reach <= 0.0 or any(abs(kind) > 1.5 for kind in kinds):
        return SEARCH
    misses: dict[str, str] = {}
    for recognise in _CLASSES.get(len(kinds), ()):
        for chain in _chains(kinds, fixed, reach):
            found = recognise(chain)
            if found is not None:
                text = found.text + _NEAR * (chain.off > _EXACT)
                return replace(found, text=text)
            misses |= chain.misses
    if not misses:
        return SEARCH
    why = "; ".join(f"axes {joints} {text}" for joints, text in misses.items())
    return replace(SEARCH, text=f"{SEARCH.text}; {why}")


def _spherical_wrist(chain: _Chain) -> Solution | None:
    if not chain.do_meet((3, 4, 5)):
        return None
    chain.slide_next_to(1, 0)
    F1, F2, t3 = chain.fixed[1], chain.fixed[2], chain.fixed[3][:3, 3]
    t1, t2, over = F1[:3, 3], F2[:3, 3], 1.0 / chain.reach
    k = product(F2[:3, :3].T, t2)
    # Factors of joint 1 and of joint 3 in the two equations; each is known up to a rotation and a scale.
    one = np.array([F1[:2, 2], -over * t1[:2]])
    three = np.array([F2[2, :2], over * k[:2]])
    if length(t3[:2]) * over < _LEAST or min(abs(one).max(), abs(three).max()) < _LEAST:
        return None
    rule = chain.null_rule(three)
    kind, other = _PARALLEL, one
    if rule is None:
        rule = chain.null_rule(one)
        kind, other = _MEETING, three
    if rule is None:
        rule, kind = (0.0, 0.0, 0.0), _SKEW
    elif length(rule[0] * other[0] + rule[1] * other[1]) < _LEAST:
        return None  # the wrist centre moves on a plane or a sphere
    x, y = t3[:2].tolist()
    B = [-row for r in three for row in (r[0] * x + r[1] * y, r[1] * x - r[0] * y)]
    h0 = F2[2, 2] * t3[2] + t2[2] + dot(F1[:3, 2], t1)
    h1 = 0.5 * over * (dot(t3, t3) + dot(t2, t2) + 2.0 * k[2] * t3[2] - dot(t1, t1))
    where = "wrist" if chain.order > 0.0 else "shoulder"
    return Solution(
        text=f"spherical {where}, closed form, 8 solutions",
        kernels=_closed(spherical_wrist.ik, spherical_wrist.ik_all),
        constants=chain.constants((1, 1, 1, 2, 2, 2), (kind, *rule, *B, over, float(h0), float(h1))),
    )


def _parallel_axes(chain: _Chain) -> Solution | None:
    if not chain.is_parallel((1, 2, 3)):
        return None
    axes = [frame[:3, 2] for frame in chain.frames()]
    for joint in (2, 3):
        if dot(axes[1], axes[joint]) < 0.0:
            chain.flip(joint)
        frames = chain.frames()
        height = dot(axes[1], frames[joint][:3, 3] - frames[1][:3, 3])
        chain.slide(joint, -float(height))
        turn = chain.fixed[joint]
        chain.spin(joint, -float(arctangent(turn[1, 0], turn[0, 0])))
    chain.slide_next_to(5, 4)
    F1, C4, C5, over = chain.fixed[1], chain.fixed[4], chain.fixed[5], 1.0 / chain.reach
    r, a, t5, m = C4[2, :3], C5[:3, 2], C5[:3, 3], F1[:3, 2]
    rows = np.array([a[:2], over * t5[:2]])
    arms = min(float(length(chain.fixed[joint][:2, 3])) * over for joint in (2, 3))
    if min(arms, float(length(r[:2])), float(length(m[:2])), abs(rows).max()) < _LEAST:
        return None
    rule = chain.null_rule(rows)
    kind = _PARALLEL if rule else _SKEW
    x, y = r[:2].tolist()
    B = [-v for q in rows for v in (x * q[0] + y * q[1], y * q[0] - x * q[1])]
    h1 = over * (r[2] * t5[2] + C4[2, 3] + dot(m, F1[:3, 3]))
    return Solution(
        text="three parallel axes, closed form, 8 solutions",
        kernels=_closed(parallel_axes.ik, parallel_axes.ik_all),
        constants=chain.constants(
            (1, 3, 3, 3, 2, 2), (kind, *(rule or (0.0, 0.0, 0.0)), *B, over, float(r[2] * a[2]), float(h1))
        ),
    )


def _shoulder_and_wrist(chain: _Chain) -> Solution | None:
    """Seven joints of which the first three axes meet, and the last three."""
    if not (chain.do_meet((0, 1, 2)) and chain.do_meet((4, 5, 6))):
        return None
    F3, t4, over = chain.fixed[3], chain.fixed[4][:3, 3], 1.0 / chain.reach
    k = product(F3[:3, :3].T, F3[:3, 3])
    if min(float(length(k[:2])), float(length(t4[:2]))) * over < NEARLY:
        return None  # joint 4 does not change the distance from shoulder to wrist
    return Solution(
        text="spherical shoulder and wrist, closed form over the swivel, 8 branches",
        kernels=_closed(swivel.ik, swivel.ik_all),
        constants=chain.constants((2, 2, 2, 1, 3, 3, 3), ()),
    )


def _arm_in_plane(kinds: Sequence[float], fixed: Sequence[Array], reach: float, task: Sequence[str]) -> Solution | None:
    """Three parallel turning joints, with a slide along them, or with a first and a last joint."""
    turns = [i for i, kind in enumerate(kinds) if abs(kind) < 1.5]
    slides = [i for i in range(len(kinds)) if i not in turns]
    shoulder = int(len(turns) > 3)
    wanted = {"x", "y", "z"} if shoulder else {"x", "y", "rz", *("z" for _ in slides)}
    if len(turns) < 3 or len(slides) > 1 - shoulder or not wanted <= set(task):
        return None
    frames, merged = [fixed[0]], [fixed[0]]  # slides are at zero
    for i, after in enumerate(fixed[1:]):
        frames.append(product(frames[-1], after))
        merged[-1:] = [merged[-1], after] if i in turns else [product(merged[-1], after)]
    chain = _Chain(order=1.0, signs=[kinds[i] for i in turns], fixed=merged, reach=reach)
    tip = _lay_in_plane(chain, shoulder)
    F, hand, normal = chain.fixed, shoulder + 2, chain.fixed[0][:3, 2]
    slide, push = -1.0, 0.0
    for i in slides:
        axis = frames[i][:3, 2]
        slide, push = float(i), 0.5 * kinds[i] * math.copysign(1.0, float(dot(normal, axis)))
        chain.off = max(chain.off, float(length(np.cross(normal, axis))))
    off = float(abs(F[1][2, 2]) if shoulder else length(normal[:2]))
    if tip is None or max(chain.off, off) > _LEVEL:
        return None
    places, signs = [-1.0] * 5, [1.0] * 5
    first, last = 1 - shoulder, 1 - shoulder + len(turns)
    places[first:last], signs[first:last] = map(float, turns), chain.signs
    bend = _about_z(F[hand - 1])
    height = F[hand - 1][2, 3] + F[hand][2, 3] + tip[2]
    numbers = [
        *places, *signs, slide, push, F[hand - 1][0, 3], F[hand][0, 3], bend,
        bend + _about_z(F[hand]), tip[0], tip[1], height, *inverse_motion(F[0])[:3].ravel(),
        *F[-1][:3, :3].T.ravel(), *(F[1] if shoulder else np.eye(4))[:3].ravel(),
    ]  # fmt: skip
    return Solution(
        text=f"arm in a plane, closed form, {2 + 2 * shoulder} solutions",
        kernels=_closed(plane_arm.ik, plane_arm.ik_all),
        constants=tuple(map(float, numbers)),
    )


def _lay_in_plane(chain: _Chain, shoulder: int) -> Array | None:
    """Rotate the frames of three parallel joints: x axes along the links, and the tool's axis along -y.

    Returns:
        The tip in the frame of the third joint (3,); None if the joints do not form such an arm.
    """
    F, hand = chain.fixed, shoulder + 2
    if not chain.is_parallel((shoulder, shoulder + 1, hand)):
        return None
    for joint in (shoulder + 1, hand):
        if dot(chain.frames()[shoulder][:3, 2], chain.frames()[joint][:3, 2]) < 0.0:
            chain.flip(joint)
    for joint in (shoulder, shoulder + 1):
        x, y = F[joint + 1][:2, 3].tolist()
        if math.hypot(x, y) < _LEAST * chain.reach:
            return None
        chain.spin(joint, float(arctangent(y, x)))
    if len(chain.signs) == hand + 1:
        return F[-1][:3, 3]
    x, y, z = F[hand + 1][:3, 2].tolist()
    chain.spin(hand, float(arctangent(y, x)) + 0.5 * math.pi)
    chain.slide(hand + 1, float(F[-1][2, 3]))
    chain.spin(hand + 1, -float(arctangent(F[hand + 1][2, 0], F[hand + 1][0, 0])))
    chain.off = max(chain.off, abs(z), float(length(F[-1][:3, 3])) / chain.reach)
    return F[hand + 1][:3, 3]


def _about_z(matrix: Array) -> float:
    return float(arctangent(matrix[1, 0], matrix[0, 0]))


_CLASSES: dict[int, tuple[Callable[[_Chain], Solution | None], ...]] = {
    6: (_spherical_wrist, _parallel_axes),
    7: (_shoulder_and_wrist,),
}
