"""Arms that are sold, as URDF texts: joint frames, limits and bodies from public descriptions.

``data/arms.json`` holds, for each arm, where its numbers come from, and one row a joint: origin
(x, y, z [m], roll, pitch, yaw [rad]), axis, lower and upper limit [rad] (null: it turns without
end), speed [rad/s] and effort [N·m] (0: nobody wrote it down). ``tool`` is the frame of the tip
behind the last joint. ``bodies`` are the links where they are public, one row each: mass [kg],
centre [m] and the inertia xx, xy, xz, yy, yz, zz [kg·m²] about it, in the axes of the joint.

72 arms are those of ssik (personalrobotics/ssik, commit 65139cc8, its fixtures and its manifest, which names the
sources); ``class`` is the solver that ssik takes for them. Fixed joints between two others are multiplied out. Home
pose and limits were compared with the constants in ssik's compiled modules: they agree to 5e-12.
"""

import json
from pathlib import Path
from typing import Any

from random_arms import row

ARMS = json.loads((Path(__file__).parents[1] / "data" / "arms.json").read_text(encoding="utf-8"))


def urdf_of(name: str, effort: float | None = None) -> str:
    """URDF text of an arm, its links l0, l1, ... and tip; all efforts as given [N·m]."""
    arm = ARMS[name]
    lines = [f'<robot name="{name}"><link name="l0"/>']
    for i, numbers in enumerate(arm["joints"]):
        lower, upper, speed, most = numbers[9:]
        most = most if effort is None else effort
        is_endless = lower is None
        ends = "" if is_endless else f'lower="{lower!r}" upper="{upper!r}" '
        lines.append(
            f'<link name="l{i + 1}">{_body(arm, i)}</link><joint name="j{i + 1}" '
            f'type="{"continuous" if is_endless else "revolute"}"><parent link="l{i}"/>'
            f'<child link="l{i + 1}"/><origin xyz="{row(numbers[:3])}" rpy="{row(numbers[3:6])}"/>'
            f'<axis xyz="{row(numbers[6:9])}"/>'
            f'<limit {ends}effort="{most!r}" velocity="{speed!r}"/></joint>'
        )
    tool, n = arm["tool"], len(arm["joints"])
    return (
        "".join(lines) + f'<link name="tip"/><joint name="tool" type="fixed"><parent link="l{n}"/>'
        f'<child link="tip"/><origin xyz="{row(tool[:3])}" rpy="{row(tool[3:])}"/></joint></robot>'
    )


def _body(arm: Any, i: int) -> str:
    if "bodies" not in arm:
        return ""
    mass, *numbers = arm["bodies"][i]
    keys = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    inertia = " ".join(f'{key}="{x!r}"' for key, x in zip(keys, numbers[3:], strict=True))
    return f'<inertial><origin xyz="{row(numbers[:3])}"/><mass value="{mass!r}"/><inertia {inertia}/></inertial>'
