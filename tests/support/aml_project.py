"""Engineering projects in AutomationML, in the form that TIA Portal writes."""

HIWIN = "GSDML-V2.35-HIWIN-E1-20240101.XML"
ISLAND = "GSDML-V2.35-EXAMPLE-ISLAND-20261127.XML"
ROLES = "AutomationProjectConfigurationRoleClassLib"
CLASSES = "AutomationProjectConfigurationInterfaceClassLib"


def attribute(name, value):
    return f'<Attribute Name="{name}" AttributeDataType="xs:string"><Value>{value}</Value></Attribute>'


def element(name, inside="", role="", **attributes):
    facts = "".join(attribute(key, value) for key, value in attributes.items())
    kind = f'<SupportedRoleClass RefRoleClassPath="{ROLES}/{role}"/>' if role else ""
    return f'<InternalElement ID="{name}-id" Name="{name}">{facts}{inside}{kind}</InternalElement>'


def node(ip, name="", router=""):
    more = {"ProfinetDeviceName": name} if name else {}
    more |= {"RouterAddress": router} if router else {}
    inside = element("IE1", role="Node", Type="Ethernet", NetworkAddress=ip, SubnetMask="255.255.255.0", **more)
    return element("PROFINET interface", inside, role="CommunicationInterface", Label="X1")


def slave(name, address, file, *modules):
    """A PROFIBUS station with the number of an address."""
    inside = element("N1", role="Node", Type="Profibus", NetworkAddress=address)
    interface = element(f"{name}-if", inside, role="CommunicationInterface").replace(f"{name}-if-id", f"{name}-if")
    head = element(name, interface, role="DeviceItem", TypeIdentifier=f"GSD:{file}/DAP", PositionNumber=0)
    rack = element("Rack", head + "".join(modules), TypeIdentifier=f"GSD:{file}/R", PositionNumber=0)
    return element(name, rack, role="Device", TypeIdentifier=f"GSD:{file}/D")


def drive(name, ip, file=HIWIN, dap="DAP 1", router="", module=("Telegram 111", "ID_T111")):
    head = element(
        name, node(ip, name, router), role="DeviceItem", TypeIdentifier=f"GSD:{file}/DAP/{dap}", PositionNumber=0
    )
    shown, part = module
    plugged = element(shown, role="DeviceItem", TypeIdentifier=f"GSD:{file}/M/{part}", PositionNumber=1)
    return element(f"GSD device {name}", head + plugged, role="Device", TypeIdentifier=f"GSD:{file}/D")


def tag(name, address, data_type="Bool"):
    inside = attribute("DataType", data_type) + attribute("LogicalAddress", address)
    return f'<ExternalInterface ID="t" Name="{name}" RefBaseClassPath="{CLASSES}/Tag">{inside}</ExternalInterface>'


def table(*tags):
    return element("Default tag table", "".join(tags), role="TagTable")


def area(number, kind, start, bits):
    """An entry of a part's addresses in the PLC's memory."""
    entries = attribute("StartAddress", start) + attribute("Length", bits) + attribute("IoType", kind)
    return f'<Attribute Name="{number}">{entries}</Attribute>'


def module(slot, identifier, *areas, name="module", inside="", version=""):
    """``areas``: (kind, start, bits) of its one submodule."""
    listed = "".join(area(number, *one) for number, one in enumerate(areas, 1))
    own = f'<InternalElement ID="s" Name="{name}"><Attribute Name="Address">{listed}</Attribute></InternalElement>'
    more = {"FirmwareVersion": version} if version else {}
    return element(name, own + inside, role="DeviceItem", TypeIdentifier=identifier, PositionNumber=slot, **more)


def station(name, ip, identifier, *modules, kind="GSD:X.XML/D", version=""):
    """A device with a rack; its interface is at the IO system, under the ID ``NAME-if``."""
    interface = element(f"{name}-if", node(ip, name), role="CommunicationInterface", Label="X1").replace(
        f'ID="{name}-if-id"', f'ID="{name}-if"'
    )
    more = {"FirmwareVersion": version} if version else {}
    head = element(name, interface, role="DeviceItem", TypeIdentifier=identifier, PositionNumber=0, **more)
    rack = element("Rack", head + "".join(modules), TypeName="Rack", PositionNumber=0, TypeIdentifier="System:Rack.X")
    return element(f"device {name}", rack, role="Device", TypeIdentifier=kind)


def plc(name="PLC_1", ip="10.7.0.1", tags=(), system="system"):
    """With an IO system under this ID."""
    is_system = f'<SupportedRoleClass RefRoleClassPath="{ROLES}/IoSystem"/>'
    controls = f'<InternalElement ID="{system}" Name="PROFINET IO">{is_system}'
    head = element(
        name,
        (table(*tags) if tags else "") + node(ip, name.lower().replace("_", "-")) + controls + "</InternalElement>",
        role="DeviceItem",
        TypeIdentifier="OrderNumber:6ES7 513-1AL02-0AB0/V2.8",
    )
    rack = element("Rack_0", head, TypeIdentifier="System:Rack.S71500", PositionNumber=0)
    return element(f"station of {name}", rack, role="Device", TypeIdentifier="System:Device.S71500")


def at_system(interface, system="system"):
    sides = f"{interface}:LogicalEndPoint_Interface", f"{system}:LogicalEndPoint_IoSystem"
    return '<InternalLink Name="Link To IoSystem_1" RefPartnerSideA="{}" RefPartnerSideB="{}"/>'.format(*sides)


def project(*devices, schema="2.15", links=()):
    names = ' xmlns="http://www.dke.de/CAEX"' if schema == "3.0" else ""
    whole = element("Project", element("PN/IE_1", role="Subnet", Type="Ethernet") + "".join((*devices, *links)))
    return (
        f'<?xml version="1.0" encoding="utf-8"?><CAEXFile{names} FileName="p.aml" SchemaVersion="{schema}">'
        f'<InstanceHierarchy Name="Project hierarchy">{whole}</InstanceHierarchy></CAEXFile>'
    )
