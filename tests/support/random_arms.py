"""Arms of each class with a closed form, as URDF texts: random axes and real arms."""

import math
from typing import Any

import numpy as np

from teleop_core.kernels.geometry import Array
from teleop_core.robots.arms.dh import DhTable, parse_table

SHOULDERS = ("skew", "1 and 2 parallel", "2 and 3 parallel", "1 and 2 meet", "2 and 3 meet")
PARALLEL = ("5 and 6 meet", "5 and 6 apart")
WIDE = (-2.0 * math.pi, 2.0 * math.pi)


def table(rows: Any, convention: str = "modified", **entries: object) -> DhTable:
    """Table of rows in degrees."""
    whole = {"name": "chain", "convention": convention, "angles": "degrees", "rows": rows}
    return parse_table(whole | entries)


def direction(rng: np.random.Generator, *beside: Array) -> Array:
    """Unit vector that is at least 0.6 rad off other directions."""
    while True:
        w = rng.normal(size=3)
        w /= np.linalg.norm(w)
        if all(abs(w @ other) < math.cos(0.6) for other in beside):
            return w


def directions(rng: np.random.Generator, count: int) -> list[Array]:
    """Unit vectors, each off the one before it."""
    found = [direction(rng)]
    while len(found) < count:
        found.append(direction(rng, found[-1]))
    return found


def point(rng: np.random.Generator) -> Array:
    return rng.uniform(0.15, 0.4, 3) * rng.choice((-1, 1), 3)


def wrist_axes(rng: np.random.Generator, kind: str) -> list[tuple[Array, Array]]:
    """Axes (direction, point) of an arm with a spherical wrist and a shoulder of a kind."""
    w, o = directions(rng, 6), [point(rng) for _ in range(3)]
    o += [o[2] + point(rng)] * 3
    if kind == "1 and 2 parallel":
        w[0] = w[1]
    elif kind == "2 and 3 parallel":
        w[2] = w[1] * rng.choice((-1, 1))
        w[3] = direction(rng, w[2], w[4])
    elif kind == "1 and 2 meet":
        o[1] = o[0]
    elif kind == "2 and 3 meet":
        o[2] = o[1]
    return list(zip(w, o, strict=True))


def parallel_axes(rng: np.random.Generator, kind: str) -> list[tuple[Array, Array]]:
    """Axes of an arm whose axes 2, 3 and 4 are parallel."""
    w, o = directions(rng, 6), [point(rng)]
    while len(o) < 6:
        o.append(o[-1] + point(rng))
    w[2], w[3] = w[1] * rng.choice((-1, 1)), w[1] * rng.choice((-1, 1))
    w[4] = direction(rng, w[1], w[5])
    if kind == "5 and 6 meet":
        o[5] = o[4]
    return list(zip(w, o, strict=True))


def urdf(
    axes: list[tuple[Array, Array]],
    limits: Any,
    tool: tuple[float, float, float] = (0.1, -0.05, 0.12),
    name: str = "random",
) -> str:
    """Arm whose links are parallel to the base at zero; each frame somewhere on its axis."""
    rng, here = np.random.default_rng(9), np.zeros(3)
    lines = [f'<robot name="{name}"><link name="l0"/>']
    for i, ((w, point_on), (lower, upper)) in enumerate(zip(axes, limits, strict=True)):
        o = point_on + rng.uniform(-0.2, 0.2) * w
        lines.append(
            f'<link name="l{i + 1}"/><joint name="j{i + 1}" type="revolute"><parent link="l{i}"/>'
            f'<child link="l{i + 1}"/><origin xyz="{row(o - here)}"/><axis xyz="{row(w)}"/>'
            f'<limit lower="{lower!r}" upper="{upper!r}" effort="90" velocity="3"/></joint>'
        )
        here = o
    n = len(axes)
    return (
        "".join(lines) + f'<link name="tip"/><joint name="tool" type="fixed"><parent link="l{n}"/>'
        f'<child link="tip"/><origin xyz="{row(tool)}" rpy="0.3 -0.2 0.5"/></joint></robot>'
    )


def row(values: Any) -> str:
    return " ".join(repr(float(value)) for value in values)


def axes_of_dh(rows: list[tuple[float, float, float]]) -> list[tuple[Array, Array]]:
    """Axes at zero of a standard Denavit-Hartenberg table of rows a, alpha, d."""
    T, axes = np.eye(4), []
    for a, alpha, d in rows:
        axes.append((T[:3, 2].copy(), T[:3, 3].copy()))
        c, s = math.cos(alpha), math.sin(alpha)
        T = T @ np.array([[1, 0, 0, a], [0, c, -s, 0], [0, s, c, d], [0, 0, 0, 1.0]])
    return axes


_H = 0.5 * math.pi
# Universal Robots, support article on DH parameters of their arms.
UR5E = axes_of_dh([(0, _H, 0.1625), (-0.425, 0, 0), (-0.3922, 0, 0), (0, _H, 0.1333), (0, -_H, 0.0997), (0, 0, 0.0996)])


def swivel_axes(rng: np.random.Generator, kind: str = "7") -> list[tuple[Array, Array]]:
    """Axes of an arm of seven joints whose shoulder and wrist are spherical, the elbow aside."""
    w, shoulder = directions(rng, 7), point(rng)
    elbow = shoulder + point(rng)
    wrist = elbow + 0.05 * direction(rng) + point(rng)
    return list(zip(w, [shoulder] * 3 + [elbow] + [wrist] * 3, strict=True))


# KUKA, LBR iiwa 14 R820, lengths 360, 420, 400 and 126 mm; the limits are those of its data sheet.
IIWA14 = axes_of_dh([(0, -_H, 0.36), (0, _H, 0), (0, _H, 0.42), (0, -_H, 0), (0, -_H, 0.4), (0, _H, 0), (0, 0, 0.126)])
IIWA14_LIMITS = [(-math.radians(a), math.radians(a)) for a in (170, 120, 170, 120, 170, 120, 175)]


KINDS = ("revolute", "continuous", "prismatic", "fixed")


def random_urdf(seed: int, n: int) -> tuple[str, str]:
    """Chain of n moving joints and some fixed ones, every link with a branch that weighs."""
    rng, lines, link, moving = np.random.default_rng(seed), ['<link name="l0"/>'], 0, 0
    while moving < n:
        kind = rng.choice(KINDS)
        moving += kind != "fixed"
        link += 1
        for name, parent in ((f"l{link}", f"l{link - 1}"), (f"b{link}", f"l{link}")):
            side = rng.uniform(0.02, 0.3, 3) ** 2
            tensor = np.diag(side.sum() - side)
            turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
            I = turn @ tensor @ turn.T  # noqa: E741
            keys = (("xx", 0, 0), ("xy", 0, 1), ("xz", 0, 2), ("yy", 1, 1), ("yz", 1, 2), ("zz", 2, 2))
            numbers = " ".join(f'i{key}="{I[i, j]:.17g}"' for key, i, j in keys)
            of = kind if name[0] == "l" else "revolute"
            lines.append(
                f'<link name="{name}"><inertial><origin xyz="{row(rng.normal(size=3))}" '
                f'rpy="{row(rng.uniform(-3, 3, 3))}"/><mass value="{rng.uniform(0.1, 5):.17g}"/>'
                f"<inertia {numbers}/></inertial></link>"
                f'<joint name="to_{name}" type="{of}"><parent link="{parent}"/>'
                f'<child link="{name}"/><origin xyz="{row(rng.normal(size=3))}" '
                f'rpy="{row(rng.uniform(-3, 3, 3))}"/><axis xyz="{row(rng.normal(size=3))}"/>'
                f'<limit lower="{rng.uniform(-2, 0.5):.17g}" upper="{rng.uniform(0.6, 2):.17g}" '
                f'effort="20" velocity="2"/></joint>'
            )
    return f'<robot name="random">{"".join(lines)}</robot>', f"l{link}"


def standard_link(theta: float, d: float, a: float, alpha: float) -> Array:
    """One link of a standard table, written out (Denavit and Hartenberg 1955)."""
    ct, st, ca, sa = math.cos(theta), math.sin(theta), math.cos(alpha), math.sin(alpha)
    return np.array(
        [[ct, -st * ca, st * sa, a * ct], [st, ct * ca, -ct * sa, a * st], [0.0, sa, ca, d], [0.0, 0.0, 0.0, 1.0]]
    )
