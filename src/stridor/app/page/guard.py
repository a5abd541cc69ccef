"""Who may talk to the page: only a browser of this computer that was given its address.

An ASGI layer around all that is served, for requests and web sockets alike. The token is the first part of every path.
"""

from __future__ import annotations

import hmac
import secrets
from collections.abc import Awaitable, Callable, MutableMapping
from typing import Any

Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]
App = Callable[[Scope, Receive, Send], Awaitable[None]]

LARGEST_BODY = 6_000_000  # bytes of a request: an upload with what is around it
POLICY = (
    "default-src 'self'; script-src 'self' 'unsafe-inline' 'unsafe-eval' blob:; style-src 'self' 'unsafe-inline'; "
    "img-src 'self' data: blob:; font-src 'self' data:; media-src 'self' blob:; worker-src 'self' blob:; "
    "connect-src 'self' ws://127.0.0.1:* ws://localhost:*; object-src 'none'; base-uri 'self'; form-action 'self'; "
    "frame-ancestors {ancestors}"
)


def new_token() -> str:
    """Letters that nobody can guess."""
    return secrets.token_urlsafe(24)


class Guard:
    """Lets through to ``app`` what has the token in its path, this computer as its host, and no foreign origin.

    framed: whether pages of this computer may show it in a frame, as notebooks do.
    """

    def __init__(self, app: App, token: str, port: int, *, framed: bool = False) -> None:
        self.app = app
        self.token = token
        self.framed = framed
        self.hosts = {f"{name}:{port}" for name in ("127.0.0.1", "localhost")}
        self.origins = {f"http://{host}" for host in self.hosts}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer, or refuse with a sentence."""
        if scope["type"] not in ("http", "websocket"):
            await self.app(scope, receive, send)
        elif reason := self.refusal(scope):
            await _refuse(scope, receive, send, *reason)
        else:
            await self.app(scope, _limited(receive), self._with_headers(send))

    def refusal(self, scope: Scope) -> tuple[int, str] | None:
        """Status and sentence for what is not let through."""
        headers = _headers(scope)
        if headers.get(b"host", b"").decode("latin-1").lower() not in self.hosts:
            return 403, "This page answers to 127.0.0.1 and localhost only."
        origin = headers.get(b"origin")
        if origin is not None and origin.decode("latin-1").lower() not in self.origins:
            return 403, "This page is not for other sites."
        given = str(scope.get("path", "")).lstrip("/").partition("/")[0]
        if not hmac.compare_digest(given.encode(), self.token.encode()):
            return 403, "The address lacks the token that stridor printed with it: copy it as a whole."
        length = headers.get(b"content-length", b"0")
        if not length.isdigit() or int(length) > LARGEST_BODY:
            return 413, f"At most {LARGEST_BODY / 1e6:g} MB are taken."
        return None

    def _with_headers(self, send: Send) -> Send:
        ancestors = "'self' http://127.0.0.1:* http://localhost:*" if self.framed else "'none'"
        extra = [
            (b"referrer-policy", b"no-referrer"),
            (b"x-content-type-options", b"nosniff"),
            (b"content-security-policy", POLICY.format(ancestors=ancestors).encode()),
        ]

        async def sending(message: MutableMapping[str, Any]) -> None:
            if message["type"] == "http.response.start":
                message["headers"] = [*message.get("headers", ()), *extra]
            await send(message)

        return sending


def _headers(scope: Scope) -> dict[bytes, bytes]:
    """Headers by name; one that comes twice counts as none, so that it cannot mean two things."""
    found: dict[bytes, bytes] = {}
    for name, value in scope.get("headers", ()):
        found[name.lower()] = b"\x00" if name.lower() in found else value
    return found


def _limited(receive: Receive) -> Receive:
    """Receives no more than a request may hold, whatever it said about its length."""
    taken = 0

    async def receiving() -> MutableMapping[str, Any]:
        nonlocal taken
        message = await receive()
        if message["type"] == "http.request":
            taken += len(message.get("body", b""))
            if taken > LARGEST_BODY:
                return {"type": "http.disconnect"}
        return message

    return receiving


async def _refuse(scope: Scope, receive: Receive, send: Send, status: int, words: str) -> None:
    if scope["type"] == "websocket":
        await receive()
        await send({"type": "websocket.close", "code": 1008, "reason": words})
        return
    text = words.encode()
    headers = [(b"content-type", b"text/plain; charset=utf-8"), (b"content-length", str(len(text)).encode())]
    await send({"type": "http.response.start", "status": status, "headers": headers})
    await send({"type": "http.response.body", "body": text})
