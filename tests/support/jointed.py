"""Arms of any number of joints, as URDF files: other axes and lengths than those that are compiled ahead."""

from pathlib import Path

_AXES = ("0 0 1", "0 1 0", "0 1 0", "1 0 0")


def urdf(joints: int, folder: Path) -> Path:
    """Write the file of an arm of some 1.2 m; returns its path."""
    lines = [f'<robot name="arm{joints}"><link name="l0"/>']
    for i in range(joints):
        length = (0.9 + 0.2 * (i % 3)) / joints
        lines.append(
            f'<link name="l{i + 1}"><inertial><origin xyz="0 0 {length / 2}"/><mass value="1.5"/>'
            '<inertia ixx="0.01" iyy="0.01" izz="0.005" ixy="0" ixz="0" iyz="0"/></inertial></link>'
            f'<joint name="j{i + 1}" type="revolute"><parent link="l{i}"/><child link="l{i + 1}"/>'
            f'<origin xyz="0 0 {length}"/><axis xyz="{_AXES[i % len(_AXES)]}"/>'
            '<limit effort="120" velocity="2.5" lower="-2.8" upper="2.8"/></joint>'
        )
    tip = f'<link name="tip"/><joint name="end" type="fixed"><parent link="l{joints}"/><child link="tip"/>'
    path = folder / f"arm{joints}.urdf"
    path.write_text("\n".join((*lines, tip, '<origin xyz="0.02 0 0.1"/></joint></robot>')), encoding="utf-8")
    return path
