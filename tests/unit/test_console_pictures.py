"""Pictures of cameras on the page: as they came, with their age, and in place of the scene."""

import struct
from typing import Any

import pytest

import teleop_core as tc
from page_client import TOKEN
from teleop_console.camera_pictures import SCENE, CameraPictures
from teleop_console.link import ShownArm
from teleop_console.picture_streams import LARGEST, Picture, age_text, camera_name, picture_of
from teleop_console.scene import Scene
from teleop_console.server import ConsoleServer
from teleop_console.surrounding_nodes import PATH

JPEG = b"\xff\xd8\xff\xe0 and so on \xff\xd9"


def message(encoded: bytes, seconds: int = 7, nanoseconds: int = 5, form: bytes = b"jpeg") -> bytes:
    """CDR of a sensor_msgs/CompressedImage, written by hand from its definition."""

    def text(value: bytes) -> bytes:
        body = struct.pack("<I", len(value) + 1) + value + b"\0"
        return body + b"\0" * (-len(body) % 4)

    header = struct.pack("<iI", seconds, nanoseconds) + text(b"front")
    return b"\0\1\0\0" + header + text(form) + struct.pack("<I", len(encoded)) + encoded


@pytest.fixture(scope="module")
def shown() -> Any:
    with ConsoleServer(port=0, token=TOKEN) as opened:
        scene = Scene(opened.viser, (ShownArm("", tc.load_robot("cubes.xml")),))
        yield opened.viser, CameraPictures(opened.viser, scene)


def test_the_bytes_of_a_picture_and_its_stamp_are_taken_as_they_came() -> None:
    assert picture_of(message(JPEG)) == (JPEG, "jpeg", 7_000_000_005)
    assert picture_of(message(b"\x89PNG\r\n", form=b"png")) == (b"\x89PNG\r\n", "png", 7_000_000_005)


@pytest.mark.parametrize(
    "data",
    [message(JPEG)[:20], b"", message(b"GIF89a"), message(JPEG[:2] + bytes(LARGEST)), b"\0\1\0\0" + b"\xff" * 40],
)
def test_what_a_page_cannot_show_is_left_out(data: bytes) -> None:
    assert picture_of(data) is None


def test_a_picture_says_how_old_it_is_in_words() -> None:
    assert [age_text(age) for age in (0.042, 2.34, -0.01)] == ["42 ms old", "2.3 s old", "10 ms ahead of this clock"]
    assert camera_name("/camera/front/image_raw/compressed") == "front"
    assert camera_name("/left/wrist") == "left/wrist"


def test_a_camera_takes_the_place_of_the_scene_until_the_scene_is_chosen_again(shown: Any) -> None:
    server, pictures = shown
    body = server.scene.get_handle_by_name(PATH)
    pictures.draw({})
    assert not pictures._images
    pictures.draw({"front": Picture(JPEG, "jpeg", 1, 0.05)})
    assert pictures._images["front"].label == "front · 50 ms old"
    assert pictures._images["front"]._data == JPEG
    assert pictures._main.options == (SCENE, "front")
    pictures._main.value = "front"
    pictures.draw({"front": Picture(JPEG, "jpeg", 2, 1.5)})
    assert not body.visible
    assert "1.5 S OLD" in pictures._age.content
    pictures._main.value = SCENE
    pictures.draw({"front": Picture(JPEG, "jpeg", 2, 1.6)})
    assert body.visible
    assert pictures._age.content == ""
    assert pictures._images["front"].label == "front · 1.6 s old"
