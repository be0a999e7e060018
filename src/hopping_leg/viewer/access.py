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


def answer(
    serve_page: Callable[[Any, Request], Response | None],
    connection: Any,  # noqa: ANN401
    request: Request,
) -> Response | None:
    """Return the answer to a request, None where the websocket may be opened."""
    if _is_own(request):
        response = serve_page(connection, request)
    else:
        said = b"This page is served to this computer alone, and to no other page."
        length = Headers({"Content-Type": "text/plain", "Content-Length": str(len(said))})
        response = Response(http.HTTPStatus.FORBIDDEN, "Forbidden", length, said)
    if response is not None:
        response.headers["X-Frame-Options"] = "DENY"
    return response


def _is_own(request: Request) -> bool:
    """Tell whether this computer's browser asks, for a page of our own."""
    host, origin = (request.headers.get(name, "") for name in ("Host", "Origin"))
    try:
        same = urlsplit(origin).netloc == host or not (origin or "Upgrade" in request.headers)
        return same and urlsplit(f"//{host}").hostname in _OWN
    except ValueError:  # none of a browser's
        return False


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
