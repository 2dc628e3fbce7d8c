"""What surrounds the data of a cyclic frame is chosen by the number in its channel's row."""

import ast
from pathlib import Path

from virtual_pair import Pair

import pnfarm
from pnfarm.table.channel import DISCARD_LENGTH, FRAMING_CLASS1, FRAMING_RTC

OTHER = FRAMING_CLASS1 + 1


def test_a_consumer_of_another_framing_takes_no_frame_of_this_one() -> None:
    pair = Pair()
    pair.run(0.1)
    consumer = pair.farm.cpm[0]
    assert consumer.framing == FRAMING_RTC
    consumer.framing = OTHER
    received, dropped = int(consumer.received), int(consumer.discarded[DISCARD_LENGTH])
    pair.run(0.05)
    assert consumer.received == received
    assert consumer.discarded[DISCARD_LENGTH] > dropped


def test_a_provider_of_another_framing_leaves_the_trailer_of_this_one_alone() -> None:
    pair = Pair()
    pair.run(0.1)
    provider = pair.farm.ppm[0]
    frame = pair.farm.frames[0]
    end = int(provider.length)
    sealed = bytes(frame[end - 4 : end])
    pair.run(0.01)
    assert bytes(frame[end - 4 : end]) != sealed, "its counter goes on"
    provider.framing = OTHER
    sealed, counter = bytes(frame[end - 4 : end]), int(provider.counter)
    pair.run(0.01)
    assert (bytes(frame[end - 4 : end]), int(provider.counter)) == (sealed, counter)


def test_the_units_and_types_of_cyclic_frames_are_defined_once_in_the_project() -> None:
    wanted = {31_250: "wire/rtc.py", 0xFC00: "wire/rtc.py", 0xFC01: "wire/rtc.py", 0xFE01: "wire/rtc.py"}
    root = Path(pnfarm.__file__).parent
    found: dict[int, list[str]] = {number: [] for number in wanted}
    for path in sorted(root.rglob("*.py")):
        if path.is_relative_to(root / "protocols" / "profibus"):
            continue  # 31250 is a baud rate there
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.Constant) and type(node.value) is int and node.value in wanted:
                found[node.value].append(path.relative_to(root).as_posix())
    assert found == {number: [place] for number, place in wanted.items()}
