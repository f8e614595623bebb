"""Replays: a recorded session is repeated to the bit, whatever became of the files that it was made from."""

import re
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Literal, NamedTuple

import pytest
import trimesh

import teleop_core as tc
from teleop_core.bags.reader import Bag

URDF = (Path(__file__).parents[2] / "examples" / "any_arm.urdf").read_text()
LONGER = URDF.replace('xyz="0 0 0.42"', 'xyz="0 0 0.43"')
TABLE = """
name: my_scara
convention: modified
angles: degrees
task: [x, y, z, rz]
rows:
  - {theta: q, lower: -150, upper: 150, home: -45}
  - {a: 0.4, theta: q, lower: -150, upper: 150, home: 90}
  - {a: 0.3, d: -q, lower: 0.0, upper: 0.2, home: 0.1}
  - {theta: q}
"""
XACRO = (
    URDF.replace("<robot ", '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" ')
    .replace('<link name="base"/>', '<link name="base"/><xacro:arg name="lift" default="0.4"/><!-- ${1 / 0} -->')
    .replace('xyz="0 0 0.42"', 'xyz="0 0 $(arg lift)"')
)
DRIVES = "waist: {speed_limit: 0.05}\nshoulder: {viscous: 30.0}\n"
SCENES = Path(tc.load_robot("cubes.xml").file).parent  # type: ignore[attr-defined]
SCENE = {name: (SCENES / name).read_text() for name in ("cubes.xml", "arm.xml")}

Content = str | bytes | Callable[[Path], object] | None


def box(*size: float) -> Callable[[Path], object]:
    """A box [mm] as a mesh."""
    return lambda path: trimesh.creation.box(size).export(path)


class Session(NamedTuple):
    """A session: what it is of, and files that it is made from, with what becomes of them (None: they are gone).

    In its options, a brace pair stands for the folder of the files.
    """

    scenario: str
    options: Mapping[str, Any]
    files: Mapping[str, tuple[Content, Content]] = {}
    begin: Literal["device", "hand"] = "device"
    naming: str = ""  # the topic that names a file, which is another one in the replay


def at(of: Any, folder: Path) -> Any:
    """Options with the folder in place of the braces."""
    if isinstance(of, Mapping):
        return {name: at(value, folder) for name, value in of.items()}
    if isinstance(of, list):
        return [at(value, folder) for value in of]
    return of.replace("{}", str(folder)) if isinstance(of, str) else of


def own_arm(name: str, **more: Any) -> dict[str, Any]:
    return {"duration": 0.6, "robot": f"{{}}/{name}", "geometry": ["tip=tool0"]} | more


WORLD = {"duration": 8.0, "settings": {"world": "mesh", "world.mesh.file": "{}/block.stl"}}
BLOCK = box(60.0, 60.0, 30.0)
TWO_MESHES = ["mesh file='{}/box.stl'", "mesh file='{}/ball.stl' at=[0.0, 0.015, 0.0]"]
HAND = {"duration": 1.5, "settings": {"seed": 4, "buttons.fixture": [0.3], "operator": "human"}}
PAIR = {"duration": 1.5, "arms": ["right", "left"], "settings": {
    "left/robot": "scara", "left/seed": 7, "left/coarse_gain": 0.5, "right/fixture": "sphere",
    "right/fixture.sphere.radius": 0.005, "buttons.fixture": [0.2]}}  # fmt: skip
SESSIONS = {
    "clutch and modes": Session("mode_switching", {"duration": 3.0, "settings": {
        "buttons.clutch": [1.0, 1.5], "buttons.mode": [2.0], "buttons.fixture": [0.5, 2.5]}}),
    "a task": Session("point", {"duration": 3.0}),
    "a jaw from which a block slides": Session("pick", {"duration": 8.0, "settings": {
        "jaw_sim.object.friction": 0.05, "operator.buttons.jaw": [5.3, 12.9]}}),
    "a device": Session("coarse_box", HAND), "a hand": Session("coarse_box", HAND, begin="hand"),
    "a slave that starts at home": Session("coarse_box", {"duration": 1.0, "settings": {"starts_at_home": True}}),
    "two arms": Session("coarse_box", PAIR),
    "two arms of their own files": Session(
        "coarse_box", own_arm("arm.urdf", arms=["left", "right"], settings={"right/robot": "{}/other.urdf"}),
        {"arm.urdf": (URDF, None), "other.urdf": (LONGER, URDF)}),
    "two arms of one xacro": Session(
        "coarse_box", own_arm("arm.xacro", arms=["left", "right"], settings={
            "right/geometry": ["tip=tool0", "xacro.lift=0.5"]}), {"arm.xacro": (XACRO, None)}),
    "a URDF that is gone": Session("coarse_box", own_arm("arm.urdf"), {"arm.urdf": (URDF, None)}),
    "a URDF that is no text": Session("coarse_box", own_arm("arm.urdf"), {"arm.urdf": (URDF, b"\xff\xfe<robot/>")}),
    "a table of another arm": Session("coarse_box", own_arm("scara.yaml", geometry=[]), {
        "scara.yaml": (TABLE, re.sub(r"\b0\.(3|4)\b", r"0.\g<1>3", TABLE))}),
    "a xacro of another arm": Session(
        "coarse_box", own_arm("arm.xacro", geometry=["tip=tool0", "xacro.lift=0.45"]), {
            "arm.xacro": (XACRO, XACRO.replace("0.1", "0.15"))}),
    **{f"drives {name}": Session(
        "coarse_box", own_arm("arm.urdf", geometry=["tip=tool0", "drives = {}/drives.yaml"], starts_at_home=False),
        {"arm.urdf": (URDF, URDF), "drives.yaml": (DRIVES, text)}) for name, text in (
            ("that are gone", None), ("that say nothing", "{}"))},
    **{f"a mesh {name}": Session("palpation", WORLD, {"block.stl": (BLOCK, after)}) for name, after in (
        ("that is gone", None), ("of another size", box(50.0, 50.0, 31.0)))},
    "meshes that are gone": Session(
        "coarse_box", {"duration": 6.0, "settings": {"fixture": "union", "fixture.union.parts": TWO_MESHES}},
        {"box.stl": (box(30.0, 30.0, 30.0), None), "ball.stl": (box(16.0, 16.0, 16.0), None)}, naming="teleop/state"),
    "a scene of another arm": Session("coarse_box", {"duration": 2.0, "robot": "{}/cubes.xml"}, {
        "cubes.xml": (SCENE["cubes.xml"],) * 2,
        "arm.xml": (SCENE["arm.xml"], SCENE["arm.xml"].replace('damping="1.0"', 'damping="9.0"'))}),
}  # fmt: skip


def put(path: Path, content: Content) -> None:
    if content is None:
        path.unlink()
    elif callable(content):
        content(path)
    else:
        path.write_bytes(content.encode() if isinstance(content, str) else content)


QUICK = (
    "two arms", "a device", "a hand", "a slave that starts at home", "a table of another arm", "a URDF that is no text",
)  # fmt: skip


@pytest.mark.parametrize("name", [pytest.param(n, marks=() if n in QUICK else pytest.mark.slow) for n in SESSIONS])
@pytest.mark.filterwarnings("ignore::teleop_core.TeleopWarning")
def test_a_session_is_replayed_to_the_bit_whatever_became_of_its_files(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scenario, options, files, begin, naming = SESSIONS[name]
    for file, (before, _) in files.items():
        put(tmp_path / file, before)
    tc.run(scenario, out=tmp_path / "first", **at(options, tmp_path))
    for file, (_, after) in files.items():
        put(tmp_path / file, after)
    monkeypatch.setitem(sys.modules, "xacro", None)  # as where it is not installed
    tc.replay(tmp_path / "first", out=tmp_path / "second", begin=begin)
    tc.replay(tmp_path / "second", out=tmp_path / "third", begin=begin)  # which has the files as well
    first, *others = (list(Bag(tmp_path / bag).raw()) for bag in ("first", "second", "third"))
    assert len(first) > 1000
    for again in others:
        assert {one[0] for one, other in zip(first, again, strict=True) if one != other} <= {naming}
