"""Guard: decides which requests the page's server answers; a page of another origin must not drive an arm.

Two checks protect the arm. *Token*: the address must contain a secret, which the browser then stores as a cookie. A
name that others lead to this machine (DNS rebinding) has neither. *Origin*: a page of another port of this machine has
the cookie, because all ports of a host share cookies. But browsers state which page opens a WebSocket or fetches a
file, and only the console's page may do this.
"""

import ipaddress
import re
import secrets
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from http.cookies import CookieError, SimpleCookie
from urllib.parse import parse_qs, urlsplit

from teleop_core.base.errors import ParameterError

HEADERS = {
    "Content-Security-Policy": (
        "default-src 'self' data: blob: 'unsafe-inline' 'unsafe-eval'; connect-src 'self' data: "
        "blob: {socket}; frame-ancestors 'none'; form-action 'none'; base-uri 'none'"
    ),
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-store",
}
"""Headers of every page: the page cannot send requests to another host, and no other page can frame it."""


def is_wildcard(host: str) -> bool:
    """Whether an address stands for all network interfaces of this machine."""
    try:
        return ipaddress.ip_address(host).is_unspecified
    except ValueError:
        return host == ""


@dataclass(frozen=True)
class Request:
    """Parts of a request on which the guard decides.

    Attributes:
        path: Path with its query.
        is_socket: Whether the request opens a WebSocket.
        header: Function that returns all values of a header by its name.
        body: Function that reads the body of the request, with at most the given number of bytes.
    """

    path: str
    is_socket: bool
    header: Callable[[str], Sequence[str]]
    body: Callable[[int], bytes] = bytes


class Guard:
    """Decides about requests.

    The ports of Host and Origin are compared with each other, but not with our own port, because a browser may reach
    the page through a forwarded port. A browser cannot be made to send a Host to which it did not connect.

    Args:
        port: Port of the server. It is part of the cookie's name, because all ports of a host share cookies.
        token: Secret that requests must contain.

    Raises:
        ParameterError: The token is empty, or has a character that an address or a cookie must encode.
    """

    def __init__(self, port: int, token: str) -> None:
        if not re.fullmatch(r"[A-Za-z0-9._~-]+", token):
            raise ParameterError("token", token, "letters, digits and . _ ~ - only")
        self._token = token
        self._cookie = f"teleop_console_{port}"

    def refusal(self, request: Request) -> str:
        """Reason why a request is refused; empty if the request is answered."""
        hosts, origins = request.header("Host"), request.header("Origin")
        if len(hosts) != 1:
            return "a request must name one host"
        is_foreign = (request.is_socket or bool(origins)) and not _is_same(origins, hosts[0])
        if is_foreign or not _is_visit(request):
            return "only the console's own page may do this"
        if not self._has_token(request):
            return "the token is missing or wrong: open the address that was printed at the start"
        return ""

    def cookie(self) -> str:
        """Value of Set-Cookie with which the page no longer needs the token in its address."""
        return f"{self._cookie}={self._token}; Path=/; HttpOnly; SameSite=Strict"

    def _has_token(self, request: Request) -> bool:
        given = parse_qs(urlsplit(request.path).query).get("token", [])
        for header in request.header("Cookie"):
            try:
                found = SimpleCookie(header).get(self._cookie)
            except CookieError:
                continue
            given += [found.value] if found else []
        return any(secrets.compare_digest(g.encode(), self._token.encode()) for g in given)


def _is_same(origins: Sequence[str], host: str) -> bool:
    return len(origins) == 1 and origins[0].lower() == f"http://{host.lower()}"


def _is_visit(request: Request) -> bool:
    """Whether a request comes from our own page or from no page, or navigates from another page to ours."""
    sites, modes = request.header("Sec-Fetch-Site"), request.header("Sec-Fetch-Mode")
    return set(sites) <= {"same-origin", "none"} or list(modes) == ["navigate"]
