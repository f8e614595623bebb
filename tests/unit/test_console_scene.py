"""Scene of the console: what is drawn is where it is, and only what changed is sent."""

from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray
from viser._scene_handles import BoxHandle, FrameHandle

import teleop_core as tc
from page_client import TOKEN
from present import present
from teleop_console.drivers import Drivers
from teleop_console.fixture_outlines import Look, scale_of, unit_outline
from teleop_console.hooks import Server
from teleop_console.jaw_nodes import finger_poses
from teleop_console.link import ArmView, ShownArm, View
from teleop_console.look import GOOD, HELD, ROLES, WRONG
from teleop_console.master_nodes import METRES_PER_NEWTON
from teleop_console.recorded import RecordedLink
from teleop_console.recorded_arms import parameters_of
from teleop_console.scene import Scene, targets_of
from teleop_console.server import ConsoleServer
from teleop_console.view_tab import Visitors
from teleop_console.world_nodes import object_outline
from teleop_core.coupling.fixtures import Fixture
from teleop_core.graph.topics import Limit
from teleop_core.kernels.geometry import Array, rotations_from_quaternions
from teleop_core.robots.bodies import Solid
from teleop_core.robots.bodies.meshes import mesh_of
from teleop_core.shapes import SHAPES

# Poses that differ less from what is drawn are not sent.
STILL = 3e-5
MASTER, TIP, FORCE = "master/measured_cp", "slave/measured_cp", "master/measured_cf"


@pytest.fixture(scope="module")
def server() -> Any:
    with ConsoleServer(port=0, token=TOKEN) as opened:
        yield opened.viser


@pytest.fixture(scope="module")
def session() -> tc.Recording:
    """Free motion, then a box of 16 mm, which the hand leaves."""
    return tc.run("coarse_box", duration=11.0, fixture__box__size=[0.016] * 3)


@pytest.fixture
def link(session: tc.Recording) -> RecordedLink:
    return RecordedLink(session.bag)


def drawn(server: Server, link: RecordedLink, time: float) -> tuple[Scene, View]:
    """Scene of a recording at a time, and the view that it shows."""
    server.scene.reset()
    scene = Scene(server, link.arms)
    scene.retune(link.parameters())
    link.seek(time)
    view = link.view()
    scene.draw(view)
    return scene, view


def scene_of(server: Server, name: str) -> Scene:
    """Empty scene with an arm."""
    server.scene.reset()
    return Scene(server, [ShownArm("", tc.load_robot(name))])


def turned(node: FrameHandle | BoxHandle) -> Array:
    return rotations_from_quaternions(node.wxyz[None])[0]


def sent(server: Server) -> int:
    """Messages that were ever queued for browsers."""
    return server._websock_server.get_message_buffer().message_counter


@pytest.mark.parametrize("time", [0.0, 3.0, 7.5, 11.0])
def test_the_tip_is_drawn_where_it_was_measured(server: Server, link: RecordedLink, time: float) -> None:
    scene, view = drawn(server, link, time)
    tip, measured = scene.arms[""].drawn.frames["tip"], view.arms[""].streams[TIP]
    np.testing.assert_allclose(tip.position, measured[:3], atol=STILL)
    assert abs(tip.wxyz @ measured[3:]) > 1.0 - STILL


def test_the_stylus_moves_on_the_page_as_the_command_of_the_tip_does(server: Server, link: RecordedLink) -> None:
    scene, before = drawn(server, link, 2.0)
    link.seek(6.0)
    after = link.view()
    base = turned(scene.arms[""].master.base)
    hand, command = (
        after.arms[""].streams[name][:3] - before.arms[""].streams[name][:3] for name in (MASTER, "slave/servo_cp")
    )
    assert np.linalg.norm(hand) > 5e-3
    np.testing.assert_allclose(base @ hand, command, atol=5e-4)  # gain 1


def test_the_fixture_is_drawn_around_the_hand_where_its_button_was_pressed(
    server: Server, link: RecordedLink, session: tc.Recording
) -> None:
    state = session["teleop/state"]
    when = state.stamp_ns[np.argmax(state["is_fixture_on"] > 0)]
    master = session[MASTER]
    there = master[["x", "y", "z"]][np.searchsorted(master.stamp_ns, when)]
    scene, _ = drawn(server, link, 1.0)
    assert scene.arms[""].outline.line is None
    scene, view = drawn(server, link, 11.0)
    assert view.arms[""].state["is_fixture_on"]
    outline = present(scene.arms[""].master.outline.line)
    np.testing.assert_allclose(outline.position, there, atol=2e-4)
    np.testing.assert_allclose(outline.scale, [0.016] * 3, rtol=1e-9)


def test_a_fixture_is_red_where_its_wall_is_felt_and_green_elsewhere(
    server: Server, link: RecordedLink, session: tc.Recording
) -> None:
    force = session[FORCE]
    size = sizes(force)
    colors = []
    for time in (force.time[np.argmax(size)], force.time[size == 0.0][-1]):
        scene, view = drawn(server, link, time)
        assert view.arms[""].state["is_fixture_on"]
        colors.append(tuple(present(scene.arms[""].outline.line).colors.tolist()))
    assert colors == [WRONG, GOOD]


def sizes(stream: tc.Stream) -> Array:
    """Forces (N,) [N] of a stream of wrenches."""
    return np.linalg.norm(stream[["fx", "fy", "fz"]], axis=1)


def path_of(server: Any, name: str) -> NDArray[np.float32]:
    """Points of a path on the page, along it, without what is too old."""
    line = present(server.scene.get_handle_by_name(f"/arm/{name}"))
    points = np.concatenate((line.points[:, 0], line.points[-1:, 1]))
    return points[np.abs(np.diff(points, axis=0, prepend=np.nan)).max(axis=1) != 0.0]


def test_the_path_of_the_tip_goes_through_where_it_was_measured(
    server: Server, link: RecordedLink, session: tc.Recording
) -> None:
    scene, _ = drawn(server, link, 4.0)
    for time in np.arange(4.0, 10.0, 1 / 30):
        link.seek(time)
        scene.draw(link.view())
    measured, points = session[TIP], path_of(server, "measured")
    recent = measured[["x", "y", "z"]][measured.time > 3.99]
    assert len(points) > 50
    distances = np.linalg.norm(points[:, None] - recent[None], axis=2).min(axis=1)
    assert distances.max() < 1e-6


def test_after_a_jump_in_time_the_path_is_that_of_the_recording(
    server: Server, link: RecordedLink, session: tc.Recording
) -> None:
    scene, _ = drawn(server, link, 0.0)
    scene.draw(link.view())
    link.seek(9.0)
    scene.draw(link.view())
    assert len(path_of(server, "measured")) == 1
    scene.remember(link.path)
    link.seek(6.0)
    scene.draw(link.view())
    points = path_of(server, "measured")
    np.testing.assert_allclose(points[-1], link.view().arms[""].streams[TIP][:3], atol=1e-4)
    np.testing.assert_allclose(points[0], session[TIP][["x", "y", "z"]][0], atol=1e-4)


def test_the_same_view_again_sends_nothing(server: Server, link: RecordedLink) -> None:
    scene, view = drawn(server, link, 9.0)
    scene.draw(view)
    before = sent(server)
    for _ in range(50):
        scene.draw(view)
    assert sent(server) == before


def test_another_view_sends_no_mesh_again(server: Server, link: RecordedLink) -> None:
    scene, _ = drawn(server, link, 9.0)
    count = len(server._websock_server.get_message_buffer().message_from_id)
    for time in np.linspace(9.0, 10.5, 100):
        link.seek(time)
        scene.draw(link.view())
    grown = len(server._websock_server.get_message_buffer().message_from_id) - count
    assert grown < 40, "messages are kept for those who come later, the newest of each kind alone"


@pytest.mark.parametrize("name", tc.list_robots())
def test_every_robot_is_drawn_and_the_first_camera_sees_all_of_it_in_a_square_window(server: Server, name: str) -> None:
    scene, robot = scene_of(server, name), tc.load_robot(name)
    scene.draw(View(arms={"": ArmView()}))
    camera, room = scene.whole(), scene.arms[""].room()
    corners = np.stack(np.meshgrid(*np.transpose(room)), axis=-1).reshape(-1, 3)
    turn = rotations_from_quaternions(camera.quaternion[None])[0]
    right, down, depth = ((corners - camera.position) @ turn).T
    half = np.tan(0.5 * server.initial_camera.fov)
    assert (depth > 0.0).all()
    assert (np.abs(down) < half * depth).all()
    assert (np.abs(right) < 1.06 * half * depth).all()
    rng = np.random.default_rng(4)
    scene.show("ghost", is_shown=True)
    for joints in (robot.home, rng.uniform(robot.lower, robot.upper), np.full(robot.n, np.nan)):
        state = np.concatenate((joints, np.zeros(2 * robot.n)))
        scene.draw(View(arms={"": ArmView({"slave/measured_js": state, "slave/setpoint_js": joints})}))
    scene.show("axes", is_shown=True)
    for camera in (scene.whole(), scene.tool(), scene.microscope()):
        assert np.isfinite(camera.quaternion).all()
    assert all(np.isfinite(frame.position).all() for frame in scene.arms[""].drawn.frames.values())


def test_a_link_with_a_visual_is_drawn_as_it_looks_and_the_others_plainly(server: Any, tmp_path: Path) -> None:
    server.scene.reset()
    text = (Path(__file__).parents[2] / "examples" / "any_arm.urdf").read_text(encoding="utf-8")
    box = '<visual><geometry><box size="0.1 0.2 0.3"/></geometry></visual>'
    file = tmp_path / "arm.urdf"
    file.write_text(text.replace('<link name="forearm">', f'<link name="forearm">{box}'))
    scene = Scene(server, [ShownArm("", tc.load_robot(str(file), tip="tool0"))])
    scene.show("ghost", is_shown=True)
    for place in ("/arm/robot", "/arm/ghost"):
        forearm = present(server.scene.get_handle_by_name(f"{place}/link3/link"))
        assert np.ptp(forearm.vertices, axis=0).max() == pytest.approx(0.3)
        assert server.scene.get_handle_by_name(f"{place}/link3/joint") is None
        assert server.scene.get_handle_by_name(f"{place}/link2/joint") is not None


def test_the_ghost_stands_where_the_setpoints_are_while_it_is_shown(server: Any, link: RecordedLink) -> None:
    scene, view = drawn(server, link, 9.0)
    scene.show("ghost", is_shown=True)
    robot, root = link.arms[0].robot, present(server.scene.get_handle_by_name("/arm/ghost"))
    tip = present(server.scene.get_handle_by_name("/arm/ghost/tip"))
    for away, is_shown in ((0.1, True), (0.2, False)):
        wanted = 0.5 * (robot.lower + robot.upper) + away * (robot.upper - robot.lower)
        view.arms[""].streams["slave/setpoint_js"] = wanted
        scene.show("ghost", is_shown=is_shown)
        for _ in range(3):  # it is drawn every third time
            scene.draw(view)
        assert root.visible == is_shown
        assert np.allclose(tip.position, robot.fk(wanted)[:3, 3], atol=STILL) == is_shown


def test_the_force_on_the_stylus_is_an_arrow_at_it_as_long_as_it_is_large(
    server: Server, link: RecordedLink, session: tc.Recording
) -> None:
    force = session[FORCE]
    size = sizes(force)
    scene, view = drawn(server, link, force.time[np.argmax(size)])
    arrow, seen = scene.arms[""].master._force, view.arms[""].streams
    assert arrow._frame.visible
    np.testing.assert_allclose(arrow._frame.position, seen[MASTER][:3], atol=STILL)
    shaft = np.array([np.zeros(3), METRES_PER_NEWTON * seen[FORCE][:3]])
    np.testing.assert_allclose(np.asarray(arrow._arrow.points[0], np.float64), shaft, atol=1e-6)
    assert arrow._label.text == f"{size.max():.1f} N"
    scene, _ = drawn(server, link, force.time[size == 0.0][-1])
    assert not scene.arms[""].master._force._frame.visible


@pytest.mark.parametrize("name", ["rcrt1", "planar_3r"])
def test_the_reach_holds_the_places_of_the_tip_and_no_others(server: Any, name: str) -> None:
    scene, robot, rng = scene_of(server, name), tc.load_robot(name), np.random.default_rng(1)
    scene.show("reach", is_shown=True)
    cloud = present(server.scene.get_handle_by_name("/arm/reach"))
    points = np.asarray(cloud.points, np.float64)
    tips = np.array([robot.fk(rng.uniform(robot.lower, robot.upper))[:3, 3] for _ in range(500)])
    room = 0.1 * np.ptp(tips, axis=0).max()
    for one, other in ((points, tips), (tips, points)):
        assert (one.min(axis=0) > other.min(axis=0) - room).all()
    near = np.linalg.norm(points[:, None] - tips[None], axis=2).min(axis=0)
    assert np.median(near) < room
    scene.show("reach", is_shown=False)
    assert not cloud.visible


def test_the_hand_of_a_task_passes_every_target_and_no_other_operator_has_any() -> None:
    configuration = tc.configuration("points24", duration=40.0)
    targets = targets_of(parameters_of(configuration), "")
    assert targets.shape == (24, 3)
    path = tc.run(configuration)[MASTER][["x", "y", "z"]]
    away = [np.linalg.norm(path - target, axis=1).min() for target in targets]
    assert max(away) < 1.5e-3  # tremor, and what friction of the device holds back
    assert len(targets_of(parameters_of(tc.configuration("free_motion")), "")) == 0
    assert len(targets_of(parameters_of(configuration), "left")) == 0


def test_a_joint_at_its_limit_has_a_halo_and_its_body_keeps_its_colour(server: Server) -> None:
    scene, robot = scene_of(server, "rcrt1"), tc.load_robot("rcrt1")
    bodies = scene.arms[""].bodies
    place = f"/arm/robot/{bodies.bodies[bodies.joint_body[1]].name}"

    def drawn(joints: Array) -> tuple[bool, set[tuple[int, int, int]]]:
        state = np.concatenate((joints, np.zeros(2 * robot.n)))
        scene.draw(View(arms={"": ArmView({"slave/measured_js": state})}))
        halo = server.scene.get_handle_by_name(f"{place}/limit")
        found = (server.scene.get_handle_by_name(f"{place}/{role}") for role in ROLES)
        return halo is not None and halo.visible, {cast(Any, mesh).color for mesh in found if mesh}

    at_limit = robot.start.copy()
    at_limit[1] = robot.upper[1]
    _, greys = drawn(robot.start)
    for joints, is_marked in ((robot.start, False), (at_limit, True), (robot.start, False)):
        assert drawn(joints) == (is_marked, greys)
    halo = cast(Any, server.scene.get_handle_by_name(f"{place}/limit"))
    assert halo.color == HELD


def test_no_joint_is_marked_at_home_unless_the_session_says_that_it_is_in_the_way(server: Server) -> None:
    scene, robot = scene_of(server, "rcrt1"), tc.load_robot("rcrt1")  # its home is the end of d3
    drawn, slide = scene.arms[""].drawn, robot.joint_names.index("d3")
    told = {"limit": float(Limit.JOINT), "limited_joint": float(slide)}
    measured = {"slave/measured_js": np.concatenate((robot.home, np.zeros(2 * robot.n)))}
    nothing: dict[str, float] = {}
    for state, marked in ((nothing, 0), (told, 1)):
        scene.draw(View(arms={"": ArmView(measured, state=state)}))
        assert len(drawn._marked) == marked


def test_two_arms_stand_beside_each_other_and_each_tip_is_where_it_was_measured(
    server: Server, link: RecordedLink
) -> None:
    server.scene.reset()
    scene = Scene(server, [replace(link.arms[0], name=name) for name in ("", "right")])
    view = View()
    for name, time in (("", 2.0), ("right", 9.0)):
        link.seek(time)
        view.arms[name] = link.view().arms[""]
    scene.draw(view)
    (low, _), (_, high) = (scene.arms[name].room() for name in ("", "right"))
    assert high[1] < low[1]
    for name in ("", "right"):
        nodes = scene.arms[name]
        root = present(server.scene.get_handle_by_name(nodes.path))
        tip = present(server.scene.get_handle_by_name(f"{nodes.path}/robot/tip"))
        np.testing.assert_allclose(tip.position, view.arms[name].streams[TIP][:3], atol=STILL)
        np.testing.assert_allclose(nodes.tip()[:3], root.position + tip.position, atol=STILL)


@pytest.mark.parametrize("name", ["rcrt1", "puma560", "planar_3r"])
@pytest.mark.parametrize("aspect", [0.46, 1.2, 2.4])
def test_camera_of_the_work_sees_tip_and_stylus_and_no_more_than_it_must(
    server: Server, name: str, aspect: float
) -> None:
    scene = scene_of(server, name)
    camera, points = scene.work(aspect), scene.arms[""].work()
    turn = rotations_from_quaternions(camera.quaternion[None])[0]
    right, down, depth = ((points - camera.position) @ turn).T
    half = np.tan(0.5 * server.initial_camera.fov)
    across, upwards = np.abs(right / depth) / (half * aspect), np.abs(down / depth) / half
    assert max(across.max(), upwards.max()) < 1.0
    assert across.max() > 0.75 or upwards.max() > 0.6  # of half the picture
    if aspect < 0.75:  # a panel covers the lower part
        assert (down < 0.15 * half * depth).all()


SOLIDS = {
    "box": ((0.1, 0.2, 0.3), 0.006),
    "sphere": ((0.1,), 4 / 3 * np.pi * 1e-3),
    "cylinder": ((0.1, 0.3), np.pi * 3e-3),
    "capsule": ((0.1, 0.3), np.pi * 3e-3 + 4 / 3 * np.pi * 1e-3),
}


@pytest.mark.parametrize("kind", SOLIDS)
def test_meshes_are_closed_look_outwards_and_have_the_volume_of_their_solid(kind: str) -> None:
    size, volume = SOLIDS[kind]
    pose = np.array([0.3, -0.2, 0.1, 0.5, 0.5, 0.5, 0.5])
    mesh = trimesh.Trimesh(*mesh_of(Solid(cast(Any, kind), size, pose, "link")))
    mesh.merge_vertices()
    mesh.update_faces(mesh.nondegenerate_faces())
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(volume, rel=0.05)
    np.testing.assert_allclose(mesh.center_mass, pose[:3], atol=1e-9)


@pytest.mark.parametrize("kind", ["box", "sphere", "cylinder", "cone", "of another program"])
def test_outlines_are_one_long_along_each_axis(kind: str) -> None:
    points = unit_outline(Look(kind)).reshape(-1, 3)
    np.testing.assert_allclose(np.ptp(points, axis=0), 1.0)


TURNED = {
    "cylinder": {"direction": (0.3, 0.4, -0.2), "length": 0.0},
    "half_space": {"room": 0.02},  # flat, and not through the middle
    "cone": {"axis": (0.1, 1.0, 0.0), "half_angle": 0.6},
    "line": {"direction": (0.0, 0.0, 1.0), "length": 0.03},
    "path": {"points": (0.01, 0.0, 0.0, 0.01, 0.0, 0.03)},
    "sphere": {"place": (0.0, 0.04, 0.01)},
    "box": {"size": (0.01, 0.02, 0.03), "place": (0.0, 0.02, 0.0)},
}


@pytest.mark.parametrize("kind", [name for name in SHAPES if not hasattr(SHAPES.find(name).parameters, "file")])
def test_outlines_are_those_of_the_fixtures_with_their_parameters(kind: str) -> None:
    part: Any
    values: Any
    part, values, gain = SHAPES.find(kind), TURNED.get(kind, {}), 0.2
    unit = unit_outline(Look(kind, tuple(values.items())))
    own = {name: value for name, value in values.items() if name != "place"}
    fixture = Fixture(part, part.parameters(**own), values.get("place", (0.0, 0.0, 0.0)))
    points = (unit * scale_of(unit, gain * fixture.size(), gain)).reshape(-1, 3)
    outline = gain * fixture.outline()
    outline = outline[np.isfinite(outline).all(axis=1)]
    near = np.linalg.norm(points[:, None] - outline, axis=2).min(axis=1)
    assert near.max() < 1e-12
    np.testing.assert_allclose(np.ptp(points, axis=0), np.ptp(outline, axis=0), atol=1e-12)


def test_the_scene_draws_a_fixture_where_its_parameters_have_it(server: Server) -> None:
    session = tc.run("coarse_box", duration=5.0, fixture="half_space", fixture__half_space__room=0.02)
    scene, view = drawn(server, RecordedLink(session.bag), 4.5)
    assert view.arms[""].state["is_fixture_on"]
    line: Any = scene.arms[""].master.outline.line
    below = line.scale[1] * line.points.reshape(-1, 3)[:, 1]
    np.testing.assert_allclose(below, -0.02, atol=1e-6)


@pytest.fixture(scope="module")
def pressed() -> tc.Recording:
    """A block of tissue that the tip is pressed into."""
    return tc.run("palpation", duration=9.0)


def test_the_object_is_drawn_where_the_tip_touches_it(server: Server, pressed: tc.Recording) -> None:
    scene, _ = drawn(server, RecordedLink(pressed.bag), 8.0)
    points = present(scene.arms[""].world.line).points.reshape(-1, 3)
    low, high = points.min(axis=0), points.max(axis=0)
    force = pressed["slave/true_cf"]
    first = force.stamp_ns[np.argmax(force["fz"] > 0.0)]
    tip = pressed["slave/true_cp"]
    place = tip[["x", "y", "z"]][np.searchsorted(tip.stamp_ns, first)]
    assert (low[:2] < place[:2]).all()
    assert (place[:2] < high[:2]).all()
    assert place[2] == pytest.approx(high[2], abs=1e-4)


def test_the_push_on_the_tip_is_drawn_there_as_large_as_it_is(server: Server, pressed: tc.Recording) -> None:
    force = pressed["slave/measured_cf"]
    size = sizes(force)
    scene, view = drawn(server, RecordedLink(pressed.bag), force.time[np.argmax(size)])
    push = scene.arms[""].world.push
    assert push._frame.visible
    np.testing.assert_allclose(push._frame.position, view.arms[""].streams[TIP][:3], atol=STILL)
    assert push._label.text == f"{size.max():.1f} N"
    scene, _ = drawn(server, RecordedLink(pressed.bag), force.time[size == 0.0][0])
    assert not scene.arms[""].world.push._frame.visible


def test_without_an_object_none_is_drawn_and_one_without_a_place_lies_below_the_tip(
    server: Server, link: RecordedLink
) -> None:
    scene, _ = drawn(server, link, 3.0)
    assert scene.arms[""].world.line is None
    robot = link.arms[0].robot
    below = object_outline({"kind": "sphere", "sphere.radius": 0.01, "gap": 0.02}, robot)
    tip = robot.fk(robot.start)[:3, 3]
    middle = 0.5 * (below.reshape(-1, 3).min(axis=0) + below.reshape(-1, 3).max(axis=0))
    np.testing.assert_allclose(middle, tip - [0.0, 0.0, 0.03], atol=1e-6)
    assert not len(object_outline({"kind": "not installed here"}, robot))
    foreign: dict[str, Any] = {"kind": "sphere", "elsewhere.radius": 0.1, "sphere.radius": 0.01}
    assert len(object_outline(foreign, robot))


def test_two_fingers_stand_at_the_tip_as_far_apart_as_the_jaw_is_open_and_the_block_where_it_is(
    server: Server, link: RecordedLink
) -> None:
    picked = tc.run("pick", duration=6.0)
    scene, view = drawn(server, RecordedLink(picked.bag), picked.duration - 0.1)
    jaw, seen = scene.arms[""].jaw, view.arms[""].streams
    np.testing.assert_allclose(jaw.blocks[0].position, seen["slave/jaw/object_cp"][:3], atol=STILL)
    ends = [node.position + 0.02 * turned(node)[:, 2] for node in jaw.fingers]
    angle = seen["slave/jaw/measured_js"][0]
    width = 2.0 * 0.04 * np.sin(0.5 * angle)
    assert np.linalg.norm(ends[1] - ends[0]) == pytest.approx(width, abs=1e-4)
    np.testing.assert_allclose(np.mean(ends, axis=0), seen["slave/true_cp"][:3], atol=1e-3)
    begins = [node.position - 0.02 * turned(node)[:, 2] for node in jaw.fingers]
    np.testing.assert_allclose(begins[0], begins[1], atol=1e-4)  # they turn about one pivot
    none, _ = drawn(server, link, 3.0)
    assert not none.arms[""].jaw.fingers
    assert not none.arms[""].jaw.blocks


def test_every_block_and_every_peg_of_a_board_is_drawn_where_it_stands(server: Server) -> None:
    carried = tc.run("peg_transfer", duration=17.0)
    scene, view = drawn(server, RecordedLink(carried.bag), carried.duration - 0.1)
    jaw = scene.arms[""].jaw
    board = view.arms[""].streams["slave/jaw/board"]
    assert board[0] == 1.0  # the first one stands on another peg
    found = [node.position for node in jaw.blocks]
    np.testing.assert_allclose(found, board[3:12].reshape(3, 3), atol=STILL)
    axes = [[x, y] for y in (-0.2357, -0.2757) for x in (0.231, 0.256, 0.281)]
    np.testing.assert_allclose([node.position[:2] for node in jaw.pegs], axes, atol=STILL)
    feet = [node.position[2] - 0.5 * node.dimensions[2] for node in jaw.pegs]
    np.testing.assert_allclose(feet, board[5] - 0.01, atol=STILL)  # where blocks stand


def test_the_pads_are_at_the_tip_whatever_the_angle() -> None:
    tip = np.array([0.3, -0.1, 0.2, 0.5, 0.5, -0.5, 0.5])
    for angle in (0.0, 0.4, 1.0):
        poses = finger_poses(tip, angle, 0.04)
        pads = poses[:, :3] + 0.02 * rotations_from_quaternions(poses[:, 3:])[:, :, 2]
        np.testing.assert_allclose(pads.mean(axis=0), tip[:3], atol=1e-12)


def test_the_goal_of_a_task_is_a_ball_where_it_is_and_as_wide(server: Server) -> None:
    recording = tc.run("point", duration=3.0)
    scene, view = drawn(server, RecordedLink(recording.bag), recording.duration - 0.1)
    goal = present(scene.arms[""]._goal)
    told = recording["task/state"]
    row = told.values[np.searchsorted(told.log_ns, told.log_ns[0] + int(1e9 * (recording.duration - 0.1)))]
    assert row[0] > 0.0
    np.testing.assert_allclose(goal.position, row[2:5], atol=1e-9)
    assert goal.scale == pytest.approx(row[5])
    assert goal.visible
    view.arms[""].streams["task/state"][0] = 0.0
    scene.draw(view)
    assert not goal.visible


def test_the_view_of_the_work_grows_to_hold_what_the_tip_meets_goals_far_away_too(server: Server) -> None:
    recording = tc.run("point", duration=3.0)
    scene, view = drawn(server, RecordedLink(recording.bag), recording.duration - 0.1)
    nodes, before = scene.arms[""], scene.work()

    def is_held(point: Array) -> bool:
        points = nodes.work()
        return bool((points.min(axis=0) <= point).all() and (point <= points.max(axis=0)).all())

    arm = view.arms[""]
    far = arm.streams["task/state"][2:5] + np.array([0.3, -0.2, 0.1])
    assert is_held(nodes.tip()[:3])
    assert not is_held(far)
    arm.streams["task/state"][2:5] = far
    arm.state |= {"is_fixture_on": 1.0, "gain": 1.0}
    corner = np.array([-0.2, -0.2, 0.0])
    for axis, place, size in zip("xyz", corner, (0.1, 0.1, 0.1), strict=True):
        arm.state |= {f"fixture_center_{axis}": place, f"fixture_size_{axis}": size}
    scene.draw(view)
    assert is_held(far)
    assert is_held(corner - 0.05)
    assert scene.work().is_elsewhere(before, 0.08)


def test_a_camera_on_the_tool_goes_with_it_until_another_is_chosen_and_one_that_was_turned_stays(
    server: Server,
) -> None:
    scene, client = scene_of(server, "rcrt1"), Viewer()
    visitors: Any = Visitors(server, Drivers(), scene, is_live=True)
    visitors._fit(0, client)
    work = scene.work(client.camera.aspect)
    np.testing.assert_allclose(client.camera.position, work.position)
    visitors.give(client, scene.tool, is_riding=True)
    for step in (0.1, 0.2):
        scene.arms[""]._poses[-1, :3] += step
        visitors._fit(0, client)
        np.testing.assert_allclose(client.camera.position, scene.tool().position)
    visitors.give(client, None)
    visitors._fit(0, client)
    np.testing.assert_allclose(client.camera.position, scene.work(client.camera.aspect).position)
    client.camera.position = turned = np.array([9.0, 0.0, 0.0])  # by its person
    scene.arms[""]._works = np.array(([-1.0] * 3, [1.0] * 3))
    visitors._fitted[0] = replace(visitors._fitted[0], looked=0.0)
    visitors._fit(0, client)
    np.testing.assert_allclose(client.camera.position, turned)


class Viewer:
    """A browser that keeps the camera that it is given."""

    client_id = 0

    def __init__(self) -> None:
        nowhere = np.zeros(3)
        self.camera = SimpleNamespace(aspect=1.2, position=nowhere, look_at=nowhere, up_direction=nowhere)
        self.atomic = nullcontext


def test_fingers_of_a_urdf_open_with_the_jaw_and_no_others_are_added(server: Server, tmp_path: Path) -> None:
    arm = Path(__file__).parents[2] / "examples" / "my_arm.urdf"
    held = tc.run("pick", duration=1.0, robot=str(arm), geometry=["tip=tool0"])
    scene, view = drawn(server, RecordedLink(held.bag), held.duration - 0.1)
    nodes = scene.arms[""]
    share = view.arms[""].streams["slave/jaw/measured_js"][0] / 0.8
    assert 0.05 < share <= 1.0
    for frame in (frame for _, frame in nodes.drawn._fingers):
        assert abs(frame.position[1]) == pytest.approx(0.006 + 0.04 * share, abs=0.04 / 30)
    assert not nodes.jaw.fingers
