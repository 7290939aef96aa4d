"""The web server: the page, its few files, and one WebSocket for each open page."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import socket
from collections.abc import AsyncIterator, Callable
from importlib import resources
from typing import Any

import uvicorn
from starlette.applications import Starlette
from starlette.requests import HTTPConnection, Request
from starlette.responses import PlainTextResponse, RedirectResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect

from tracer.viewer.hub import Hub
from tracer.viewer.messages import LONGEST
from tracer.viewer.safety import COOKIE, HEADERS, Guard

KINDS = {
    ".html": "text/html",
    ".css": "text/css",
    ".js": "text/javascript",
    ".svg": "image/svg+xml",
}

PATIENCE = 2
"""Seconds that open pages have when the viewer ends."""

logger = logging.getLogger("tracer.viewer")


def page_files() -> dict[str, tuple[bytes, str]]:
    """The files of the page, by name: content and kind. Nothing else can be asked for."""
    files: dict[str, tuple[bytes, str]] = {}
    for file in (resources.files("tracer.viewer") / "page").iterdir():
        kind = KINDS.get("." + file.name.rpartition(".")[2])
        if kind is not None:
            files[file.name] = file.read_bytes(), kind
    return files


def application(make_hub: Callable[[], Hub], guard: Guard) -> Starlette:
    """The viewer as a web application; the hub is made and its renderer started when that starts."""
    files = page_files()
    state: dict[str, Hub] = {}

    @contextlib.asynccontextmanager
    async def lifespan(_: Starlette) -> AsyncIterator[None]:
        hub = state["hub"] = make_hub()
        hub.renderer.start()
        yield
        await asyncio.to_thread(hub.renderer.stop)

    async def page(request: Request) -> Response:
        token = request.query_params.get("token")
        if token is not None and not guard.loopback:
            cookie = guard.exchange(token)
            if cookie is not None:
                answer = RedirectResponse("/", status_code=303, headers=HEADERS)
                answer.set_cookie(COOKIE, cookie, httponly=True, samesite="strict")
                return answer
        refusal = _objection(guard, request)
        if refusal is not None:
            return PlainTextResponse(refusal, status_code=403, headers=HEADERS)
        name = request.path_params.get("name", "index.html")
        if name not in files:
            return PlainTextResponse("there is no such file", status_code=404, headers=HEADERS)
        content, kind = files[name]
        return Response(content, media_type=kind, headers=HEADERS)

    async def talk(socket: WebSocket) -> None:
        refusal = _objection(guard, socket)
        if refusal is None and "origin" not in socket.headers:
            refusal = "it names no origin, as every page does"
        if refusal is not None:
            logger.warning("a connection was refused: %s", refusal)
            await socket.close(code=1008)
            return
        await socket.accept()
        await _converse(state["hub"], socket)

    return Starlette(
        routes=[Route("/", page), Route("/{name}", page), WebSocketRoute("/talk", talk)], lifespan=lifespan
    )


def _objection(guard: Guard, connection: HTTPConnection) -> str | None:
    return guard.objection(connection.headers, connection.cookies.get(COOKIE))


async def _converse(hub: Hub, socket: WebSocket) -> None:
    """Hears and serves a page until it is closed."""
    page = hub.join()
    sender = asyncio.create_task(_quietly(page.serve(socket.send_text, socket.send_bytes)))
    try:
        while True:
            message = await socket.receive()
            if message["type"] == "websocket.disconnect":
                return
            hub.hear(page, message.get("text") or message.get("bytes") or "")
    except WebSocketDisconnect:
        pass
    finally:
        hub.leave(page)
        sender.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await sender


async def _quietly(sending: Any) -> None:
    """A page that is closed while something is sent to it is no error."""
    with contextlib.suppress(WebSocketDisconnect, RuntimeError):
        await sending


def run(make_hub: Callable[[], Hub], guard: Guard, listening: socket.socket) -> None:
    """Serves until a signal ends it."""
    config = uvicorn.Config(
        application(make_hub, guard),
        log_config=None,
        access_log=False,
        server_header=False,
        ws="websockets-sansio",
        ws_max_size=2 * LONGEST,
        ws_per_message_deflate=False,
        timeout_graceful_shutdown=PATIENCE,
    )
    uvicorn.Server(config).run(sockets=[listening])


def listen(host: str, port: int | None, usual: int) -> socket.socket:
    """A socket at a port, or at the usual one, or, where that is taken, at any free one; raises `OSError`."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    for attempt in (usual, 0) if port is None else (port,):
        listening = socket.socket(family, socket.SOCK_STREAM)
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listening.bind((host, attempt))
            listening.listen(64)
        except OSError:
            listening.close()
            if port is not None or attempt == 0:
                raise
        else:
            return listening
    raise AssertionError("either a socket or an error")
