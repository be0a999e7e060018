"""Only this computer's browser, from the page's own address, steers the leg.

viser serves whoever connects, and any page that this computer's browser shows could. Every request
passes here first, that for the websocket too.
"""

import contextlib
import functools
import http
from collections.abc import Callable, Iterator
from typing import Any
from unittest.mock import patch
from urllib.parse import urlsplit

from websockets.datastructures import Headers
from websockets.http11 import Request, Response

_OWN = ("localhost", "127.0.0.1", "::1")


def refusal(request: Request) -> str:
    """Return why a request is refused, or nothing."""
    host = request.headers.get("Host", "")
    origin = request.headers.get("Origin", "")
    try:
        if urlsplit(f"//{host}").hostname not in _OWN:
            return "This page is served to this computer alone."
        if (origin or "Upgrade" in request.headers) and urlsplit(origin).netloc != host:
            return "Another page may not use this one."
    except ValueError:
        return "This request is none of a browser."
    return ""


def answer(
    serve_page: Callable[[Any, Request], Response | None],
    connection: Any,  # noqa: ANN401
    request: Request,
) -> Response | None:
    """Return the answer to a request, None where the websocket may be opened."""
    why = refusal(request).encode()
    if why:
        length = Headers({"Content-Type": "text/plain", "Content-Length": str(len(why))})
        response: Response | None = Response(http.HTTPStatus.FORBIDDEN, "Forbidden", length, why)
    else:
        response = serve_page(connection, request)
    if response is not None:
        response.headers["X-Frame-Options"] = "DENY"
    return response


@contextlib.contextmanager
def guarded() -> Iterator[None]:
    """Let every server of websockets that is made meanwhile ask here; there must be one."""
    from websockets.asyncio import server

    serve, made = server.serve, list[bool]()

    def asking(*args: Any, process_request: Any, **options: Any) -> Any:  # noqa: ANN401
        made.append(True)
        process = functools.partial(answer, process_request)
        return serve(*args, process_request=process, **options)

    with patch.object(server, "serve", asking):
        yield
    assert made, "this version of viser would serve everyone"
