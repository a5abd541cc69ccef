"""Who may talk to the page: only who was given its address, and by no other name and from no other site."""

from __future__ import annotations

import asyncio
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest

from stridor.app.page.guard import LARGEST_BODY, Guard

TOKEN, PORT = "right-token", 4711
HOST = (b"host", b"127.0.0.1:4711")


def asked(path: str, *headers: tuple[bytes, bytes], kind: str = "http", body: int = 0) -> list[dict[str, Any]]:
    """What comes back for a request of ``body`` bytes; the app behind answers 200 to all of what it is given."""
    sent: list[dict[str, Any]] = []
    chunks = [{"type": "http.request", "body": b"x" * 1_000_000, "more_body": True}] * (body // 1_000_000)

    async def receive() -> dict[str, Any]:
        if kind == "websocket":
            return {"type": "websocket.connect"}
        return chunks.pop() if chunks else {"type": "http.request", "body": b"", "more_body": False}

    async def send(message: Any) -> None:
        sent.append(dict(message))

    async def app(scope: Any, receive: Any, send: Any) -> None:
        if scope["type"] == "websocket":
            await send({"type": "websocket.accept"})
            return
        more = True
        while more:
            message = await receive()
            more = message["type"] == "http.request" and message.get("more_body", False)
        status = 400 if message["type"] == "http.disconnect" else 200
        await send({"type": "http.response.start", "status": status, "headers": []})
        await send({"type": "http.response.body", "body": b"in"})

    scope = {"type": kind, "path": path, "headers": list(headers)}
    with ThreadPoolExecutor(1) as other:  # in this thread a browser of other tests may have its event loop
        other.submit(asyncio.run, Guard(app, TOKEN, PORT)(scope, receive, send)).result()
    return sent


def status(*given: Any, **more: Any) -> int:
    return asked(*given, **more)[0]["status"]


def test_who_has_the_address_is_let_in():
    assert status(f"/{TOKEN}/", HOST) == 200
    assert status(f"/{TOKEN}/x", (b"host", b"localhost:4711"), (b"origin", b"http://localhost:4711")) == 200
    assert asked(f"/{TOKEN}/ws", HOST, (b"origin", b"http://127.0.0.1:4711"), kind="websocket")[0]["type"] == "websocket.accept"


@pytest.mark.parametrize("path", ["/", "/wrong/", f"/{TOKEN}x/", f"/a/{TOKEN}/", f"/{TOKEN.upper()}/"])
@pytest.mark.parametrize("kind", ["http", "websocket"])
def test_without_the_token_nothing_is_told(path: str, kind: str):
    sent = asked(path, HOST, kind=kind)
    assert sent[0].get("status", sent[0].get("code")) in (403, 1008)
    assert not any(m["type"] == "websocket.accept" or m.get("body") == b"in" for m in sent)


HOSTS = [(b"host", b"evil.example"), (b"host", b"127.0.0.1:4712"), (b"host", b"127.0.0.1"), (b"x-host", b"127.0.0.1:4711")]


@pytest.mark.parametrize("header", HOSTS)
@pytest.mark.parametrize("kind", ["http", "websocket"])
def test_under_another_name_it_does_not_answer(header: tuple[bytes, bytes], kind: str):
    sent = asked(f"/{TOKEN}/", header, kind=kind)
    assert sent[0].get("status", sent[0].get("code")) in (403, 1008)


def test_two_hosts_are_none():
    assert status(f"/{TOKEN}/", HOST, (b"host", b"evil.example")) == 403


@pytest.mark.parametrize("origin", [b"http://evil.example", b"null", b"http://127.0.0.1:8888", b"https://127.0.0.1:4711"])
@pytest.mark.parametrize("kind", ["http", "websocket"])
def test_other_sites_are_refused(origin: bytes, kind: str):
    sent = asked(f"/{TOKEN}/", HOST, (b"origin", origin), kind=kind)
    assert sent[0].get("status", sent[0].get("code")) in (403, 1008)


def test_what_is_sent_is_limited_whatever_it_says_of_its_length():
    said = (b"content-length", str(LARGEST_BODY + 1).encode())
    assert status(f"/{TOKEN}/", HOST, said) == 413
    assert status(f"/{TOKEN}/", HOST, (b"content-length", b"-5")) == 413
    assert status(f"/{TOKEN}/", HOST, body=5_000_000) == 200
    assert status(f"/{TOKEN}/", HOST, body=8_000_000) == 400


def test_no_other_page_may_show_it_in_a_frame():
    headers = dict(asked(f"/{TOKEN}/", HOST)[0]["headers"])
    assert b"frame-ancestors 'none'" in headers[b"content-security-policy"]
    assert headers[b"referrer-policy"] == b"no-referrer"  # the token is in the address
