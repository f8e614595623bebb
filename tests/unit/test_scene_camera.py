"""Pictures of a scene show the state of their stamp, are the same in every run, and arrive as the network says."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import teleop_core as tc

mujoco = pytest.importorskip("mujoco", reason="teleop_scene is not installed")
simplejpeg = pytest.importorskip("simplejpeg", reason="teleop_scene is not installed")
from rosbags.typesys import Stores, get_typestore  # noqa: E402

from teleop_core.graph import TICK_NS  # noqa: E402
from teleop_core.kernels import Array  # noqa: E402
from teleop_scene import models  # noqa: E402
from teleop_scene.camera import Camera, read_marker, write_marker  # noqa: E402
from teleop_scene.film import film  # noqa: E402
from teleop_scene.parameters import View  # noqa: E402

SCENE = models.OWN / "cubes.xml"
VIEWS = ("front:320x240", "side:160x120:0.4,-0.8,0.5,0.35,0,0.1")
IMAGE, SIDE = "camera/front/image_raw/compressed", "camera/side/image_raw/compressed"


def _can_draw() -> bool:
    try:
        Camera(SCENE, View("front", 64, 64)).close()
    except tc.TeleopError:
        return False
    return True


pytestmark = pytest.mark.skipif(not _can_draw(), reason="no OpenGL without a screen (EGL) on this machine")


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> tc.Recording:
    out = tmp_path_factory.mktemp("bags") / "cubes"
    return tc.run("coarse_box", duration=1.0, robot=str(SCENE), settings={"scene.rate": 100}, out=out)


def messages_of(bag: tc.Recording, topic: str) -> list[tuple[int, Any]]:
    """Log time [ns] and message of each sample of a topic, read by the rosbags library."""
    types = get_typestore(Stores.ROS2_JAZZY)
    return [(log, types.deserialize_cdr(data, kind)) for _, kind, log, data in bag.bag.raw([topic])]


def stamp_of(message: Any) -> int:
    return int(message.header.stamp.sec * 10**9 + message.header.stamp.nanosec)


def poses_at(q: Array, model: Any) -> tuple[Array, Any]:
    """Poses (n, 7) of the moving bodies at joint positions, and the state, by MuJoCo itself."""
    data = mujoco.MjData(model)
    data.qpos[:] = q
    mujoco.mj_forward(model, data)
    moving = [b for b in range(1, model.nbody) if model.body_jntnum[b]]
    return np.hstack([data.xpos[moving], data.xquat[moving]]), data


def test_a_picture_from_poses_is_the_picture_from_the_state(monkeypatch: pytest.MonkeyPatch) -> None:
    """MuJoCo's own drawing of random states, which moves also what hangs on bodies without joints."""
    from mujoco import egl
    from mujoco.rendering.classic import renderer

    monkeypatch.setattr(renderer.gl_context, "GLContext", egl.GLContext)
    model, rng = mujoco.MjModel.from_xml_path(str(SCENE)), np.random.default_rng(3)
    model.vis.quality.offsamples = model.vis.quality.shadowsize = 0
    camera, oracle = Camera(SCENE, View("front", 160, 120)), mujoco.Renderer(model, 120, 160)
    for flag in (mujoco.mjtRndFlag.mjRND_SHADOW, mujoco.mjtRndFlag.mjRND_REFLECTION):
        oracle.scene.flags[flag] = False
    pictures = []
    for _ in range(3):
        q = model.key_qpos[0].copy()
        q[:6] += rng.uniform(-0.5, 0.5, 6)
        poses, data = poses_at(q, model)
        oracle.update_scene(data, "front")
        expected = oracle.render().astype(int)
        found = camera.take(poses)
        assert np.mean(np.abs(found - expected).max(axis=2) > 8) < 1e-3  # edges alone may round differently
        pictures.append(found)
    assert np.mean(pictures[0] != pictures[1]) > 0.01
    oracle.close()


@pytest.mark.parametrize("tick", [0, 1, 255, 123_456_789, 2**48 - 1])
def test_a_marker_survives_jpeg(tick: int) -> None:
    pixels = np.random.default_rng(tick).integers(0, 255, (120, 160, 3), np.uint8)
    write_marker(pixels, tick)
    data = simplejpeg.encode_jpeg(pixels, 90, colorsubsampling="420")
    assert read_marker(simplejpeg.decode_jpeg(data)) == tick


def test_every_picture_belongs_to_the_state_of_its_stamp(session: tc.Recording, tmp_path: Path) -> None:
    report = film(session, tmp_path / "seen", VIEWS, rate=25.0, is_marked=True)
    seen = tc.open_recording(tmp_path / "seen")
    poses = {int(stamp) for stamp in session["scene/poses"].stamp_ns}
    for topic, size in ((IMAGE, (240, 320, 3)), (SIDE, (120, 160, 3))):
        found = messages_of(seen, topic)
        assert len(found) * 2 == report.taken
        for log_ns, message in found:
            pixels = simplejpeg.decode_jpeg(message.data.tobytes())
            assert pixels.shape == size
            assert read_marker(pixels) * TICK_NS == stamp_of(message)
            assert stamp_of(message) in poses
            assert message.format == "jpeg"
            assert log_ns >= stamp_of(message)
    stamps = [stamp_of(message) for _, message in messages_of(seen, IMAGE)]
    camera, series = Camera(SCENE, View.parse(VIEWS[0], is_marked=True)), session["scene/poses"]
    for _, message in messages_of(seen, IMAGE)[::10]:
        (row,) = series.values[series.stamp_ns == stamp_of(message)]
        expected = camera.take(row.reshape(-1, 7)[: camera.bodies], stamp_of(message) // TICK_NS)
        packed = simplejpeg.encode_jpeg(expected, 90, colorsubsampling="420")
        assert message.data.tobytes() == packed  # to the bit: a tick earlier it would be another picture
    assert set(np.diff(stamps)[1:]) == {40_000_000}
    assert (report.lost, report.missed) == (0, 0)
    infos = [info for _, info in messages_of(seen, "camera/front/camera_info")]
    assert [stamp_of(info) for info in infos] == stamps
    info = infos[0]
    assert (info.width, info.height) == (320, 240)
    assert info.k[0] == pytest.approx(120.0 / np.tan(np.radians(22.5)))  # 45° from top to bottom
    for name in session.topics:
        assert [d for *_, d in seen.bag.raw([name])] == [d for *_, d in session.bag.raw([name])]


def test_the_same_session_gives_the_same_pictures(session: tc.Recording, tmp_path: Path) -> None:
    for name in ("a", "b"):
        film(session, tmp_path / name, VIEWS, rate=10.0)
    first, second = (
        [data for *_, data in tc.open_recording(tmp_path / name).bag.raw([IMAGE, SIDE])] for name in ("a", "b")
    )
    assert len(first) > 20
    assert first == second


def test_a_network_delays_loses_and_reorders_pictures_and_their_age_reaches_the_data_set(
    session: tc.Recording, tmp_path: Path
) -> None:
    import pyarrow.parquet as pq

    import teleop_exchange

    back = {"least_delay": 0.1, "loss": 0.2, "kind": "jitter", "jitter.mean": 0.05}
    texts = ["teleop.stages=[network]", *(f"network.back.{name}={value}" for name, value in back.items())]
    report = film(session, tmp_path / "seen", VIEWS[:1], rate=50.0, texts=texts)
    found = messages_of(tc.open_recording(tmp_path / "seen"), IMAGE)
    late = np.array([log - stamp_of(message) for log, message in found]) * 1e-9
    stamps = np.array([stamp_of(message) for _, message in found])
    assert len(found) == report.taken - report.lost
    assert 0.05 < report.lost / report.taken < 0.35
    assert late.min() >= 0.1
    assert 0.12 < late.mean() < 0.18
    assert (np.diff(stamps) < 0).any()
    film(session, tmp_path / "kept", VIEWS[:1], rate=50.0, texts=[*texts, "network.back.packet_order=kept"])
    kept = [stamp_of(message) for _, message in messages_of(tc.open_recording(tmp_path / "kept"), IMAGE)]
    assert sorted(kept) == kept
    assert sorted(stamps) == kept  # the same pictures are lost
    teleop_exchange.export_recording(tmp_path / "seen", tmp_path / "set", "lerobot", video="h264")
    age = np.array(pq.read_table(tmp_path / "set/data/chunk-000/file-000.parquet")["observation.age.front"])
    assert 0.0 <= age.min() < age.max() < 0.3


def test_a_display_with_the_numbers_of_a_camera_shows_the_slave_as_old_as_its_pictures(tmp_path: Path) -> None:
    """One network delays both; a picture is seen until the next one replaces it, half a period on average."""
    rate, screen, back = 25.0, 0.04, 0.1
    settings: dict[str, Any] = {"network.back.least_delay": back, "scene.rate": 100, "scene.camera_rate": int(rate)}
    settings |= {"display.rate": rate, "display.latency": screen, "scene.cameras": ["front:160x120"]}
    remote = tc.run(
        "coarse_box", duration=2.0, robot=str(SCENE), stages=["network", "display"], settings=settings,
        out=tmp_path / "remote",
    )  # fmt: skip
    film(remote, tmp_path / "seen")  # with the cameras and the network of the session
    found = messages_of(tc.open_recording(tmp_path / "seen"), IMAGE)
    late = np.array([log - stamp_of(message) for log, message in found]) * 1e-9
    assert late.min() >= back
    seen = late.mean() + screen + 0.5 / rate
    assert remote.score().value("display.age_mean_ms") == pytest.approx(1e3 * seen, abs=2.0)


def test_what_cannot_be_filmed_is_told_in_one_line(session: tc.Recording, tmp_path: Path) -> None:
    other = tc.run("coarse_box", duration=0.1)
    for recording, views, text in (
        (session, ["nowhere"], "front"),
        (session, ["front:9x9"], "16 to 4096"),
        (session, ["front:axb"], "NAME:WIDTHxHEIGHT"),
        (session, [], "at least one camera"),
        (other, ["front"], "scene/poses"),
    ):
        with pytest.raises(tc.TeleopError, match=text) as error:
            film(recording, tmp_path / "out", views)
        assert "\n" not in str(error.value)
        assert not (tmp_path / "out").exists()
    with pytest.raises(tc.ParameterError, match="loss"):
        film(session, tmp_path / "out", ["front"], texts=["teleop.stages=[network]", "network.back.loss=1.5"])


def test_a_machine_without_egl_says_which_packages_bring_it() -> None:
    code = (
        "from teleop_scene.camera import Camera; from teleop_scene.parameters import View\n"
        "from teleop_scene import models; import teleop_core as tc\n"
        "try: Camera(models.OWN / 'cubes.xml', View('front'))\n"
        "except tc.TeleopError as error: print(error)"
    )
    environment = os.environ | {"PYOPENGL_PLATFORM": "glx"}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, env=environment)
    assert "libegl1" in done.stdout, done.stderr
