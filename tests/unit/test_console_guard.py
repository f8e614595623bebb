"""Guard: a page from elsewhere, a name that was made to lead here, a wrong token get nothing."""

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from teleop_console.commands import show_code
from teleop_console.guard import Guard, Request, is_wildcard
from teleop_core.commands.cli import main


def ask(guard: Guard, path: str = "/", is_socket: bool = False, **headers: str | list[str]) -> str:
    """Why a request with some headers is refused; lists are headers that come several times."""
    told = {"host": "localhost:8080"} | {n.replace("_", "-"): v for n, v in headers.items()}
    given = {name: [value] if isinstance(value, str) else value for name, value in told.items()}
    return guard.refusal(Request(path, is_socket, lambda name: given.get(name.lower(), [])))


SECRET = Guard(8080, "secret")
OURS = "/?token=secret"


@pytest.mark.parametrize("host", ["localhost:8080", "127.0.0.1:8080", "[::1]:8080", "LOCALHOST", "robot.local:8080"])
def test_own_page_is_answered_by_any_name_that_leads_here(host: str) -> None:
    assert not ask(SECRET, OURS, host=host)
    assert not ask(SECRET, OURS, host=host, is_socket=True, origin=f"http://{host}")


@pytest.mark.parametrize("host", ["evil.example:8080", "localhost.evil.example", "127.0.0.2", "", "["])
def test_page_of_a_name_that_others_lead_here_has_no_token(host: str) -> None:
    for path in ("/", "/stop", "/?token=", "/?token=guess", "/?token=s", "/?token=secre", "/?token=secrets"):
        assert "token" in ask(SECRET, path, host=host, is_socket=True, origin=f"http://{host}")
        assert "token" in ask(SECRET, path, host=host)


@pytest.mark.parametrize("host", [["localhost:8080", "evil.example"], []])
def test_request_under_two_names_or_none_is_refused(host: list[str]) -> None:
    assert "one host" in ask(SECRET, OURS, host=host, is_socket=True, origin="http://localhost:8080")
    assert "one host" in ask(SECRET, OURS, host=host)


@pytest.mark.parametrize(
    "origin",
    ["http://evil.example", "http://localhost:8081", "http://localhost", "https://localhost:8080",
     "http://127.0.0.1:8080", "http://localhost:8080.evil.example", "null", "file://", "",
     ["http://localhost:8080", "http://evil.example"]],
)  # fmt: skip
def test_page_of_another_origin_is_refused(origin: str | list[str]) -> None:
    assert "own page" in ask(SECRET, OURS, is_socket=True, origin=origin)
    assert "own page" in ask(SECRET, OURS, origin=origin)


@pytest.mark.parametrize("site", ["cross-site", "same-site"])
def test_what_another_page_fetches_is_refused_but_a_link_to_ours_is_followed(site: str) -> None:
    for mode in ("no-cors", "cors", "websocket"):
        assert "own page" in ask(SECRET, OURS, sec_fetch_site=site, sec_fetch_mode=mode)
    assert not ask(SECRET, OURS, sec_fetch_site=site, sec_fetch_mode="navigate")
    assert not ask(SECRET, OURS, sec_fetch_site="same-origin", sec_fetch_mode="cors")


def test_socket_needs_an_origin_and_a_page_none() -> None:
    assert not ask(SECRET, OURS)
    assert ask(SECRET, OURS, is_socket=True)


@given(st.text(max_size=30))
def test_no_text_but_the_token_is_taken_for_it(text: str) -> None:
    if text != "secret":
        assert ask(SECRET, path=f"/?token={text.replace('&', '').replace('#', '')}x")
    assert not ask(SECRET, path="/?token=secret")


def test_token_in_the_cookie_is_as_good_as_in_the_address() -> None:
    cookie = SECRET.cookie()
    assert "HttpOnly" in cookie
    assert "SameSite=Strict" in cookie
    pair = cookie.split(";", maxsplit=1)[0]
    assert not ask(SECRET, cookie=f"other=1; {pair}; more=2")
    assert not ask(SECRET, is_socket=True, origin="http://localhost:8080", cookie=pair)
    assert ask(SECRET, cookie=pair + "x")
    assert ask(SECRET, cookie=pair.replace("8080", "8081"))
    assert ask(SECRET, cookie='"broken')
    assert ask(SECRET)


def test_right_token_does_not_help_a_page_from_elsewhere() -> None:
    told: dict[str, Any] = {"path": "/?token=secret", "is_socket": True}
    assert ask(SECRET, origin="http://evil.example", **told)


def test_wildcard_is_told_from_other_addresses() -> None:
    assert all(map(is_wildcard, ("0.0.0.0", "::", "")))
    assert not any(map(is_wildcard, ("127.0.0.1", "robot")))


def test_code_for_a_phone_is_that_of_the_address_and_needs_an_address_that_a_phone_reaches(
    capsys: pytest.CaptureFixture[str],
) -> None:
    for words in ([], ["--host", "localhost"], ["--host", "127.0.0.2"]):
        assert main(["console", "--no-browser", "--qr", *words]) == 2
        assert "--host 0.0.0.0" in capsys.readouterr().err
    url = "http://192.0.2.7:8080/?token=secret"
    show_code(url)
    told, *rows = capsys.readouterr().out.splitlines()
    assert told == f"for a phone: {url}"
    assert len(rows) > 10
    assert len({len(row) for row in rows}) == 1
