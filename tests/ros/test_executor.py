"""Executor: what it serves, whoever asks, and that it ends with the middleware."""

import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from std_srvs.srv import Trigger

from teleop_core.middleware.platform import PlatformEndedError
from teleop_core.nodes.guest import Guest

pytestmark = pytest.mark.ros


@pytest.fixture
def guest() -> Iterator[Guest]:
    """Node without a session."""
    with Guest("executor_test") as one:
        yield one


def spin_for_ever(executor: Any) -> None:
    """Serve until the middleware has ended."""
    while True:
        executor.spin_once(1.0)


def until(executor: Any, is_done: Any) -> None:
    """Serve until a condition is true, at most 10 s."""
    end = time.monotonic() + 10.0
    while not is_done():
        executor.spin_once(0.1)
        assert time.monotonic() < end


def noting(done: list[str]) -> Callable[[Any, Any], Any]:
    """Service that notes that it was served."""

    def serve(_: Any, answer: Any) -> Any:
        done.append("service")
        return answer

    return serve


def test_services_clients_timers_and_deferred_work_are_served(guest: Guest) -> None:
    executor, done = guest.platform.executor(), list[str]()
    executor.add_node(guest.ros)
    guest.ros.create_service(Trigger, "asked", noting(done))
    client = guest.ros.create_client(Trigger, "asked")
    guest.ros.create_timer(0.02, lambda: done.append("timer"))
    until(executor, client.service_is_ready)
    answer = client.call_async(Trigger.Request())
    threading.Thread(target=lambda: guest.ros.defer(done.append, "work")).start()
    until(executor, lambda: answer.done() and {"service", "timer", "work"} <= set(done))
    executor.shutdown()


def test_an_entity_that_comes_later_is_served_and_one_that_goes_is_not(guest: Guest) -> None:
    executor, done = guest.platform.executor(), list[str]()
    executor.add_node(guest.ros)
    for _ in range(3):
        executor.spin_once(0.01)
    service = guest.ros.create_service(Trigger, "later", noting(done))
    client = guest.ros.create_client(Trigger, "later")
    until(executor, client.service_is_ready)
    client.call_async(Trigger.Request())
    until(executor, lambda: done == ["service"])
    guest.ros.destroy(service)
    until(executor, lambda: not client.service_is_ready())
    executor.shutdown()


def test_an_error_of_a_callback_reaches_the_caller_and_the_next_call_goes_on(guest: Guest) -> None:
    executor, done = guest.platform.executor(), list[str]()
    executor.add_node(guest.ros)

    def fail() -> None:
        raise ValueError("of a callback")

    guest.ros.defer(fail)
    guest.ros.defer(done.append, "work")
    with pytest.raises(ValueError, match="of a callback"):
        until(executor, lambda: done)
    until(executor, lambda: done)
    executor.shutdown()


def test_a_wait_without_limit_ends_when_another_thread_wakes_it_or_ends_the_middleware() -> None:
    guest = Guest("executor_end")
    executor = guest.platform.executor()
    executor.add_node(guest.ros)
    for _ in range(5):  # what discovery and the first look had to serve
        executor.spin_once(0.05)
    threading.Timer(0.2, executor.wake).start()
    begin = time.monotonic()
    executor.spin_once()
    assert time.monotonic() - begin < 5.0
    threading.Timer(0.2, guest.platform.shutdown).start()
    with pytest.raises(PlatformEndedError):
        spin_for_ever(executor)
