"""A pipe's number belongs to whatever file is opened next: nobody may read it or write to it any more then."""

from __future__ import annotations

import multiprocessing
import os
import threading
from pathlib import Path

import pytest

from stridor.app.page.own_end import GONE, OwnEnd


def test_a_pipe_that_is_hung_up_keeps_its_number_until_its_reader_has_heard(tmp_path: Path):
    ours, theirs = multiprocessing.Pipe()
    number, end = ours.fileno(), OwnEnd(ours)
    heard, go_on = threading.Event(), threading.Event()

    def reading() -> None:
        with pytest.raises(GONE):
            end.recv()
        heard.set()
        go_on.wait(10.0)
        end.close()

    reader = threading.Thread(target=reading)
    reader.start()
    end.hang_up()
    assert heard.wait(10.0)
    with pytest.raises(EOFError):
        theirs.recv()
    with (tmp_path / "other").open("wb") as other:  # which would have the number of a closed pipe
        assert other.fileno() != number
        with pytest.raises((BrokenPipeError, ConnectionResetError)):
            end.send("what a file must not get")
        go_on.set()
        reader.join(10.0)
    assert (tmp_path / "other").read_bytes() == b""
    with pytest.raises(OSError, match="Bad file descriptor"):
        os.fstat(number)
    with pytest.raises((BrokenPipeError, ConnectionResetError)):
        end.send("nobody is there")
    end.hang_up()  # and again, which does nothing
    end.close()


def test_who_hangs_up_does_not_wait_for_one_that_writes():
    ours, theirs = multiprocessing.Pipe()
    end, failed = OwnEnd(ours), threading.Event()

    def writing() -> None:
        with pytest.raises((BrokenPipeError, ConnectionResetError)):
            end.send(b"x" * 10_000_000)  # more than the pipe holds, and nobody reads
        failed.set()

    writer = threading.Thread(target=writing)
    writer.start()
    assert not failed.wait(0.2)
    end.hang_up()
    assert failed.wait(10.0)
    end.close()
    theirs.close()
