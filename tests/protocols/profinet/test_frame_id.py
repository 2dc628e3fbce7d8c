import pytest

from pnfarm.protocols.profinet.wire.frame_id import FrameClass, classify_frame_id


@pytest.mark.parametrize(
    ("frame_id", "frame_class"),
    [
        (0x0020, FrameClass.PTCP),
        (0x00FF, FrameClass.RESERVED),
        (0x0100, FrameClass.RTC3),
        (0x0FFF, FrameClass.RTC3),
        (0x1000, FrameClass.RESERVED),
        (0x7FFF, FrameClass.RESERVED),
        (0x8000, FrameClass.RTC1_UNICAST),
        (0xBBF0, FrameClass.RTC1_UNICAST),
        (0xBBFF, FrameClass.RTC1_UNICAST),
        (0xBC00, FrameClass.RTC1_MULTICAST),
        (0xBFFF, FrameClass.RTC1_MULTICAST),
        (0xC000, FrameClass.RT_UDP_UNICAST),
        (0xF7FF, FrameClass.RT_UDP_UNICAST),
        (0xF800, FrameClass.RT_UDP_MULTICAST),
        (0xFBFF, FrameClass.RT_UDP_MULTICAST),
        (0xFC00, FrameClass.RESERVED),
        (0xFC01, FrameClass.ALARM_HIGH),
        (0xFE01, FrameClass.ALARM_LOW),
        (0xFE02, FrameClass.RSI),
        (0xFEFC, FrameClass.DCP),
        (0xFEFF, FrameClass.DCP),
        (0xFF40, FrameClass.PTCP),
        (0xFF80, FrameClass.FRAGMENT),
        (0xFFFF, FrameClass.RESERVED),
    ],
)
def test_every_frame_id_has_its_protocol(frame_id, frame_class):
    assert classify_frame_id(frame_id) is frame_class


def test_only_process_data_are_cyclic():
    assert classify_frame_id(0x8000).is_cyclic
    assert classify_frame_id(0x0100).is_cyclic
    assert not classify_frame_id(0xFC01).is_cyclic
    assert not classify_frame_id(0xFEFE).is_cyclic
