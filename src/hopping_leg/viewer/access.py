"""Who may use the page: this computer's own browser, from the page's own address, or with a token.

viser serves whoever connects. Every request passes here first, that for the websocket too.
"""

import contextlib
import functools
import hmac
import http
import ipaddress
import secrets
import socket
from collections.abc import Callable, Iterator
from http.cookies import CookieError, SimpleCookie
from typing import Any
from unittest.mock import patch
from urllib.parse import parse_qs, urlsplit

from websockets.datastructures import Headers
from websockets.http11 import Request, Response

_OWN = ("localhost", "127.0.0.1", "::1")
_COOKIE = "hopping_leg"


class Access:
    """Decides about requests; ``token`` is empty where only this computer is served.

    Args:
        host: Address of this computer that is served at.
    """

    def __init__(self, host: str) -> None:
        address = ipaddress.ip_address(socket.gethostbyname(host))
        self.token = "" if address.is_loopback else secrets.token_urlsafe(16)
        self.installed = False

    def refusal(self, request: Request) -> str:
        """Return why a request is refused, or nothing."""
        host = request.headers.get("Host", "")
        origin = request.headers.get("Origin", "")
        upgrade = "Upgrade" in request.headers
        if not self.token and urlsplit(f"//{host}").hostname not in _OWN:
            return "This page is served to this computer alone."
        if (origin or upgrade) and urlsplit(origin).netloc != host:
            return "Another page may not use this one."
        if self.token and not any(self._fits(word) for word in _tokens(request)):
            return "Open the address that `hop view` printed, with its token."
        return ""

    def _fits(self, word: str) -> bool:
        return hmac.compare_digest(word.encode(errors="replace"), self.token.encode())

    def answer(
        self,
        serve_page: Callable[[Any, Request], Response | None],
        connection: Any,  # noqa: ANN401
        request: Request,
    ) -> Response | None:
        """Return the answer to a request, None where the websocket may be opened."""
        try:
            why = self.refusal(request)
        except (ValueError, CookieError):
            why = "This request is none of a browser."
        response = None
        if why:
            body = why.encode()
            length = Headers({"Content-Type": "text/plain", "Content-Length": str(len(body))})
            response = Response(http.HTTPStatus.FORBIDDEN, "Forbidden", length, body)
        else:
            response = serve_page(connection, request)
        if response is not None:
            response.headers["X-Frame-Options"] = "DENY"
            if self.token and not why:
                response.headers["Set-Cookie"] = (
                    f"{_COOKIE}={self.token}; HttpOnly; SameSite=Strict"
                )
        return response

    @contextlib.contextmanager
    def guarded(self) -> Iterator[None]:
        """Let every server of websockets that is made meanwhile ask for permission."""
        from websockets.asyncio import server

        serve = server.serve

        def guarded(*args: Any, process_request: Any, **options: Any) -> Any:  # noqa: ANN401
            self.installed = True
            process = functools.partial(self.answer, process_request)
            return serve(*args, process_request=process, **options)

        with patch.object(server, "serve", guarded):
            yield


def _tokens(request: Request) -> Iterator[str]:
    yield from parse_qs(urlsplit(request.path).query).get("token", [])
    cookie = SimpleCookie(request.headers.get("Cookie", "")).get(_COOKIE)
    if cookie is not None:
        yield cookie.value
