"""Any block of any type, as Hypothesis draws them."""

from hypothesis import strategies as st

from pnfarm.protocols.profinet.wire.block import RawBlock
from pnfarm.protocols.profinet.wire.cm import connect, expected
from pnfarm.protocols.profinet.wire.cm.control import (
    CONTROL_BLOCK_TYPES,
    ControlBlock,
)
from pnfarm.protocols.profinet.wire.cm.iocr import FrameSlot, IocrApi, IocrBlockReq, IocrBlockRes
from pnfarm.protocols.profinet.wire.records import diagnosis, identification, log_book
from pnfarm.protocols.profinet.wire.rpc.pdu import PnioStatus

u8, u16, u32 = st.integers(0, 0xFF), st.integers(0, 0xFFFF), st.integers(0, 0xFFFFFFFF)
octets = st.binary(max_size=40)
mac = st.binary(min_size=6, max_size=6)
uuids = st.uuids()


def some(*parts, maximum=3):
    return st.lists(st.tuples(*parts), max_size=maximum).map(tuple)


def many(strategy, maximum=3):
    return st.lists(strategy, max_size=maximum).map(tuple)


slots = many(st.builds(FrameSlot, u16, u16, u16))
descriptions = st.builds(expected.DataDescription, u16, u16, u8, u8)
exp_subs = st.one_of(
    st.builds(expected.ExpectedSubmodule, u16, u32, u16.map(lambda p: p | 3), st.tuples(descriptions, descriptions)),
    st.builds(expected.ExpectedSubmodule, u16, u32, u16.map(lambda p: p & ~2), st.tuples(descriptions)),
)
diff_modules = st.builds(expected.DiffModule, u16, u32, u16, many(st.builds(expected.DiffSubmodule, u16, u32, u16)))
id_slots = st.builds(identification.IdentificationSlot, u16, u32, some(u16, u32))
id_apis = st.builds(identification.IdentificationApi, u32, many(id_slots))
ar_entries = st.builds(
    identification.ArDataEntry, uuids, uuids, uuids, u32, u16, u16, u16, u16, u16, u16, octets,
    many(st.builds(identification.ArDataIocr, u32, u16, u16, u32)), many(u32), octets,
)  # fmt: skip
statuses = st.builds(PnioStatus, u8, u8, u8, u8)
properties = u16.map(diagnosis.ChannelProperties.from_int)
ITEMS = {
    0x8000: st.builds(diagnosis.ChannelDiagnosis, u16, properties, u16),
    0x8002: st.builds(diagnosis.ExtChannelDiagnosis, u16, properties, u16, u16, u32),
    0x8003: st.builds(diagnosis.QualifiedChannelDiagnosis, u16, properties, u16, u16, u32, u32),
    0x8100: st.builds(diagnosis.MaintenanceItem, u32, u16),
    0x1234: st.builds(diagnosis.UserItem, st.just(0x1234), octets),
}
item_lists = st.one_of(
    *(
        st.lists(item, min_size=1, max_size=1 if usi == 0x1234 else 4).map(lambda found, usi=usi: (usi, tuple(found)))
        for usi, item in ITEMS.items()
    )
)
diagnoses = st.builds(
    lambda place, channel, found, version: diagnosis.DiagnosisData(
        place[0] if version & 0xFF else 0, *place[1:], *channel, *found, version
    ),
    st.tuples(u32, u16, u16), st.tuples(u16, properties), item_lists, u16,
)  # fmt: skip
BLOCKS = {
    "ar-req": st.builds(connect.ArBlockReq, u16, uuids, u16, mac, uuids, u32, u16, u16, octets, u16),
    "ar-res": st.builds(connect.ArBlockRes, u16, uuids, u16, mac, u16, u16),
    "alarm-req": st.builds(connect.AlarmCrBlockReq, u16, u16, u32, u16, u16, u16, u16, u16, u16, u16),
    "alarm-res": st.builds(connect.AlarmCrBlockRes, u16, u16, u16, u16),
    "prm-server-req": st.builds(connect.PrmServerBlockReq, uuids, u32, u16, octets, u16),
    "prm-server-res": st.builds(connect.PrmServerBlockRes, u16),
    "mcr": st.builds(connect.McrBlockReq, u16, u32, u16, octets, u16),
    "ar-rpc-req": st.builds(connect.ArRpcBlockReq, u16, u16),
    "ar-rpc-res": st.builds(connect.ArRpcBlockRes, u16, u16),
    "ar-server": st.builds(connect.ArServerBlock, octets, u16),
    "ar-vendor-req": st.builds(connect.ArVendorBlockReq, u16, u32, octets, u16),
    "ar-vendor-res": st.builds(connect.ArVendorBlockRes, u16, u32, octets, u16),
    "iocr-req": st.builds(
        IocrBlockReq, u16, u16, u32, u16, u16, u16, u16, many(st.builds(IocrApi, u32, slots, slots)),
        u16, u16, u32, u16, u16, u16, u16, mac, u16,
    ),
    "iocr-res": st.builds(IocrBlockRes, u16, u16, u16, u16),
    "expected": st.builds(
        expected.ExpectedSubmoduleBlockReq,
        many(st.builds(expected.ExpectedApi, u32, u16, u32, many(exp_subs), u16)),
        u16,
    ),
    "module-diff": st.builds(
        expected.ModuleDiffBlock, many(st.builds(expected.DiffApi, u32, many(diff_modules))), u16
    ),
    "control": st.builds(ControlBlock, st.sampled_from(CONTROL_BLOCK_TYPES), uuids, u16, u16, u16, u16, u16, u16),
    "im0": st.builds(
        identification.Im0, u16, st.binary(min_size=20, max_size=20), st.binary(min_size=16, max_size=16), u16,
        st.tuples(u8.map(chr), u8, u8, u8), u16, u16, u16, u16, u16, u16,
    ),
    "identification": st.builds(
        identification.IdentificationData, st.sampled_from((0x12, 0x13, 0x30, 0x31, 0x32)), many(id_apis),
        st.just(0x0101),
    ),
    "api-data": st.builds(identification.ApiData, many(u32), u16),
    "ar-data": st.builds(identification.ArData, many(ar_entries)),
    "record-input": st.builds(identification.RecordInputData, octets, octets, octets, u16),
    "record-output": st.builds(identification.RecordOutputData, octets, octets, octets, u16, octets, u16),
    "substitute": st.builds(identification.SubstituteValue, u16, u8, octets, u8, u16),
    "diagnosis": diagnoses,
    "log": st.builds(
        log_book.LogData, st.integers(0, 2**64 - 1),
        many(st.builds(log_book.LogEntry, st.integers(0, 2**64 - 1), uuids, statuses, u32)), u16,
    ),
    "raw": st.builds(RawBlock, st.integers(0x4000, 0x7FFF), octets, u16),
}  # fmt: skip
