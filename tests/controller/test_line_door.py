"""Where other processes ask a running controller for parameters: questions, refusals, and what is no question."""

import asyncio
import json
import os
import socket

import pytest

from pnfarm.buses.line_parameters import LineQuestion
from pnfarm.controller import line_door
from pnfarm.controller.line_door import LineDoor, ask_controller
from pnfarm.drives.parameters.parameter import ParameterError
from pnfarm.errors import ConfigError, RemoteError

pytestmark = pytest.mark.asyncio
QUESTION = LineQuestion(11, "922")
FOUND = {"drive": "axis-01", "pnu": 922, "subindex": 0, "name": "", "value": 1, "values": None, "unit": ""}


class Answer:
    def __init__(self, raises=None, done=True):
        self.raises, self.done = raises, done

    def result(self):
        if self.raises is not None:
            raise self.raises
        return FOUND


class Controller:
    """Answers every question in the same way."""

    def __init__(self, answer=None, refuses=None):
        self.asked = []
        self.answer, self.refuses = answer or Answer(), refuses

    def ask_station(self, question, now):
        if self.refuses is not None:
            raise self.refuses
        self.asked.append(question)
        return self.answer


@pytest.fixture
def where():
    return f"door-of-a-test-{os.getpid()}:1"


async def opened(controller, where):
    poked = []
    door = LineDoor(controller, where, lambda: poked.append(1))
    assert await door.open()
    return door, poked


async def test_a_question_reaches_the_controller_and_wakes_it(where):
    controller = Controller()
    door, poked = await opened(controller, where)
    try:
        assert await asyncio.to_thread(ask_controller, where, QUESTION) == FOUND
        assert (controller.asked, poked) == ([QUESTION], [1])
        assert not await LineDoor(Controller(), where, lambda: None).open(), "one door for each line"
    finally:
        await door.close()
    assert ask_controller(where, QUESTION) is None


@pytest.mark.parametrize(
    ("controller", "error", "said"),
    [(Controller(refuses=ConfigError("there is no station 40")), ConfigError, "there is no station 40"),
     (Controller(Answer(RemoteError("it does not answer"))), RemoteError, "it does not answer"),
     (Controller(Answer(ParameterError(1, detail="axis-01"))), ParameterError, r"axis-01: .* \(0x01\)")],
)  # fmt: skip
async def test_what_the_controller_says_is_what_the_other_process_raises(where, controller, error, said):
    door, _ = await opened(controller, where)
    try:
        with pytest.raises(error, match=said):
            await asyncio.to_thread(ask_controller, where, QUESTION)
    finally:
        await door.close()


async def test_a_controller_that_never_answers_is_told_of(where, monkeypatch):
    monkeypatch.setattr(line_door, "ANSWER_SECONDS", 0.1)
    door, _ = await opened(Controller(Answer(done=False)), where)
    try:
        with pytest.raises(RemoteError, match="has not asked in time"):
            await asyncio.to_thread(ask_controller, where, QUESTION)
    finally:
        await door.close()


async def test_a_controller_that_ends_leaves_its_client_without_an_answer(where):
    door, poked = await opened(Controller(Answer(done=False)), where)
    asking = asyncio.create_task(asyncio.to_thread(ask_controller, where, QUESTION))
    async with asyncio.timeout(5):
        while not poked:  # noqa: ASYNC110 - another thread asks
            await asyncio.sleep(0.001)
    await door.close()
    with pytest.raises(RemoteError, match="gave no answer"):
        await asking


@pytest.mark.parametrize(
    "octets",
    [b"\n", b"no json\n", b"[]\n", b"{}\n", b'{"station": "11", "parameter": "1"}\n', b"[" * 3000 + b"\n",
     b'{"station": true, "parameter": "1"}\n', b'{"station": 1, "parameter": 5}\n',
     b'{"station": 1, "parameter": "5", "value": 1.5}\n', b'{"station": 1, "parameter": "5", "model": []}\n'],
)  # fmt: skip
async def test_what_is_no_question_is_refused(where, octets):
    controller = Controller()
    door, _ = await opened(controller, where)
    try:
        reader, writer = await asyncio.open_unix_connection(line_door._name(where))
        writer.write(octets)
        told = json.loads(await asyncio.wait_for(reader.readline(), 5))
        assert told == {"error": "this is no question for a parameter", "kind": "config"}
        writer.close()
    finally:
        await door.close()
    assert controller.asked == []


async def test_a_line_without_end_gets_no_answer(where):
    door, _ = await opened(Controller(), where)
    try:
        reader, writer = await asyncio.open_unix_connection(line_door._name(where))
        writer.write(b"x" * 20_000)
        assert await asyncio.wait_for(reader.read(), 5) == b""
        writer.close()
    except ConnectionResetError:
        # the kernel's word for octets that nobody read
        pass
    finally:
        await door.close()


async def test_a_process_of_another_user_is_turned_away(where, monkeypatch):
    controller = Controller()
    door, _ = await opened(controller, where)
    monkeypatch.setattr(line_door, "_is_trusted", lambda sock: False)
    try:
        assert await asyncio.to_thread(ask_controller, where, QUESTION) is None
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as sock:
            sock.connect(line_door._name(where))
            assert await asyncio.to_thread(sock.recv, 10) == b""
    finally:
        await door.close()
    assert controller.asked == []


async def test_a_controller_whose_stations_have_no_parameters_has_no_door(where):
    assert not await LineDoor(object(), where, lambda: None).open()
