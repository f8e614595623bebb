"""Descriptions of arms that cannot be used: URDF, xacro, drives and scenes, each refused in one line."""

from operator import attrgetter
from pathlib import Path

import pytest

from refused import Case, Step, assert_refused, of
from teleop_core.base import RecordingError, UnknownNameError
from teleop_core.robots import load_robot
from teleop_scene.arm import load_scene

ARM = Path(__file__).resolve().parents[3] / "examples/any_arm.urdf"
URDF = ARM.read_text()
XACRO = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'


def changed(*pairs: str, text: str = URDF) -> str:
    """A text in which each first word has been replaced by the second, once."""
    for old, new in zip(pairs[::2], pairs[1::2], strict=True):
        assert old in text
        text = text.replace(old, new, 1)
    return text


def arm(**options: str) -> Step:
    return lambda path: load_robot(str(path), **(options or {"tip": "tool0"}))


def at_shoulder(text: str) -> Step:
    """A xacro of the arm with something at its shoulder, and a file of macros beside it."""
    macros = '<xacro:macro name="place" params="x"><origin xyz="${x} 0 0.1"/></xacro:macro>'
    whole = changed("<robot", f"<robot {XACRO}", "<link", '<xacro:include filename="parts.xacro"/><link',
                    '<origin xyz="0 0 0.1"/>', text)  # fmt: skip

    def write(path: Path) -> None:
        path.write_text(whole)
        path.with_name("parts.xacro").write_text(f"<robot {XACRO}>{macros}</robot>")

    return write


def secret(name: str) -> Step:
    """A xacro that loads a file of secrets, which is no YAML."""

    def write(path: Path) -> None:
        path.with_name(name).write_text("user: me\nkey: *hunter2\n")
        at_shoulder(f"<x a=\"${{xacro.load_yaml('{path.with_name(name)}')}}\"/>")(path)

    return write


def bomb(encoding: str) -> bytes:
    """Entities that grow to a terabyte."""
    names = [f'<!ENTITY e{i} "{f"&e{i - 1};" * 10}">' for i in range(1, 12)]
    text = f'<!DOCTYPE robot [<!ENTITY e0 "ten letters">{"".join(names)}]><robot name="&e11;"/>'
    return text.encode(encoding)


ELBOW, LOW, LIMIT = '"elbow" type="revolute"', 'lower="-2.6"', '<limit lower="-2.6" upper="2.6"'
BOUNDS = f'{LIMIT} effort="80" velocity="3.1"/>'
PIECES = '<robot name="r"><link name="a"/><link name="b"/>{}</robot>'
FIXED = '<joint name="{0}{1}" type="fixed"><parent link="{0}"/><child link="{1}"/></joint>'
NEWER = ('name="any_arm"', 'version="1.1" name="any_arm"', 'xyz="0 0 0.42"')
CAMERA = ('"camera_mount" type="fixed">', '"camera_mount" type="revolute"><axis xyz="0 0 1"/>{}' + BOUNDS)
LED = changed(LIMIT, f'<mimic joint="shoulder" multiplier="-2"/>{LIMIT}')
LINKS = arm(tip="tool0", dynamics="links")
ROBOTS = [
    *of(arm(), "arm.urdf", (None, r"arm\.urdf"), (URDF[:500], r"arm\.urdf"), error=RecordingError),
    *of(arm(), "arm.urdf",
        ("<model/>", "<robot>"), ("<robot/>", "<link>"), ('<robot><link name="a"/></robot>', "<joint>"),
        *((bomb(encoding), "DOCTYPE") for encoding in ("utf-8", "utf-16")),
        *((changed(old, new), words) for old, new, words in (
            ('name="camera"', 'name="forearm"', "link name"), ("<joint", '<link name="lost"/><joint', "lost"),
            ('child link="camera"', 'child link="tool0"', "link tool0"),  # two parents
            *(('type="fixed"><parent link="flange"/><child link="tool0"/>',  # a circle beside the root
               f'type="fixed"><parent link="{link}"/><child link="tool0"/>', told)
              for link, told in (("tool0", "joint tool_mount"),)),
            ('<parent link="upper_arm"/>', '<parent link="forearm"/>', "joint elbow"),  # a link that carries itself
            ('<parent link="upper_arm"/>', "", "parent of joint elbow"),
            ('parent link="forearm"', 'parent link="fore"', "of joint roll"),
            (ELBOW, '"elbow" type="planar"', "type of joint elbow"), (ELBOW, '"elbow"', "type of joint elbow"),
            (ELBOW, '"elbow" type="floating"', "joint elbow"),
            ("0 1 0", "0 inf 0", "xyz of axis of joint shoulder"), ("0 1 0", "0 1e-12 0", "axis of joint shoulder"),
            ("0 1 0", "0 0 0", "axis of joint shoulder"),
            ('velocity="3.1"', 'velocity="-3.1"', "velocity of joint elbow"),
            ('effort="80"', 'effort="-80"', "effort of joint elbow"),
            (LOW, 'lower="2.6"', "joint elbow"), (LOW, 'lower="low"', "lower of joint elbow"),
            ('upper="2.6"', 'upper="nan"', "upper of joint elbow"),
            *((old, new, "<limit> of joint elbow is 'missing'") for old, new in ((LIMIT, "<limit"), (BOUNDS, ""))),
            ('xyz="0 0 0.42"', 'xyz="0 0.42"', "joint elbow"),
            ('xyz="0 0 0.42"', 'xyz="-1001 0 0"', "within 1000 m"),
            ('izz="0.008"', 'izz="nan"', "izz of link forearm"),
            ('mass value="3.0"', 'mass value="x"', "link forearm"),
            ('mass value="3.0"', 'mass value="-3.0"', "link forearm"))),
        *((changed(*NEWER, f'xyz="0 0 0.42" {new}'), words) for new, words in (
            ('rpy="0 0 0" quat_xyzw="0 0 0 1"', "rpy too"), ('quat_xyzw="0 0 0 0"', "length 1"),
            ('quat_xyzw="0 0 2 0"', "length 1"), ('quat_xyzw="0 0 1"', "4 finite numbers"),
            ('quat_xyzw="0 0 nan 1"', "4 finite numbers"))),
        *((changed("<robot", f"<robot {XACRO.replace('xacro', name, 1)}", "</robot>", f"<{name}:arm/></robot>"),
           f"<{name}:arm>.*xacro") for name in ("xacro", "x"))),
    *of(arm(tip=""), "arm.urdf",
        (URDF, "tip is '', must be one of camera, tool0"), (PIECES.format(FIXED.format(*"ab")),
         "^tip is 'b', must be a link that moves.*no joint of the file"),
        (PIECES.format(FIXED.format(*"ab") + FIXED.format(*"ba")), "joint ")),  # a circle of all links
    *of(arm(tip="base"), "arm.urdf",
        (URDF, "^tip is 'base', must be a link that moves.*a joint must lie between.*joints move column, ")),
    *of(arm(tip="tool1"), "arm.urdf", (URDF, "tool1")),
    *of(arm(tip="tool0", L1="1"), "arm.urdf", (URDF, "L1")),
    *of(arm(tip="tool0", task="x up"), "arm.urdf", (URDF, "up")),
    *of(arm(tip="tool0", dynamics="full"), "arm.urdf", (URDF, "independent, links")),
    *of(arm(tip="tool0", **{"xacro.prefix": "left_"}), "arm.urdf", (URDF, r"is no \.xacro")),
    *of(LINKS, "arm.urdf",
        (changed('effort="80"', 'effort="0.05"'), "of joint elbow"),
        (changed('izz="0.008"', 'izz="0.9"'), "of link forearm"),
        *((text, "joint camera_mount moves too, but is not on the path to the tip") for text in (
            changed(CAMERA[0], CAMERA[1].format('<mimic joint="shoulder"/>'), text=LED),
            changed('joint="shoulder"', 'joint="camera_mount"', CAMERA[0], CAMERA[1].format(""), text=LED)))),
    *of(arm(), "arm.urdf", *((changed(old, new, text=LED), words) for old, new, words in (
        ('mimic joint="shoulder"', 'mimic joint="led"', "mimic of joint elbow"),
        ('mimic joint="shoulder"', 'mimic joint="elbow"', "mimic of joint elbow"),
        ('<limit lower="-2.0"', '<mimic joint="elbow"/><limit lower="-2.0"', "does not itself follow this joint"),
        ('multiplier="-2"', 'multiplier="0"', "multiplier of mimic of joint elbow"),
        ('multiplier="-2"', 'multiplier="two"', "multiplier of mimic of joint elbow"),
        ('multiplier="-2"', 'offset="9"', "limits of joint shoulder")))),
    *of(lambda path: load_robot(str(ARM), tip="tool0", drives=str(path)), "drives.yaml",
        ("wrist: {inertia: 1.0}", "drives joint is 'wrist'.* waist, "),
        ("waist: {inertai: 1.0}", "waist entry is 'inertai'.* inertia, "),
        ("waist: {inertia: big}", "drives waist inertia is 'big'"),
        ("waist: {coulomb: -1}", "drives waist coulomb is -1.*>= 0"),
        ("waist: {effort_limit: 0}", "drives waist effort_limit is 0.*> 0"), ("[waist]", "a mapping from joint names"),
        ("waist: {inertia: 1e-4, coulomb: 9000}", "raise inertia or friction")),
    *of(lambda path: load_robot(str(ARM), tip="tool0", drives=str(path)), "drives.yaml",
        ("{", "drives.yaml"), error=RecordingError),
    *of(arm(), "arm.xacro", (None, r"arm\.xacro"), error=RecordingError),
    *of(arm(tip="tool0", **{"xacro.prefx": "left_"}), "arm.xacro",
        (at_shoulder('<xacro:arg name="prefix" default=""/>'), "prefx.*prefix"), error=UnknownNameError),
    *of(arm(), "arm.xacro", *((at_shoulder(text), rf"arm\.xacro(?!.*<class).*{words}|{words}(?!.*<class).*arm\.xacro")
        for text, words in (
        ('<xacro:place x="${1 / 0}"/>', "division by zero"), ("<xacro:place/>", "Undefined parameters"),
        ("<xacro:spot/>", "spot"), ('<origin xyz="$(arg depth) 0 0"/>', "depth"),
        ('<origin xyz="${__import__(1)} 0 0"/>', "__import__"), ('<origin xyz="$(find ..)"/>', r"package is '\.\.'"),
        *((text, "package is 'nowhere'") for text in (
            '<origin xyz="$(find nowhere) 0 0"/>', '<xacro:include filename="$(find nowhere)/a.xacro"/>',
            "<x a=\"${xacro.load_yaml('$(find nowhere)/a.yaml')}\"/>")))),
        # A file that is loaded is named and never quoted.
        (secret("keys.txt"), r"^(?!.*hunter2).*keys\.txt"),
        (secret("keys.yaml"), r"^(?!.*hunter2).*keys\.yaml.*line 2")),
    *of(arm(), "arm.urdf", (at_shoulder('<xacro:place x="0"/>'), r"<xacro:.*> must be|call it \.xacro")),
    *of(load_scene, "scene.xml", (None, "cannot be read"), error=RecordingError),
    *of(load_scene, "scene.xml", ("<mujoco><worldbody>", ""),
        ('<mujoco><asset><mesh name="m" file="gone.stl"/></asset></mujoco>', "gone.stl")),
]  # fmt: skip


@pytest.mark.filterwarnings("ignore::teleop_core.TeleopWarning")
@pytest.mark.parametrize("case", ROBOTS, ids=attrgetter("words"))
def test_a_description_of_an_arm_that_cannot_be_used_is_refused_in_one_line(case: Case, tmp_path: Path) -> None:
    assert_refused(case, tmp_path)
