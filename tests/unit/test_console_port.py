"""Port: a taken one is refused with the process that has it and one that is free."""

import gc
import os
import re
import socket
import threading
from contextlib import suppress

import pytest

from page_client import TOKEN
from present import present
from teleop_console.server import ConsoleServer, free_port, listen, owner
from teleop_core.base.errors import SessionError


def test_taken_port_is_refused_with_its_owner_and_one_that_is_free() -> None:
    with listen("127.0.0.1", 0) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(SessionError) as refused:
            listen("127.0.0.1", port)
        assert f"port {port} is taken by" in str(refused.value)
        assert f"(process {os.getpid()})" in str(refused.value)
        free = int(present(re.search(r"(\d+) is free", str(refused.value))).group(1))
        assert free != port
        listen("127.0.0.1", free).close()


def test_port_that_all_addresses_have_is_taken_on_the_loopback_too() -> None:
    with listen("0.0.0.0", 0) as taken, pytest.raises(SessionError):
        listen("127.0.0.1", taken.getsockname()[1])


def test_port_is_free_again_at_once_when_its_server_has_ended() -> None:
    port = free_port()
    for _ in range(2):
        with listen("127.0.0.1", port), socket.create_connection(("127.0.0.1", port)):
            pass


def test_server_that_ends_while_others_come_in_leaves_no_connection_open() -> None:
    for _ in range(4):
        with ConsoleServer(0, token=TOKEN) as server:
            came, ends = threading.Barrier(3), threading.Event()
            guests = [threading.Thread(target=come_in, args=(server.port, came, ends)) for _ in range(2)]
            for guest in guests:
                guest.start()
            came.wait(30)
        ends.set()
        for guest in guests:
            guest.join()
    gc.collect()  # tells what is still open, which fails a test here


def come_in(port: int, came: threading.Barrier, ends: threading.Event) -> None:
    """Come and go; meet the others after the tenth time."""
    times = 0
    while not ends.is_set():
        with suppress(OSError):
            socket.create_connection(("127.0.0.1", port), timeout=1.0).close()
        times += 1
        if times == 10:
            came.wait(30)


def test_owner_that_cannot_be_known_is_another_process() -> None:
    assert owner(free_port()) == "another process"
