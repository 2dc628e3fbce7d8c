"""A log that nobody reads does not stop the program: lines are lost, and that is said."""

import contextlib
import io
import json
import os
import sys
from pathlib import Path

import structlog

from pnfarm.cli.log.setup import configure
from pnfarm.cli.log.standard_error import PIECE, StandardError


@contextlib.contextmanager
def piped():
    """Standard error is a pipe: its reading end.  Not a fixture, as pytest sets standard error before each test."""
    reading, writing = os.pipe()
    with io.TextIOWrapper(io.FileIO(writing, "w"), "utf-8", write_through=True) as error:
        before = sys.stderr, sys.__stderr__
        sys.stderr = sys.__stderr__ = error
        try:
            yield reading
        finally:
            sys.stderr, sys.__stderr__ = before
            os.close(reading)


def drain(reading):
    os.set_blocking(reading, False)
    octets = b""
    while True:
        try:
            octets += os.read(reading, 1 << 20)
        except BlockingIOError:
            return octets.decode()


def test_a_full_pipe_loses_lines_and_the_next_one_says_how_many():
    try:
        with piped() as pipe:
            configure(as_json=True)
            log = structlog.get_logger()
            events = [f"event {number}" for number in range(200)]
            for event in events:
                log.info(event, text="x" * 1000)
            kept = [json.loads(line) for line in drain(pipe).splitlines()]
            log.info("read again")
            log.info("once only")
            after = [json.loads(line) for line in drain(pipe).splitlines()]
    finally:
        configure(as_json=False)
        structlog.reset_defaults()
    assert 0 < len(kept) < 200
    assert [line["event"] for line in kept] == events[: len(kept)]
    assert [line.get("lines_lost") for line in after] == [200 - len(kept), None]


def test_what_a_client_names_does_not_steer_the_terminal():
    try:
        with piped() as pipe:
            configure(as_json=False)
            structlog.get_logger().info("fault requested", path="/\x1b]0;mine\x07\n\u202ename", drive="Achse-ü")
            text = drain(pipe)
    finally:
        configure(as_json=False)
        structlog.reset_defaults()
    assert text.rstrip("\n").isprintable()
    assert "mine" in text
    assert "Achse-ü" in text


def test_a_line_that_was_cut_off_is_ended_before_the_next_one():
    with piped() as pipe:
        error = StandardError()
        # a pipe holds 16 pieces: the sixth line does not fit as a whole
        while not error.lost:
            error.write("a" * (3 * PIECE - 1) + "\n")
        first = drain(pipe)
        error.write("whole\n")
        second = drain(pipe)
    assert not first.endswith("\n")
    assert second == "\nwhole\n"
    assert error.lost == 0


def test_a_log_whose_reader_has_gone_ends_nothing():
    with piped() as pipe:
        os.dup2(elsewhere := os.open(os.devnull, os.O_RDONLY), pipe)
        os.close(elsewhere)
        error = StandardError()
        error.write("one\n")
        error.write("two\n")
    assert error.lost == 2


def test_a_log_on_a_full_disk_ends_nothing(monkeypatch):
    with Path("/dev/full").open("w", encoding="utf-8") as full:
        monkeypatch.setattr(sys, "stderr", full)
        error = StandardError()
        error.write("lost\n")
        assert error.lost == 1
        # there is room again
        room = os.open(os.devnull, os.O_WRONLY)
        os.dup2(room, full.fileno())
        os.close(room)
        error.write("written\n")
        assert error.lost == 0
