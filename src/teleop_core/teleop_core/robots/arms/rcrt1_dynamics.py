"""Dynamics of the RCRT-1: closed form for the first three axes, drive table for all six.

The wrist is dominated by its motors. Its axes are independent inertias, and its mass is part of link 3. Numbers that
the source does not print (friction, motor inertia of the wrist) are marked *assumed*.

Table A.1 states no sign convention for the products of inertia, and no single convention is possible for all links.
The numbers of link 1 are possible only as -∫yz dm (the other sign needs a principal moment of -0.018 kg·m²). Those of
link 2 are possible only as +∫xz dm (else -0.0004). Link 3 is printed with its mass 264 mm ahead of the wrist centre,
where only the tool is. So its axes were rotated by 180° about x: its centre of mass lies at -264 mm, and Ixz changes
its sign too (else -0.0035). Then +∫xz dm, -3.0e-3, agrees with that of a point mass at the centre of mass, -3.06e-3.
For Ixy and Iyz of link 2 both signs are possible; they are taken with the convention of its Ixz.

Source:
    Vongbunyong 2008, section 4.6, appendix A.3 and tables 3.6 and A.1; misprints corrected.
"""

import math
from collections.abc import Mapping

import numpy as np

from teleop_core.kernels import Array, kernel, product, rotation, transform
from teleop_core.kernels.room import room
from teleop_core.robots import drives, inertias

# Symbols as in the source: moments about the link-frame origins [kg·m²], centres of mass G [m].
# Published (table A.1); products as +∫xy dm, signs derived as described at the top.
LINKS = {
    "I1yy": 0.012, "I2xx": 0.011, "I2yy": 0.013, "I2zz": 0.004,
    "I2xy": 6.778e-4, "I2xz": 3.0e-3, "I2yz": 2.24e-4,
    "I3xx": 0.061, "I3yy": 0.061, "I3zz": 5.378e-4, "I3xz": -3.0e-3,
    "m2": 1.704, "m3": 0.789, "G2x": 0.031842, "G2z": 0.03594, "G3x": 0.014664, "G3z": -0.264245,
    "m2b_L0b": 0.0,  # static moment of the four-bar's link 2b [kg·m], not published
    # Reflected motor inertias: the source prints 81.6 without a unit; the unit of the catalogue is 1e-3 kg·m².
    "J1": 0.0816, "J2": 0.0816,
    "J3": 6.627e-7 * (2.0 * math.pi / 1e-3) ** 2,  # motor and screw through a 1 mm lead [kg]
    "J4": 6.5e-8 * 141.0**2, "J5": 6.5e-8 * 76.0**2, "J6": 6.5e-8 * 76.0**2,  # the rotor inertia is assumed
    "g": 9.81,
}  # fmt: skip
# The other inertias of link 1 have no effect, because it turns about its y axis alone; Iyz is -∫yz dm.
LINK_1 = {"m1": 2.404, "G1y": -0.142342, "G1z": -0.038193, "I1xx": 0.064, "I1zz": 0.053, "I1yz": -0.011}
_ORDER = {symbol: index for index, symbol in enumerate(LINKS)}
_I1YY, _I2XX, _I2YY, _I2ZZ = (_ORDER[s] for s in ("I1yy", "I2xx", "I2yy", "I2zz"))
_I2XY, _I2XZ, _I2YZ = (_ORDER[s] for s in ("I2xy", "I2xz", "I2yz"))
_I3XX, _I3YY, _I3ZZ, _I3XZ = (_ORDER[s] for s in ("I3xx", "I3yy", "I3zz", "I3xz"))
_M2, _M3, _G2X, _G2Z, _G3X, _G3Z = (_ORDER[s] for s in ("m2", "m3", "G2x", "G2z", "G3x", "G3z"))
_M2B, _J1, _G = _ORDER["m2b_L0b"], _ORDER["J1"], _ORDER["g"]


def link_row(**symbols: float) -> Array:
    """Parameter row of the kernels: :data:`LINKS`, with the values of the given symbols replaced."""
    return np.array(list({**LINKS, **symbols}.values()), dtype=np.float64)


def link_inertias(symbols: Mapping[str, float] = LINKS) -> tuple[inertias.LinkInertia, ...]:
    """Links 1 to 3 in their frames, lumped as in table A.1: link 2 includes 2a, link 3 includes the wrist.

    Args:
        symbols: All of :data:`LINKS`, for links 2 and 3 and the I1yy of link 1.
    """
    p, one, about_origin = symbols, LINK_1, inertias.LinkInertia.about_origin
    return (
        about_origin(
            "link 1",
            one["m1"],
            (0.0, one["G1y"], one["G1z"]),
            (one["I1xx"], p["I1yy"], one["I1zz"]),
            (0.0, 0.0, one["I1yz"]),
            sign=-1.0,
        ),
        about_origin(
            "link 2",
            p["m2"],
            (p["G2x"], 0.0, p["G2z"]),
            (p["I2xx"], p["I2yy"], p["I2zz"]),
            (p["I2xy"], p["I2xz"], p["I2yz"]),
        ),
        about_origin(
            "link 3", p["m3"], (p["G3x"], 0.0, p["G3z"]), (p["I3xx"], p["I3yy"], p["I3zz"]), (0.0, p["I3xz"], 0.0)
        ),
    )


def link_frames(q: Array, d2: float) -> tuple[Array, ...]:
    """Frames 1 to 3 of the source's table in the base, (4, 4) each, at joints (6,) [rad, m].

    Source:
        Vongbunyong 2008, section 4.4: alpha = -90, 90, 0 degrees, d = 0, d2, d3.
    """
    quarter, still = 0.5 * math.pi, np.zeros(3)
    first = transform(product(rotation("z", q[0]), rotation("x", -quarter)), still)
    turn = product(rotation("z", q[1]), rotation("x", quarter))
    second = product(first, transform(turn, np.array([0.0, 0.0, d2])))
    third = product(second, transform(np.eye(3), np.array([0.0, 0.0, q[2]])))
    return first, second, third


@kernel
def inertia_matrix(q: Array, p: Array, D: Array) -> None:
    """Write the inertia (3, 3) of axes 1-3, reflected motors included.

    Source:
        Vongbunyong 2008, eqs. 4.6.1-4.6.3, derived again with Ixy and Iyz of link 2. D12 depends on these two products
        alone; D13 = 0 for this geometry.
    """
    s2, c2, d3 = math.sin(q[1]), math.cos(q[1]), q[2]
    reach = p[_M3] * d3 * (d3 + 2.0 * p[_G3Z])
    P = p[_I2XZ] + p[_I3XZ] + p[_M3] * d3 * p[_G3X]
    D[0, 0] = p[_I1YY] + (p[_I2XX] + p[_I3XX] + reach) * s2 * s2 + p[_J1]
    D[0, 0] += (p[_I2ZZ] + p[_I3ZZ]) * c2 * c2 + 2.0 * P * s2 * c2
    D[0, 1] = D[1, 0] = p[_I2XY] * s2 - p[_I2YZ] * c2
    D[0, 2] = D[2, 0] = 0.0
    D[1, 1] = p[_I2YY] + p[_I3YY] + reach + p[_J1 + 1]
    D[1, 2] = D[2, 1] = -p[_M3] * p[_G3X]
    D[2, 2] = p[_M3] + p[_J1 + 2]


@kernel
def velocity_effort(q: Array, dq: Array, p: Array, h: Array) -> None:
    """Write the Coriolis and centrifugal effort (3,) of axes 1-3.

    Source:
        Vongbunyong 2008, eq. 4.6.5, derived again from the Lagrangian.
    """
    s2, c2, d3 = math.sin(q[1]), math.cos(q[1]), q[2]
    s22, c22 = 2.0 * s2 * c2, c2 * c2 - s2 * s2
    m3, G3x, lever = p[_M3], p[_G3X], q[2] + p[_G3Z]
    B = p[_I2XX] - p[_I2ZZ] + p[_I3XX] - p[_I3ZZ] + m3 * d3 * (d3 + 2.0 * p[_G3Z])
    P = p[_I2XZ] + p[_I3XZ] + m3 * d3 * G3x
    radial = m3 * (lever * (1.0 - c22) + G3x * s22)
    h[0] = (B * s22 + 2.0 * P * c22) * dq[0] * dq[1] + radial * dq[0] * dq[2]
    h[0] += (p[_I2XY] * c2 + p[_I2YZ] * s2) * dq[1] * dq[1]  # slope of D12
    h[1] = 2.0 * m3 * lever * dq[1] * dq[2] - (0.5 * B * s22 + P * c22) * dq[0] * dq[0]
    h[2] = -0.5 * radial * dq[0] * dq[0] - m3 * lever * dq[1] * dq[1]


@kernel
def gravity_effort(q: Array, p: Array, c: Array) -> None:
    """Write the effort (6,) that holds the arm against gravity; wrist neglected.

    Source:
        Vongbunyong 2008, eqs. 4.6.6-4.6.8.
    """
    s2, c2 = math.sin(q[1]), math.cos(q[1])
    along = p[_M2] * p[_G2Z] + p[_M3] * (p[_G3Z] + q[2]) + p[_M2B]
    across = p[_M2] * p[_G2X] + p[_M3] * p[_G3X]
    c[0] = 0.0
    c[1] = -p[_G] * (along * s2 + across * c2)
    c[2] = p[_M3] * p[_G] * c2
    for i in range(3, 6):
        c[i] = 0.0


@kernel
def acceleration(q: Array, dq: Array, effort: Array, p: Array, ddq: Array) -> None:
    """Write joint accelerations (6,) under the net joint effort (drive less friction).

    Axes 1 and 3 are coupled only through axis 2, so axis 2 is solved first.
    """
    D, h, c = room(3, 3), room(3), room(6)
    inertia_matrix(q, p, D)
    velocity_effort(q, dq, p, h)
    gravity_effort(q, p, c)
    first, second = effort[0] - h[0] - c[0], effort[1] - h[1] - c[1]
    third = effort[2] - h[2] - c[2]
    share1, share3 = D[0, 1] / D[0, 0], D[1, 2] / D[2, 2]
    alone = D[1, 1] - share1 * D[0, 1] - share3 * D[1, 2]
    ddq[1] = (second - share1 * first - share3 * third) / alone
    ddq[0] = first / D[0, 0] - share1 * ddq[1]
    ddq[2] = third / D[2, 2] - share3 * ddq[1]
    for i in range(3, 6):
        ddq[i] = effort[i] / p[_J1 + i]


DYNAMICS = drives.Dynamics(
    acceleration=acceleration,
    gravity=gravity_effort,
    parameters=link_row(),
    compensated=np.array([False, True, False, False, False, False]),
    links=link_inertias(),
    unknown={"m2b_L0b": _M2B},
)

_RPM = 2.0 * math.pi / 60.0
DRIVES = drives.Drives(
    # Axes 1-3: derived from the motors plus the links at home. Wrist: inertia of the rotors, assumed.
    inertia=np.array([0.1213, 0.1199, 26.95, LINKS["J4"], LINKS["J5"], LINKS["J6"]]),
    viscous=np.array([0.4, 0.4, 30.0, 0.004, 0.002, 0.002]),  # assumed
    coulomb=np.array([0.15, 0.15, 1.0, 0.010, 0.005, 0.005]),  # assumed
    friction_speed=np.array([2e-3, 2e-3, 2e-4, 2e-2, 2e-2, 2e-2]),  # assumed
    # Published (table 3.6). Axis 3 is derived: the torque 0.0056 N·m at its ball screw, divided by the lifting factor
    # of the screw, 2.184e-4 N·m/N.
    effort_limit=np.array([5.9, 5.9, 0.0056 / 2.184e-4, 0.3525, 0.19, 0.19]),
    # Published (table 3.6). Axis 3 is derived from the lead of 1 mm of its screw.
    speed_limit=np.array(
        [30.0 * _RPM, 30.0 * _RPM, 3719.677 / 60.0 * 1e-3, 70.213 * _RPM, 130.263 * _RPM, 130.263 * _RPM]
    ),
    # Derived from the pulses (four counts each) and gears of table 3.6, and from the lead of the screw.
    encoder_step=np.array(
        [
            2 * math.pi / (90 * 4000),
            2 * math.pi / (90 * 4000),
            1e-3 / (3.71 * 2048),
            2 * math.pi / (141 * 2048),
            2 * math.pi / (76 * 2048),
            2 * math.pi / (76 * 2048),
        ]
    ),
    bandwidth=np.array([60.0, 60.0, 60.0, 80.0, 80.0, 80.0]),  # assumed: the source prints no gains
    assumed=("inertia", "viscous", "coulomb", "friction_speed"),  # the inertia is assumed only for the wrist
)
