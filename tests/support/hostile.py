"""Hostile: what pages may do to harm a session, as functions of a watching and a driving page.

Each is done over a real WebSocket; none moves the arm, or keeps the stop from stopping.
"""

import math
import socket
from contextlib import ExitStack, suppress
from typing import Any

import msgspec
import pytest
from websockets.exceptions import InvalidStatus
from websockets.frames import Frame, Opcode

from browser import until
from page_client import CAMERA, TOKEN, PageClient, ask

NAN, INF = math.nan, math.inf
HERE, LEVEL = [0.0, -0.06, -0.08], [1.0, 0.0, 0.0, 0.0]
BUTTONS = ("Initialize", "Start", "Pause", "Home", "Release", "Save as")


def every(page: PageClient) -> list[str]:
    """All elements of a page."""
    return list(page.elements.values())


def takes_the_callbacks_of_all_elements_away(watcher: PageClient, driver: PageClient) -> None:
    for uuid in every(watcher):
        watcher.set(uuid, update_cb=[])


def drags_to_a_place_of_one_number(watcher: PageClient, driver: PageClient) -> None:
    watcher.drag(position=[1.0])


def drags_what_another_page_drives(watcher: PageClient, driver: PageClient) -> None:
    name = watcher.gizmos[0]
    watcher.say({"type": "TransformControlsDragStartMessage", "name": name, "owner": ""})
    for _ in range(20):
        watcher.drag()
    watcher.say({"type": "TransformControlsDragEndMessage", "name": name, "owner": ""})


def presses_the_buttons_of_the_driver(watcher: PageClient, driver: PageClient) -> None:
    for label in BUTTONS:
        watcher.click(label)


def hides_disables_and_renames_elements(watcher: PageClient, driver: PageClient) -> None:
    for uuid in every(watcher)[:20]:
        watcher.set(uuid, disabled=True)
        watcher.set(uuid, visible=False)
        watcher.set(uuid, label="all is well", order=-100.0)


def reaches_into_the_server(watcher: PageClient, driver: PageClient) -> None:
    for name in ("removed", "uuid", "gui_api", "props", "sync_cb", "__class__", "is_button"):
        watcher.set(watcher.elements["Take control"], **{name: None})
        watcher.set(watcher.elements["Take control"], value=True, **{name: "x"})


def changes_what_is_shown_to_all(watcher: PageClient, driver: PageClient) -> None:
    for label in ("dark", "paths", "name", "show"):
        for value in (True, "x", 1):
            watcher.set(watcher.elements[label], value=value)


def uses_the_keys_of_the_driver(watcher: PageClient, driver: PageClient) -> None:
    for uuid in watcher.commands.values():
        watcher.say({"type": "CommandTriggerMessage", "uuid": uuid})


def looks_from_nowhere(watcher: PageClient, driver: PageClient) -> None:
    wrong: dict[str, Any]
    for wrong in (
        {"position": [NAN, 0, 0]}, {"position": [1.0]}, {"wxyz": [0, 0, 0, 0]}, {"fov": 0},
        {"image_height": 0}, {"image_width": -5}, {"look_at": [INF, 0, 0]}, {"near": "x"},
        {"up_direction": None}, {"position": [1e308] * 3}, {"camera_cb": []},
    ):  # fmt: skip
        watcher.say(CAMERA | wrong)


def gives_values_of_every_wrong_type(watcher: PageClient, driver: PageClient) -> None:
    wrong: Any
    wrong = ([], {}, [[1]], None, NAN, INF, 2**63, -(2**63), "x" * 5000, b"bytes", {"a": [1] * 100})
    for page in (watcher, driver):
        for label in ("dark", "name", "show", "Take control"):
            for value in wrong:
                page.set(page.elements[label], value=value)


def updates_what_does_not_exist(watcher: PageClient, driver: PageClient) -> None:
    uuid: Any
    for uuid in ("", "nothing", "x" * 10_000, "../..", None, 7):
        watcher.set(uuid, value=True)
        driver.say({"type": "CommandTriggerMessage", "uuid": uuid})
        driver.say({"type": "TransformControlsUpdateMessage", "name": uuid, "position": HERE, "wxyz": LEVEL})


def uploads_files(watcher: PageClient, driver: PageClient) -> None:
    uuid = watcher.elements["name"]
    watcher.say({"type": "FileTransferStartUpload", "source_component_uuid": uuid,
                 "transfer_uuid": "t", "filename": "/etc/passwd", "mime_type": "x",
                 "part_count": 1000, "size_bytes": 180_000_000})  # fmt: skip
    for part in range(40):
        watcher.say({"type": "FileTransferPart", "source_component_uuid": uuid, "part_index": part,
                     "transfer_uuid": "t", "content": bytes(200_000)})  # fmt: skip


def speaks_as_the_server(watcher: PageClient, driver: PageClient) -> None:
    for message in (
        {"type": "RunJavascriptMessage", "source": "alert(1)"},
        {"type": "ResetGuiMessage"},
        {"type": "GuiRemoveMessage", "uuid": watcher.elements["Take control"]},
        {"type": "RemoveSceneNodeMessage", "name": "/arm", "owner": ""},
        {"type": "SetPositionMessage", "name": watcher.gizmos[0], "position": HERE, "owner": ""},
        {"type": "ThemeConfigurationMessage"},
        {"type": "ShareUrlRequest"},
    ):
        watcher.say(message)


def uses_what_the_console_does_not(watcher: PageClient, driver: PageClient) -> None:
    uuid = watcher.elements["Take control"]
    ray = {"ray_origin": [0, 0, 0], "ray_direction": [0, 0, 1], "modifier": None}
    for page in (watcher, driver):
        for message in (
            {"type": "GuiButtonHoldMessage", "uuid": uuid, "frequency": 1e9},
            {"type": "GuiFormSubmitMessage", "uuid": uuid},
            {"type": "GuiFormDirtyMessage", "uuid": uuid},
            {"type": "SceneNodeClickMessage", "name": "/arm", "instance_index": None, "screen_pos": [0, 0], **ray},
            {"type": "ScenePointerMessage", "event_type": "click", "screen_pos": [[0, 0]], **ray},
            {"type": "GetRenderResponseMessage", "payload": b"x" * 1000, "render_uuid": "guess"},
        ):
            page.say(message)


def sends_what_is_no_message(watcher: PageClient, driver: PageClient) -> None:
    drag = msgspec.msgpack.encode({"type": "TransformControlsUpdateMessage", "position": HERE})
    for page in (watcher, driver):
        for data in (b"", b"\xc1", b"\x91" * 50_000, b"\xff" * 100, drag[:-3], b"\xdf\xff\xff\xff\xff"):
            page.raw(data)
        value: Any
        for value in (None, [], 7, {}, {"type": 3}, {"type": ["x"]}, [[[[]]]]):
            page.say(value)
        page.raw("a text")


def says_one_type_and_means_another(watcher: PageClient, driver: PageClient) -> None:
    # A map with the same key twice: parsers differ in which of them counts.
    items = [
        ("type", "ViewerCameraMessage"),
        ("type", "GuiUpdateMessage"),
        ("uuid", watcher.elements["Start"]),
        ("updates", {"value": True}),
    ]
    for order in (items, items[::-1], items[1:2] + items[2:] + items[:1]):
        parts = [msgspec.msgpack.encode(part) for pair in order for part in pair]
        watcher.raw(bytes([0x80 + len(order)]) + b"".join(parts))


def sends_one_message_that_is_too_large(watcher: PageClient, driver: PageClient) -> None:
    watcher.raw(bytes(9_000_000))


def floods_with_drags(watcher: PageClient, driver: PageClient) -> None:
    for _ in range(20_000):
        watcher.drag()
        if watcher.is_cut:
            return
    # On a busy machine all of them are on the way before the server comes to read the first.
    until(lambda: watcher.is_cut, "the flood of 20,000 messages is cut off")


def floods_with_pings(watcher: PageClient, driver: PageClient) -> None:
    ping = Frame(Opcode.PING, b"x").serialize(mask=True)
    with suppress(OSError):
        for _ in range(100):
            watcher.socket.socket.sendall(ping * 1000)


def begins_a_message_that_never_ends(watcher: PageClient, driver: PageClient) -> None:
    first = Frame(Opcode.BINARY, bytes(100_000), fin=False).serialize(mask=True)
    more = Frame(Opcode.CONT, bytes(100_000), fin=False).serialize(mask=True)
    with suppress(OSError):
        for part in [first] + [more] * 40:
            watcher.socket.socket.sendall(part)


def opens_sockets_and_says_nothing(watcher: PageClient, driver: PageClient) -> None:
    with ExitStack() as stack:
        for begin in (b"", b"GET / HT", b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n"):
            for _ in range(60):
                opened = stack.enter_context(socket.create_connection(("127.0.0.1", watcher.port)))
                opened.sendall(begin)
        assert watcher.ask("/alive")[0] == 200
        assert driver.ask("/stop")[0] == 204


def opens_pages_that_never_come_up(watcher: PageClient, driver: PageClient) -> None:
    pages = []
    for _ in range(40):
        with suppress(OSError, EOFError):
            pages.append(PageClient(watcher.port, comes_up=False))
    assert driver.ask("/stop")[0] == 204
    for page in pages:
        page.close()


def comes_and_goes(watcher: PageClient, driver: PageClient) -> None:
    for _ in range(40):
        PageClient(watcher.port, comes_up=False).close()


def leaves_in_the_middle_of_a_message(watcher: PageClient, driver: PageClient) -> None:
    frame = Frame(Opcode.BINARY, bytes(1000)).serialize(mask=True)
    watcher.socket.socket.sendall(frame[:500])
    watcher.close()


def has_no_token(watcher: PageClient, driver: PageClient) -> None:
    for token in ("", "guess", TOKEN[:-1], TOKEN.upper(), TOKEN + "x"):
        for path in ("/", "/alive", "/stop", "/strip?begin=0&end=1&pixels=100", "/page?begin=1"):
            assert ask(watcher.port, path, token=token, Teleop_Page="new")[0] == 403
            assert ask(watcher.port, path, Teleop_Page="new", Cookie=f"teleop_console_1={TOKEN}")[0] == 403
        for _ in range(20):
            with pytest.raises(InvalidStatus):
                PageClient(watcher.port, comes_up=False, token=token)


def keeps_another_page_alive(watcher: PageClient, driver: PageClient) -> None:
    port = watcher.port
    assert ask(port, "/alive?page=0")[0] == 403
    assert ask(port, "/alive", Teleop_Page="guess")[1]["drives"] is False
    assert ask(port, "/alive", Teleop_Page="new", Origin="http://evil.example")[0] == 403
    for site in ("cross-site", "same-site"):
        told = {"Sec_Fetch_Site": site, "Sec_Fetch_Mode": "no-cors"}
        assert ask(port, "/alive", Teleop_Page="new", **told)[0] == 403
        assert ask(port, "/stop", Teleop_Page="new", **told)[0] == 403


def reads_files(watcher: PageClient, driver: PageClient) -> None:
    for path in ("/../server.py", "/%2e%2e/%2e%2e/_viser.py", "/..\\..\\_viser.py", "//etc/passwd"):
        status, body = ask(watcher.port, path)
        assert status in {403, 404}, path
        assert b"import" not in body


def drives_to_where_no_stylus_is(watcher: PageClient, driver: PageClient) -> None:
    for position in ([NAN, 0, 0], [0, INF, 0], [1.0], [0] * 4, [1e308] * 3, [5, 0, 0], "xyz", None):
        driver.drag(position=position)  # type: ignore[arg-type]
    for turn in ([0, 0, 0, 0], [NAN, 0, 0, 0], [1, 0, 0], [2, 0, 0, 0], [1] * 5, {"w": 1}):
        driver.drag(wxyz=turn)  # type: ignore[arg-type]
    driver.drag(owner="another")
    driver.drag(owner=3)
    driver.drag(more=1)


def moves_time_and_asks_the_strip_for_too_much(watcher: PageClient, driver: PageClient) -> None:
    assert ask(watcher.port, "/strip?begin=0&end=1&pixels=100")[0] == 403  # of no page
    for path in ("/time?seek=1", "/time?now=1", "/over?name=..%2F..", "/over?name="):
        assert watcher.ask(path)[0] == 409, path
    for words in ("begin=0&end=1&pixels=1e9", "begin=nan&end=1&pixels=9", "begin=0&end=1&pixels=9&name=/etc/passwd"):
        assert driver.ask(f"/strip?{words}")[0] == 409, words
    for path in ("/time?seek=inf", "/over?name=..", "/timeline?find=" + "x" * 5000, "/strip?" + "name=x&" * 90):
        assert driver.ask(path)[0] == 409, path


HOSTILE = (
    has_no_token,
    takes_the_callbacks_of_all_elements_away, drags_to_a_place_of_one_number,
    drags_what_another_page_drives, presses_the_buttons_of_the_driver,
    hides_disables_and_renames_elements, reaches_into_the_server, changes_what_is_shown_to_all,
    uses_the_keys_of_the_driver, looks_from_nowhere, gives_values_of_every_wrong_type,
    updates_what_does_not_exist, uploads_files, speaks_as_the_server,
    uses_what_the_console_does_not, sends_what_is_no_message, says_one_type_and_means_another,
    sends_one_message_that_is_too_large, floods_with_drags, floods_with_pings,
    begins_a_message_that_never_ends, opens_sockets_and_says_nothing,
    opens_pages_that_never_come_up, comes_and_goes, leaves_in_the_middle_of_a_message,
    keeps_another_page_alive, reads_files, moves_time_and_asks_the_strip_for_too_much, drives_to_where_no_stylus_is,
)  # fmt: skip
"""All that must not even be noticed by the arm."""

STOPPING = (opens_sockets_and_says_nothing, opens_pages_that_never_come_up)
"""Those of them in which somebody presses the stop."""
