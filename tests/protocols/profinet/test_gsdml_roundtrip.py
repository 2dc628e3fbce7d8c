"""A random description, written and read back, equals itself."""

from dataclasses import replace

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pnfarm.errors import ConfigError
from pnfarm.protocols.profinet.gsdml.document import (
    DATA_TYPE_OCTETS,
    NO_NUMBERS,
    Certification,
    ChannelDiagnosis,
    Dap,
    DataItem,
    DataItems,
    ExtDiagnosis,
    Gsdml,
    Info,
    InterfaceSubmodule,
    ItemRef,
    ModuleItem,
    PortSubmodule,
    Relations,
    SubmoduleItem,
    UnitDiagnosis,
)
from pnfarm.protocols.profinet.gsdml.reader import parse_gsdml
from pnfarm.protocols.profinet.gsdml.records import ParameterConst, ParameterRecord, ParameterRef
from pnfarm.protocols.profinet.gsdml.values import Numbers
from pnfarm.protocols.profinet.gsdml.writer import emit_gsdml

U8, U16, U32 = st.integers(0, 0xFF), st.integers(0, 0xFFFF), st.integers(0, 0xFFFFFFFF)
# XML 1.0 has no other control characters, no surrogates and not the last two code points of plane 0
TEXT = st.text(
    st.characters(exclude_categories=("Cs", "Cc"), exclude_characters="\ufffe\uffff") | st.sampled_from("\t\n\r<>&\"'"),
    max_size=12,
)
ID = st.text("abcXYZ0189_-.", min_size=1, max_size=8)
#: Of what nothing refers to.
MAYBE_ID = ID | st.just("")
TOKENS = st.lists(st.sampled_from(["Legacy", "Advanced", "RT_CLASS_1", "LLDP", "SNMP"]), max_size=3).map(tuple)
NUMBERS = st.lists(U16, max_size=6).map(Numbers.of)
INFO = st.builds(Info, TEXT, TEXT, TEXT, TEXT, TEXT, TEXT)


def tuples(strategy, size=3, **options):
    return st.lists(strategy, max_size=size, **options).map(tuple)


def records(size):
    return tuples(RECORD, size, unique_by=lambda record: record.index)


ITEM = st.one_of(
    st.builds(
        lambda kind, name, as_bits, bits: DataItem(kind, DATA_TYPE_OCTETS[kind], name, as_bits, bits),
        st.sampled_from(sorted(DATA_TYPE_OCTETS)),
        TEXT,
        st.booleans(),
        tuples(st.tuples(U16, TEXT), 2, unique_by=lambda bit: bit[0]),
    ),
    st.builds(DataItem, st.sampled_from(["OctetString", "VisibleString", "Own"]), st.integers(0, 100), TEXT),
)
DATA = st.none() | st.builds(DataItems, tuples(ITEM), st.booleans())
REF = st.builds(
    ParameterRef,
    st.sampled_from(["Bit", "BitArea", "Unsigned16", "Integer8", "Float32", "OctetString", "Own"]),
    byte_offset=st.integers(0, 20),
    bit_offset=st.integers(0, 7),
    bit_length=st.integers(1, 15),
    length=st.integers(0, 8),
    default=TEXT,
    allowed=TEXT,
    name=TEXT,
    changeable=st.booleans(),
    visible=st.booleans(),
    texts=tuples(st.tuples(ID, TEXT), 2),
)
RECORD = st.builds(
    ParameterRecord,
    U16,
    st.integers(40, 5000),
    TEXT,
    U16,
    tuples(st.builds(ParameterConst, st.binary(max_size=20), st.integers(0, 20))),
    tuples(REF),
)
SUBMODULE = st.builds(
    SubmoduleItem,
    MAYBE_ID,
    U32,
    INFO,
    api=U32,
    fixed=NUMBERS,
    inputs=DATA,
    outputs=DATA,
    iops_length=U8,
    iocs_length=U8,
    records=records(3),
    may_issue_process_alarm=st.booleans(),
    writeable_im=NUMBERS,
    profisafe=st.booleans(),
)
ITEM_REF = st.builds(ItemRef, ID, NUMBERS, NUMBERS, NUMBERS)
PORT = st.builds(PortSubmodule, MAYBE_ID, U32, U16, TEXT, NUMBERS, U32, U32, records(1), NUMBERS)
RELATIONS = st.builds(
    Relations,
    startup_modes=TOKENS,
    number_of_ars=U16,
    additional_input_crs=U16,
    additional_output_crs=U16,
    pull_module_alarm=st.booleans(),
    send_clocks=NUMBERS,
    ratios=NUMBERS,
)
INTERFACE = st.builds(
    InterfaceSubmodule,
    MAYBE_ID,
    U32,
    U16,
    TEXT,
    TOKENS,
    TOKENS,
    *[st.booleans()] * 4,
    relations=RELATIONS,
    records=records(1),
    writeable_im=NUMBERS,
)
MODULE = st.builds(ModuleItem, ID, U32, INFO, NUMBERS, tuples(SUBMODULE, 2), tuples(PORT, 1), tuples(ITEM_REF, 2))
DAP = st.builds(
    Dap,
    id=ID,
    ident=U32,
    info=INFO,
    pnio_version=TEXT,
    required_schema_version=TEXT,
    physical_slots=NUMBERS,
    fixed_slots=NUMBERS,
    allowed_slots=NUMBERS,
    physical_subslots=NUMBERS,
    min_device_interval=U16,
    implementation_type=TEXT,
    dns_name=TEXT,
    instance=U16,
    multiple_write=st.booleans(),
    application_seconds=U16,
    ioxs_required=st.booleans(),
    device_access=st.booleans(),
    device_access_ars=U16,
    shared_device=st.booleans(),
    shared_input=st.booleans(),
    check_device_id=st.booleans(),
    name_not_transferable=st.booleans(),
    lldp_nod=st.booleans(),
    reset_modes=NUMBERS,
    address_assignment=TOKENS,
    certification=st.none() | st.builds(Certification, TEXT, TOKENS, TEXT),
    max_record=U32,
    max_input=U16,
    max_output=U16,
    max_data=U16,
    modules=tuples(ITEM_REF),
    submodules=tuples(SUBMODULE, 1),
    interfaces=tuples(INTERFACE, 1),
    ports=tuples(PORT, 2),
    useable=tuples(ITEM_REF, 1),
    own_relations=st.none() | RELATIONS,
)
API = st.none() | U32
SEVERITIES = st.just(("D",)) | tuples(st.sampled_from(["D", "MR", "MD", "QD"]))
EXTENDED = tuples(st.builds(ExtDiagnosis, U16, TEXT, TEXT, SEVERITIES)).map(
    lambda e: tuple(sorted(e, key=lambda x: x.error_type))
)
DIAGNOSIS = st.builds(ChannelDiagnosis, U16, TEXT, TEXT, API, EXTENDED, SEVERITIES)
UNIT = st.builds(UnitDiagnosis, U16, TEXT, TEXT, tuples(REF), API)


def makers_first(items):
    """In the order of reading: the standard's after the maker's, those of profiles last."""
    return tuple(sorted(items, key=lambda item: (item.api is not None, getattr(item, "is_standard", False))))


def named(items, letter):
    """Each with an ID of its own."""
    return tuple(replace(item, id=f"{letter}{number}-{item.id}") for number, item in enumerate(items))


def leading(refs, items):
    """References to what there is."""
    return tuple(replace(ref, target=items[place % len(items)].id) for place, ref in enumerate(refs) if items)


def apart(holder):
    """Each submodule in subslots of its own."""
    free = iter(range(0x8000, 0xFFFF))
    parts = {
        "submodules": tuple(
            replace(item, fixed=Numbers.of(100 * place + subslot % 100 for subslot in item.fixed))
            for place, item in enumerate(holder.submodules)
        ),
        "ports": tuple(replace(port, subslot=next(free)) for port in holder.ports),
    }
    if isinstance(holder, Dap):
        parts["interfaces"] = tuple(replace(one, subslot=next(free)) for one in holder.interfaces)
    return replace(holder, **parts)


def consistent(gsdml):
    """A description that a file can hold."""
    modules = named(gsdml.modules, "M")
    submodules, ports = named(gsdml.submodules, "S"), named(gsdml.pluggable_ports, "P")
    pluggable = (*submodules, *ports)
    return replace(
        gsdml,
        daps=tuple(
            replace(apart(dap), modules=leading(dap.modules, modules), useable=leading(dap.useable, pluggable))
            for dap in named(gsdml.daps, "D")
        ),
        modules=tuple(replace(apart(module), useable=leading(module.useable, pluggable)) for module in modules),
        submodules=submodules,
        pluggable_ports=ports,
    )


GSDML = st.builds(
    Gsdml,
    U16,
    U16,
    TEXT,
    TEXT,
    TEXT,
    TEXT,
    schema_version=st.sampled_from(["", "V1.0", "V2.1", "V2.35", "V2.4", "V2.45"]),
    daps=st.lists(DAP, min_size=1, max_size=2).map(tuple),
    modules=tuples(MODULE, 2),
    submodules=tuples(SUBMODULE.map(lambda item: replace(item, fixed=NO_NUMBERS)), 1),
    pluggable_ports=tuples(st.builds(PortSubmodule, ID, U32, st.just(0), TEXT, NUMBERS, U32, U32, records(1)), 1),
    diagnoses=tuples(DIAGNOSIS).map(makers_first),
    unit_diagnoses=tuples(UNIT, 2).map(makers_first),
).map(consistent)


@settings(suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large], max_examples=60)
@given(GSDML)
def test_a_description_is_written_and_read_back(gsdml):
    text = emit_gsdml(gsdml)
    assert parse_gsdml(text.encode()) == gsdml
    assert emit_gsdml(parse_gsdml(text.encode())) == text


def test_a_datum_whose_type_and_length_contradict_each_other_cannot_be_written():
    item = SubmoduleItem("S", 1, inputs=DataItems((DataItem("Unsigned16", 3),)))
    with pytest.raises(ConfigError, match="Unsigned16 of 3 octets"):
        emit_gsdml(Gsdml(1, 1, "", submodules=(item,)))
