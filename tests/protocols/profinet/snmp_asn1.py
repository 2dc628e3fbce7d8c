"""SNMP's messages in pyasn1's words: another opinion on what the octets mean."""

# ruff: noqa: N815 - pyasn1 looks for componentType

from pyasn1.codec.ber import decoder, encoder
from pyasn1.type import namedtype, tag, univ

from pnfarm.protocols.profinet.wire.snmp import message as snmp

__all__ = ["decode", "encode"]


def _application(base, number):
    implicit = tag.Tag(tag.tagClassApplication, tag.tagFormatSimple, number)
    return base().subtype(implicitTag=implicit)


def _exception(number):
    return univ.Null().subtype(implicitTag=tag.Tag(tag.tagClassContext, tag.tagFormatSimple, number))


#: RFC 3416: the choice behind a variable's name, and our tag of each.
TYPES = {
    snmp.INTEGER: univ.Integer(),
    snmp.OCTET_STRING: univ.OctetString(),
    snmp.OBJECT_IDENTIFIER: univ.ObjectIdentifier(),
    snmp.NULL: univ.Null(),
    snmp.IP_ADDRESS: _application(univ.OctetString, 0),
    snmp.COUNTER32: _application(univ.Integer, 1),
    snmp.GAUGE32: _application(univ.Integer, 2),
    snmp.TIME_TICKS: _application(univ.Integer, 3),
    snmp.OPAQUE: _application(univ.OctetString, 4),
    snmp.COUNTER64: _application(univ.Integer, 6),
    snmp.NO_SUCH_OBJECT: _exception(0),
    snmp.NO_SUCH_INSTANCE: _exception(1),
    snmp.END_OF_MIB_VIEW: _exception(2),
}
PDUS = (snmp.GET, snmp.GET_NEXT, snmp.RESPONSE, snmp.SET, snmp.GET_BULK)


class Choice(univ.Choice):
    componentType = namedtype.NamedTypes(*(namedtype.NamedType(f"v{number}", kind) for number, kind in TYPES.items()))


class VarBind(univ.Sequence):
    componentType = namedtype.NamedTypes(
        namedtype.NamedType("name", univ.ObjectIdentifier()), namedtype.NamedType("value", Choice())
    )


class VarBinds(univ.SequenceOf):
    componentType = VarBind()


class Pdu(univ.Sequence):
    componentType = namedtype.NamedTypes(
        namedtype.NamedType("request_id", univ.Integer()),
        namedtype.NamedType("error_status", univ.Integer()),
        namedtype.NamedType("error_index", univ.Integer()),
        namedtype.NamedType("varbinds", VarBinds()),
    )


def _context(number):
    return Pdu().subtype(implicitTag=tag.Tag(tag.tagClassContext, tag.tagFormatConstructed, number & 0x1F))


class Pdus(univ.Choice):
    componentType = namedtype.NamedTypes(*(namedtype.NamedType(f"p{number}", _context(number)) for number in PDUS))


class Message(univ.Sequence):
    componentType = namedtype.NamedTypes(
        namedtype.NamedType("version", univ.Integer()),
        namedtype.NamedType("community", univ.OctetString()),
        namedtype.NamedType("pdu", Pdus()),
    )


def encode(message):
    """Octets of an :class:`~pnfarm.protocols.profinet.wire.snmp.message.SnmpMessage`."""
    out = Message()
    out["version"], out["community"] = message.version, message.community
    pdu = out["pdu"].setComponentByName(f"p{message.pdu.tag}")[f"p{message.pdu.tag}"]
    pdu["request_id"], pdu["error_status"], pdu["error_index"] = (
        message.pdu.request_id,
        message.pdu.error_status,
        message.pdu.error_index,
    )
    pdu["varbinds"].clear()
    for varbind in message.pdu.varbinds:
        item = VarBind()
        item["name"] = varbind.name
        content = varbind.value.content
        kind = f"v{varbind.value.tag}"
        item["value"][kind] = TYPES[varbind.value.tag].clone("" if content is None else content)
        pdu["varbinds"].append(item)
    return encoder.encode(out)


def decode(data):
    """The message in ``data``, which holds nothing else."""
    message, rest = decoder.decode(data, asn1Spec=Message())
    assert not rest
    kind = message["pdu"].getName()
    pdu = message["pdu"][kind]
    return snmp.SnmpMessage(
        int(message["version"]),
        bytes(message["community"]),
        snmp.Pdu(
            int(kind[1:]),
            int(pdu["request_id"]),
            int(pdu["error_status"]),
            int(pdu["error_index"]),
            tuple(snmp.VarBind(tuple(item["name"]), _value(item["value"])) for item in pdu["varbinds"]),
        ),
    )


def _value(choice):
    number = int(choice.getName()[1:])
    content = choice.getComponent()
    if isinstance(content, univ.Null):
        return snmp.Value(number)
    if isinstance(content, univ.Integer):
        return snmp.Value(number, int(content))
    return snmp.Value(number, tuple(content) if isinstance(content, univ.ObjectIdentifier) else bytes(content))
