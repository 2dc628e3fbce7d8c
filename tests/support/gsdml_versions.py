"""A small servo drive of an invented maker, as its GSDML file would be in each version of the schema.

The vendor's number 0xFEED is nobody's (assumed: PI gives them in rising order).  The drive has an access point, an
interface with a port (not in V1.0), telegrams 1 and 9 as modules, and one for signals with a parameter record; from
V2.1 on a module that takes a pluggable submodule, from V2.25 on a pluggable port, from V2.44 on a shared record.
Telegram 1 has the subslots of this project's AKD, apart from V1.0, which has one submodule in each module.

What a version has is written here after makers' files and PI's schemas, not taken from the reader's table.
"""

from __future__ import annotations

from decimal import Decimal

VERSIONS = (
    "1.0", "2.0", "2.1", "2.2", "2.25", "2.3", "2.31", "2.32", "2.33", "2.34", "2.35", "2.4", "2.41", "2.42", "2.43",
    "2.44", "2.45",
)  # fmt: skip


def file_name(version: str) -> str:
    return f"GSDML-V{version}-SampleWorks-Servo-20260101.xml"


def gsdml_of(version: str) -> str:
    """The file's text."""
    own = Decimal(version)

    def since(first: str, text: str, last: str = "9") -> str:
        return text if Decimal(first) <= own <= Decimal(last) else ""

    status = since("1.0", ' IOPS_Length="1" IOCS_Length="1"', "2.31")
    alarm = since("2.32", ' MayIssueProcessAlarm="false"')
    info = '<ModuleInfo><Name TextId="{0}"/><InfoText TextId="Info"/></ModuleInfo>'

    def virtual(name: str, ident: str, data: str = "", more: str = "", records: str = "") -> str:
        io = f"<IOData{status}>{data}</IOData>"
        text = info.format(name.partition("_")[0])
        return (
            f'<VirtualSubmoduleItem ID="{name}" SubmoduleIdentNumber="{ident}"{more}{alarm}>{io}{records}{text}'
            "</VirtualSubmoduleItem>"
        )

    def words(direction: str, count: int) -> str:
        item = '<DataItem DataType="Unsigned16" TextId="Word"/>'
        return f'<{direction} Consistency="All items consistency">{item * count}</{direction}>'

    def telegram(number: int, ident: str, inputs: int, outputs: int) -> str:
        name, data = f"T{number}", words("Input", inputs) + words("Output", outputs)
        if own < 2:
            submodules = virtual(f"{name}_1", "0x00000012", data)
        else:
            submodules = virtual(f"{name}_1", "0x00000011", more=' API="14848"')
            submodules += virtual(f"{name}_2", "0x00000012", data, ' API="14848" FixedInSubslots="2"')
        return module(name, ident, f"<VirtualSubmoduleList>{submodules}</VirtualSubmoduleList>")

    def module(name: str, ident: str, inside: str, more: str = "") -> str:
        return f'<ModuleItem ID="{name}" ModuleIdentNumber="{ident}"{more}>{info.format(name)}{inside}</ModuleItem>'

    def record(index: int, more: str = "") -> str:
        return (
            f'<ParameterRecordDataItem{more} Index="{index}" Length="4"><Name TextId="Filter"/>'
            '<Const Data="0x01,0x00,0x00,0x00"/>'
            '<Ref DataType="Unsigned16" ByteOffset="2" DefaultValue="300" AllowedValues="1..1000" TextId="Time"/>'
            "</ParameterRecordDataItem>"
        )

    shared = since("2.44", '<ParameterRecordDataRef RecordDataTarget="Shared" TransferSequence="9"/>')
    signals = virtual(
        "Signals_1",
        "0x00000031",
        '<Input><DataItem DataType="Unsigned8" TextId="Word" UseAsBits="true"/></Input>',
        records=f"<RecordDataList>{record(7)}{shared}</RecordDataList>",
    )
    timing = '<TimingProperties SendClock="32 64" ReductionRatio="8 16 32"/>'
    blocks = ' AR_BlockVersion="1" IOCR_BlockVersion="1" AlarmCR_BlockVersion="1" SubmoduleDataBlockVersion="1"'
    relations = (
        "<ApplicationRelations"
        + since("1.0", blocks, "2.1")
        + since("2.2", ' PullModuleAlarmSupported="true"')
        + since("2.3", ' StartupMode="Advanced;Legacy" NumberOfAR="2"')
        + f">{timing}</ApplicationRelations>"
    )
    interface = (
        '<InterfaceSubmoduleItem SubmoduleIdentNumber="0x00000002" SubslotNumber="32768" TextId="Interface"'
        + since("2.0", ' SupportedRT_Class="Class1"', "2.0")
        + since("2.1", ' SupportedRT_Classes="RT_CLASS_1" SupportedProtocols="SNMP;LLDP"')
        + since("2.1", ' SupportedMibs=""', "2.31")
        + since("2.2", ' DCP_HelloSupported="true"')
        + since("2.25", ' ID="Interface"')
        + since("2.3", ' DCP_BoundarySupported="true" PTP_BoundarySupported="true"')
        + f">{relations}</InterfaceSubmoduleItem>"
    )
    mau_types = since("2.32", '<MAUTypeList><MAUTypeItem Value="16"/><MAUTypeItem Value="30"/></MAUTypeList>')
    port = (
        '<PortSubmoduleItem SubmoduleIdentNumber="0x00000003" SubslotNumber="32769" TextId="Port"'
        + since("2.0", ' MAUType="100BASETXFD"', "2.25")
        + since("2.25", ' ID="Port"')
        + since("2.3", ' MAUTypes="16 30"')
        + f">{mau_types}</PortSubmoduleItem>"
    )
    access_point = (
        '<DeviceAccessPointItem ID="Head" PhysicalSlots="0..3" ModuleIdentNumber="0x00000010" MinDeviceInterval="512"'
        ' DNS_CompatibleName="servo" FixedInSlots="0" ObjectUUID_LocalIndex="1" ImplementationType="Sample"'
        + since("1.0", ' ExtendedAddressAssignmentSupported="true"', "2.31")
        + since("2.0", ' RequiredSchemaVersion="V1.0"')
        + since("2.1", ' MultipleWriteSupported="true" AddressAssignment="DCP;LOCAL"')
        + since("2.25", ' DeviceAccessSupported="true"')
        + since("2.3", f' PNIO_Version="V{version}" NameOfStationNotTransferable="false" ResetToFactoryModes="2"')
        + since("2.31", ' CheckDeviceID_Allowed="true"')
        + since("2.33", ' NumberOfDeviceAccessAR="1"')
        + ">"
        + '<ModuleInfo><Name TextId="Head"/><InfoText TextId="Info"/><OrderNumber Value="SW-4711"/></ModuleInfo>'
        + since("2.31", '<CertificationInfo ConformanceClass="B" ApplicationClass="" NetloadClass="I"/>')
        + '<IOConfigData MaxInputLength="100" MaxOutputLength="100"/>'
        + '<UseableModules><ModuleItemRef ModuleItemTarget="T1" AllowedInSlots="1" UsedInSlots="1"/>'
        + '<ModuleItemRef ModuleItemTarget="T9" AllowedInSlots="1"/>'
        + '<ModuleItemRef ModuleItemTarget="Signals" AllowedInSlots="2 3"/>'
        + since("2.1", '<ModuleItemRef ModuleItemTarget="Carrier" AllowedInSlots="3"/>')
        + "</UseableModules>"
        + f"<VirtualSubmoduleList>{virtual('Head_1', '0x00000001')}</VirtualSubmoduleList>"
        + since("2.0", f"<SystemDefinedSubmoduleList>{interface}{port}</SystemDefinedSubmoduleList>")
        + since("1.0", relations, "1.0")
        + "</DeviceAccessPointItem>"
    )
    carrier = module(
        "Carrier",
        "0x00000040",
        '<UseableSubmodules><SubmoduleItemRef SubmoduleItemTarget="Counter" AllowedInSubslots="2 3"/>'
        + since("2.25", '<SubmoduleItemRef SubmoduleItemTarget="Fibre" AllowedInSubslots="3"/>')
        + "</UseableSubmodules>",
        ' PhysicalSubslots="2 3"',
    )
    counter = f'<SubmoduleItem ID="Counter" SubmoduleIdentNumber="0x00000041"{alarm}><IOData{status}>'
    counter += f"{words('Input', 2)}</IOData>{info.format('Counter')}</SubmoduleItem>"
    fibre = '<PortSubmoduleItem ID="Fibre" SubmoduleIdentNumber="0x00000042" MAUTypes="18">'
    fibre += since("2.32", '<MAUTypeList><MAUTypeItem Value="18"/></MAUTypeList>')
    fibre += f"{info.format('Fibre')}</PortSubmoduleItem>"
    texts = ("Carrier", "Counter", "Fibre", "Filter", "Interface", "Port", "Signals", "Time", "Word")
    listed = "".join(f'<Text TextId="{name}" Value="{name}"/>' for name in texts)
    modules = [
        telegram(1, "0x00000101", 2, 2),
        telegram(9, "0x00000109", 5, 10),
        module("Signals", "0x00000030", f"<VirtualSubmoduleList>{signals}</VirtualSubmoduleList>"),
        since("2.1", carrier),
    ]
    namespace = "http://www.profibus.com/GSDML/2003/11/DeviceProfile"
    return "\n".join((
        '<?xml version="1.0" encoding="utf-8"?>',
        f'<ISO15745Profile xmlns="{namespace}" xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance"',
        f'xsi:schemaLocation="{namespace} ..\\xsd\\GSDML-DeviceProfile-V{version}.xsd">',
        "<ProfileHeader><ProfileIdentification>PROFINET Device Profile</ProfileIdentification>",
        "<ProfileRevision>1.00</ProfileRevision><ProfileName>Device Profile for PROFINET Devices</ProfileName>",
        "<ProfileSource>PROFIBUS Nutzerorganisation e. V. (PNO)</ProfileSource><ProfileClassID>Device</ProfileClassID>",
        "<ISO15745Reference><ISO15745Part>4</ISO15745Part><ISO15745Edition>1</ISO15745Edition>",
        "<ProfileTechnology>GSDML</ProfileTechnology></ISO15745Reference></ProfileHeader>",
        "<ProfileBody>",
        '<DeviceIdentity VendorID="0xFEED" DeviceID="0x0A1D">',
        '<InfoText TextId="Info"/><VendorName Value="Sample Works"/></DeviceIdentity>',
        '<DeviceFunction><Family MainFamily="Drives" ProductFamily="Servo"/></DeviceFunction>',
        "<ApplicationProcess>",
        "<DeviceAccessPointList>",
        access_point,
        "</DeviceAccessPointList>",
        "<ModuleList>",
        *modules,
        "</ModuleList>",
        since("2.1", f"<SubmoduleList>{counter}{since('2.25', fibre)}</SubmoduleList>"),
        since("2.44", "<RecordDataList>" + record(8, ' ID="Shared"') + "</RecordDataList>"),
        '<ChannelDiagList><ChannelDiagItem ErrorType="256"><Name TextId="Hot"/></ChannelDiagItem></ChannelDiagList>',
        "<ExternalTextList><PrimaryLanguage>",
        '<Text TextId="Info" Value="A servo drive that is nobody\'s"/><Text TextId="Head" Value="Sample servo"/>',
        '<Text TextId="T1" Value="Standard telegram 1"/><Text TextId="T9" Value="Standard telegram 9"/>',
        f'<Text TextId="Hot" Value="Too hot"/>{listed}',
        "</PrimaryLanguage></ExternalTextList>",
        "</ApplicationProcess></ProfileBody></ISO15745Profile>",
        "",
    ))  # fmt: skip
