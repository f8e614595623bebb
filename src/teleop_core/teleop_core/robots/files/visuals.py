"""Visuals: shapes of the links in a URDF, and the paths of the mesh files."""

import hashlib
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from types import MappingProxyType
from xml.etree import ElementTree as Xml

import numpy as np

from teleop_core.base import ParameterError
from teleop_core.kernels import Array, product, rotation, transform
from teleop_core.robots.files.urdf_tree import Links, UrdfJoint, chain_to, numbers_of, origin_of, tree_of, turn_of_z
from teleop_core.robots.visual import Color, Visual, VisualKind

_ENDINGS = (".stl", ".dae", ".obj", ".ply", ".glb", ".gltf", ".off")
_UP = 4  # meshes may be in this many folders above the folder of the URDF
_PACKAGE = "package://"
_SHAPES: dict[VisualKind, tuple[tuple[str, tuple[float, ...]], ...]] = {
    "mesh": (("scale", (1.0, 1.0, 1.0)),),
    "box": (("size", (0.0, 0.0, 0.0)),),
    "cylinder": (("radius", (0.0,)), ("length", (0.0,))),
    "capsule": (("radius", (0.0,)), ("length", (0.0,))),
    "sphere": (("radius", (0.0,)),),
}
"""Attributes in the URDF of each kind of shape [m], in the order of the sizes of :class:`Visual`."""


def mesh_file(name: str, urdf: Path) -> Path:
    """File of a mesh that a URDF names; a copy at the path of :func:`kept_mesh` is preferred.

    ``package://NAME/REST`` is searched in folders called NAME next to and above the URDF's folder, in the packages of
    ``AMENT_PREFIX_PATH`` and ``ROS_PACKAGE_PATH``, and without NAME in the folders above. Any other name is relative
    to the folder of the URDF.

    Raises:
        ParameterError: The file is not found or is not a mesh, or it is outside the package, or outside the fourth
            folder above the URDF.
    """
    if not name.lower().endswith(_ENDINGS):
        raise ParameterError("mesh", name, f"a file with one of the endings {', '.join(_ENDINGS)}")
    for root, path in _candidates(name, urdf.resolve().parent):
        real = path.resolve()
        if real.is_file():
            if not real.is_relative_to(root.resolve()):
                raise ParameterError("mesh", name, f"a file below {root}")
            return real
    raise ParameterError("mesh", name, f"a file in a package, or near {urdf}")


def kept_mesh(name: str, urdf: Path) -> Path:
    """Path of the stored copy of a mesh, next to the copy of a URDF in a recording, for any mesh name."""
    file = hashlib.sha256(name.encode()).hexdigest()[:16] + Path(name).suffix
    return urdf.parent / "kept_meshes" / file


def meshes_of(text: str, urdf: Path) -> dict[str, Path]:
    """Files of the meshes of a URDF's visuals, by the mesh names in the URDF.

    Args:
        text: XML of the URDF; text that is not XML names no meshes.
        urdf: Path of the URDF, for relative names.

    Returns:
        The files that :func:`mesh_file` finds.
    """
    found: dict[str, Path] = {}
    with suppress(Xml.ParseError, ParameterError):
        for element in tree_of(text.encode()).iterfind("link/visual/geometry/mesh"):
            name = element.get("filename", "")
            with suppress(ParameterError, OSError):
                found[name] = mesh_file(name, urdf)
    return found


def package_folder(name: str, urdf: Path) -> Path:
    """Folder of a package; searched in the same folders as by :func:`mesh_file`.

    Raises:
        ParameterError: The package is in none of these folders, or ``name`` is not a plain folder name.
    """
    if name not in {"", ".", ".."} and name == Path(name).name:
        for _, place in _packages(name, urdf.resolve().parent):
            if place.is_dir():
                return place
    needed = f"a folder near {urdf}, or below AMENT_PREFIX_PATH or ROS_PACKAGE_PATH"
    raise ParameterError("package", name, needed)


def _candidates(name: str, folder: Path) -> Iterator[tuple[Path, Path]]:
    """Possible paths of a mesh, each with the folder in which it must be."""
    above = _above(folder)
    kept = kept_mesh(name, folder / "urdf")
    yield kept.parent, kept
    if not name.startswith(_PACKAGE):
        yield above[-1], folder / name.removeprefix("file://")
        return
    package, _, rest = name.removeprefix(_PACKAGE).partition("/")
    yield from ((root, place / rest) for root, place in _packages(package, folder))
    yield from ((each, each / rest) for each in above)


def _packages(name: str, folder: Path) -> Iterator[tuple[Path, Path]]:
    """Possible folders of a package, each with the folder in which its files must be."""
    yield from ((each, each / name) for each in _above(folder))
    for variable, below in (("AMENT_PREFIX_PATH", "share"), ("ROS_PACKAGE_PATH", "")):
        for place in filter(None, os.environ.get(variable, "").split(os.pathsep)):
            yield Path(place) / below / name, Path(place) / below / name


def _above(folder: Path) -> list[Path]:
    return [each for each in (folder, *folder.parents)[: _UP + 1] if each != each.parent]


def visuals_of(
    home: Mapping[str, float],
    links: Links,
    by_child: Mapping[str, UrdfJoint],
    urdf: Path,
    colors: Mapping[str, Color] = MappingProxyType({}),
    strokes: Mapping[str, Array] = MappingProxyType({}),
) -> tuple[tuple[Visual, ...], list[str]]:
    """Shapes of all links, in the order of the file, and a note on each visual that cannot be drawn.

    Args:
        home: Coordinate at home of each moving joint on the path to the tip [rad, m], by joint name; all other joints
            stay at 0.
        links: Elements of the links by their names.
        by_child: The joint that carries each link.
        urdf: Path of the URDF.
        colors: Colours of the materials that the file names.
        strokes: Coordinates of the joints of a gripper from closed to open, by joint name.
    """
    found, notes = list[Visual](), list[str]()
    for link, element in links.items():
        shapes = element.findall("visual")
        chain = chain_to(link, by_child) if shapes else []
        moved = sum(joint.name in home and joint.axis is not None for joint in chain)
        T, gripped = place_of(chain, home), [joint.name for joint in chain if joint.name in strokes]
        steps = zip(*(strokes[name].tolist() for name in gripped), strict=True)
        ways = [place_of(chain, {**home, **dict(zip(gripped, step, strict=True))}) for step in steps]
        for shape in shapes:
            try:
                kind, size, file = _shape(f"link {link}", shape)
                own = origin_of(f"visual of link {link}", shape)
            except ParameterError as error:  # no picture is worth an arm
                notes.append(f"link {link} is drawn without: {error}")
            else:
                travel = np.stack([product(way, own) for way in ways]) if ways else None
                color = _color(shape, colors)
                found.append(Visual(link, moved, product(T, own), kind, size, file, urdf, color, travel))
    return tuple(found), notes


def _shape(where: str, visual: Xml.Element) -> tuple[VisualKind, tuple[float, ...], str]:
    """Kind, sizes and mesh file of a visual.

    Raises:
        ParameterError: The shape is unknown, or a size is not a number.
    """
    for kind, keys in _SHAPES.items():
        if (shape := visual.find(f"geometry/{kind}")) is not None:
            return kind, _sizes(where, shape, kind, keys), shape.get("filename", "")
    inner = [element.tag for geometry in visual.findall("geometry") for element in geometry]
    raise ParameterError(f"geometry of {where}", ", ".join(inner) or "missing", f"one of {', '.join(_SHAPES)}")


def _sizes(
    where: str, shape: Xml.Element, kind: VisualKind, keys: tuple[tuple[str, tuple[float, ...]], ...]
) -> tuple[float, ...]:
    """Sizes of a shape; a single scale factor of a mesh applies to all three axes."""
    if kind == "mesh" and len(shape.get("scale", "").split()) == 1:
        return (float(numbers_of(where, shape, "scale", (1.0,))[0]),) * 3
    unit = "" if kind == "mesh" else "m"
    sizes = (numbers_of(where, shape, key, default, unit) for key, default in keys)
    return tuple(float(number) for size in sizes for number in size)


def place_of(chain: Sequence[UrdfJoint], values: Mapping[str, float]) -> Array:
    """Pose (4, 4) at the end of a chain of joints; joints without a value [rad, m] are at 0."""
    T = np.eye(4)
    for joint in chain:
        T = product(T, joint.origin)
        if joint.name in values and joint.axis is not None:
            T = product(T, _motion(joint, values[joint.name]))
    return T


def colors_of(root: Xml.Element) -> dict[str, Color]:
    """Colours of the materials of a URDF, by name; a material may be defined in any link."""
    found: dict[str, Color] = {}
    for material in root.iter("material"):
        color = _rgb(material)
        if color is not None and (name := material.get("name")):
            found.setdefault(name, color)
    return found


def _color(shape: Xml.Element, colors: Mapping[str, Color]) -> Color | None:
    material = shape.find("material")
    if material is None:
        return None
    return _rgb(material) or colors.get(material.get("name", ""))


def _rgb(material: Xml.Element) -> Color | None:
    """Red, green and blue of a material, from 0 to 1; None without a colour, or with one that is none."""
    color = material.find("color")
    with suppress(ParameterError):
        if color is not None and color.get("rgba") is not None:
            r, g, b, _ = np.clip(numbers_of("material", color, "rgba", (0.0,) * 4), 0.0, 1.0).tolist()
            return r, g, b
    return None


def _motion(joint: UrdfJoint, value: float) -> Array:
    """Transform (4, 4) of a joint at a value [rad, m] about or along its axis."""
    axis = np.asarray(joint.axis)
    if joint.kind == "prismatic":
        return transform(np.eye(3), value * axis)
    sign, up = turn_of_z(axis)
    turn = transform(rotation("z", sign * value), np.zeros(3))
    return product(product(up, turn), up.T)
