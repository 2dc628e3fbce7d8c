"""Frame identifiers: the first two octets after EtherType 0x8892 (IEC 61158-6-10, coding of the field FrameID)."""

from __future__ import annotations

from enum import Enum

from pnfarm.wire.rtc import ALARM_HIGH, ALARM_LOW, FIRST_ACYCLIC_FRAME_ID, FIRST_CYCLIC_FRAME_ID

__all__ = [
    "ALARM_HIGH",
    "ALARM_LOW",
    "DCP_GET_SET",
    "DCP_HELLO",
    "DCP_IDENTIFY_REQUEST",
    "DCP_IDENTIFY_RESPONSE",
    "RSI",
    "RTC1_MULTICAST",
    "RTC1_UNICAST",
    "RTC3",
    "RT_UDP_MULTICAST",
    "RT_UDP_UNICAST",
    "FrameClass",
    "classify_frame_id",
]

RSI = 0xFE02
DCP_HELLO = 0xFEFC
DCP_GET_SET = 0xFEFD
DCP_IDENTIFY_REQUEST = 0xFEFE
DCP_IDENTIFY_RESPONSE = 0xFEFF

#: Isochronous frames; from 0x0700 on the redundant ones.
RTC3 = range(FIRST_CYCLIC_FRAME_ID, 0x1000)
#: RT_CLASS_1 of today; older engineering tools name the same range RT_CLASS_2.
RTC1_UNICAST = range(0x8000, 0xBC00)
RTC1_MULTICAST = range(0xBC00, 0xC000)
#: RT_CLASS_UDP, and the RT_CLASS_1 of old engineering tools.
RT_UDP_UNICAST = range(0xC000, 0xF800)
RT_UDP_MULTICAST = range(0xF800, FIRST_ACYCLIC_FRAME_ID)


class FrameClass(Enum):
    """Which protocol a frame belongs to."""

    PTCP = "ptcp"
    RTC3 = "rtc3"
    RTC1_UNICAST = "rtc1-unicast"
    RTC1_MULTICAST = "rtc1-multicast"
    RT_UDP_UNICAST = "rt-udp-unicast"
    RT_UDP_MULTICAST = "rt-udp-multicast"
    ALARM_HIGH = "alarm-high"
    ALARM_LOW = "alarm-low"
    RSI = "rsi"
    DCP = "dcp"
    FRAGMENT = "fragment"
    RESERVED = "reserved"

    @property
    def is_cyclic(self) -> bool:
        """Carries process data and ends with an APDU status."""
        return self in _CYCLIC


_CYCLIC = frozenset(
    {
        FrameClass.RTC3,
        FrameClass.RTC1_UNICAST,
        FrameClass.RTC1_MULTICAST,
        FrameClass.RT_UDP_UNICAST,
        FrameClass.RT_UDP_MULTICAST,
    }
)

_RANGES = (
    (RTC1_UNICAST, FrameClass.RTC1_UNICAST),
    (RTC1_MULTICAST, FrameClass.RTC1_MULTICAST),
    (RT_UDP_UNICAST, FrameClass.RT_UDP_UNICAST),
    (RT_UDP_MULTICAST, FrameClass.RT_UDP_MULTICAST),
    (range(DCP_HELLO, DCP_IDENTIFY_RESPONSE + 1), FrameClass.DCP),
    (range(ALARM_HIGH, ALARM_HIGH + 1), FrameClass.ALARM_HIGH),
    (range(ALARM_LOW, ALARM_LOW + 1), FrameClass.ALARM_LOW),
    (range(RSI, RSI + 1), FrameClass.RSI),
    (RTC3, FrameClass.RTC3),
    (range(0x0020, 0x0022), FrameClass.PTCP),  # sync with follow up
    (range(0x0080, 0x0082), FrameClass.PTCP),  # sync without follow up
    (range(0xFF00, 0xFF02), FrameClass.PTCP),  # announce
    (range(0xFF20, 0xFF22), FrameClass.PTCP),  # follow up
    (range(0xFF40, 0xFF44), FrameClass.PTCP),  # delay measurement
    (range(0xFF80, 0xFF90), FrameClass.FRAGMENT),
)


def classify_frame_id(frame_id: int) -> FrameClass:
    """The protocol of a frame identifier; ids that the standard reserves are ``RESERVED``."""
    for identifiers, frame_class in _RANGES:
        if frame_id in identifiers:
            return frame_class
    return FrameClass.RESERVED
