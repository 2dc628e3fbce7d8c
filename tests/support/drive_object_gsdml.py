"""A drive of an invented maker whose GSDML file has drive objects that take telegrams as submodules.

The shape is that of makers' files: parameter access point in subslot 1, PROFIsafe or nothing in 2, the telegram in 3,
a supplementary telegram or nothing in 4; two access points, and a second drive object with some of the telegrams.
"""

from __future__ import annotations

__all__ = ["EMPTY", "PROFISAFE", "SERVO", "VECTOR", "drive_object_gsdml"]

#: Idents of the drive objects and of submodules.
SERVO, VECTOR, EMPTY, PROFISAFE = 0x0100_00B0, 0x0100_00C0, 0xFFFE, 0x0000_001E
#: Telegram: name, words out and in.
_TELEGRAMS = {
    1: ("Standard telegram 1, PZD-2/2", 2, 2),
    3: ("Standard telegram 3, PZD-5/9", 5, 9),
    7: ("Standard telegram 7, PZD-2/2", 2, 2),
    20: ("Standard telegram 20, PZD-2/6", 2, 6),
    105: ("SIEMENS Telegramm 105, PZD-10/10", 10, 10),
    111: ("SIEMENS telegram 111, PZD-12/12", 12, 12),
    220: ("SIEMENS telegram 220, PZD-10/10", 10, 10),
}
SAFE = 'AllowedInSubslots="2'
#: A record of the parameter access point: a gain from 1 to 9, 3 unless it is written.
_RECORDS = (
    '<RecordDataList><ParameterRecordDataItem Index="5" Length="2"><Name TextId="Setup"/><Const Data="0x00,0x00"/>'
    '<Ref DataType="Unsigned8" ByteOffset="1" DefaultValue="3" AllowedValues="1..9" TextId="Gain"/>'
    "</ParameterRecordDataItem></RecordDataList>"
)
_OBJECTS = {"SERVO": (SERVO, (1, 3, 7, 105, 111, 220)), "VECTOR": (VECTOR, (1, 20))}


def _data(outputs: int, inputs: int) -> str:
    item = '<DataItem DataType="Unsigned16" TextId="Word"/>'
    ways = (("Input", inputs), ("Output", outputs))
    return "".join(f'<{way} Consistency="All items consistency">{item * count}</{way}>' for way, count in ways if count)


def drive_object_gsdml(*, supplement: tuple[int, int] | None = (3, 1), safe: str = SAFE) -> str:
    """The file's text; ``supplement``: words of telegram 750 out and in; ``safe``: attributes of PROFIsafe's place."""
    texts = {"Word": "Word", "Info": "A drive that is nobody's", "Map": "Module access point", "Empty": "Empty"}
    texts |= {"Safe": "PROFIsafe telegram 30", "Hot": "Motor too hot", "Bus": "Fieldbus of the Servo silent"}
    texts |= {"Setup": "Set-up", "Gain": "Gain of the filter"}
    listed = []

    def submodule(name: str, ident: int, data: str = "", records: str = "") -> None:
        info = f'<ModuleInfo><Name TextId="{name}"/><InfoText TextId="Info"/></ModuleInfo>'
        listed.append(
            f'<SubmoduleItem ID="S_{name}" SubmoduleIdentNumber="0x{ident:08X}" API="14848" '
            f'MayIssueProcessAlarm="true"><IOData>{data}</IOData>{records}{info}</SubmoduleItem>'
        )

    submodule("Map", 0xFFFF, records=_RECORDS)
    submodule("Empty", EMPTY)
    submodule("Safe", PROFISAFE, _data(3, 3))
    for number, (name, outputs, inputs) in _TELEGRAMS.items():
        texts[f"T{number}"] = name
        submodule(f"T{number}", number, _data(outputs, inputs))
    if supplement is not None:
        texts["T750"] = f"Supplementary telegram 750, PZD-{supplement[0]}/{supplement[1]}"
        submodule("T750", 750, _data(*supplement))

    def drive_object(name: str, ident: int, telegrams: tuple[int, ...]) -> str:
        texts[name] = f"{name} drive object 1"
        refs = ['Map" AllowedInSubslots="1" FixedInSubslots="1']
        refs += ['Empty" AllowedInSubslots="2 4" UsedInSubslots="4', f'Safe" {safe}']
        refs += [f'T{number}" AllowedInSubslots="3' for number in telegrams]
        refs += ['T750" AllowedInSubslots="4'] if supplement is not None else []
        useable = "".join(f'<SubmoduleItemRef SubmoduleItemTarget="S_{ref}"/>' for ref in refs)
        return (
            f'<ModuleItem ID="{name}" ModuleIdentNumber="0x{ident:08X}" PhysicalSubslots="1..4"><ModuleInfo>'
            f'<Name TextId="{name}"/><InfoText TextId="Info"/></ModuleInfo>'
            f"<UseableSubmodules>{useable}</UseableSubmodules></ModuleItem>"
        )

    objects = "".join(drive_object(name, ident, telegrams) for name, (ident, telegrams) in _OBJECTS.items())

    def access_point(name: str, ident: int, order: str, modules: tuple[str, ...]) -> str:
        texts[name] = name
        refs = "".join(f'<ModuleItemRef ModuleItemTarget="{each}" AllowedInSlots="1..6"/>' for each in modules)
        ports = "".join(
            f'<PortSubmoduleItem ID="{name}_P{port}" SubmoduleIdentNumber="0x0000000{port + 2}" '
            f'SubslotNumber="{0x8000 + port}" TextId="Word" MAUTypes="16" MaxPortRxDelay="1" MaxPortTxDelay="1">'
            '<MAUTypeList><MAUTypeItem Value="16"/></MAUTypeList></PortSubmoduleItem>'
            for port in (1, 2)
        )
        return (
            f'<DeviceAccessPointItem ID="{name}" PhysicalSlots="0..6" ModuleIdentNumber="0x{ident:08X}" '
            'MinDeviceInterval="32" DNS_CompatibleName="drive" FixedInSlots="0" ObjectUUID_LocalIndex="1" '
            'ImplementationType="Sample" RequiredSchemaVersion="V2.3" MultipleWriteSupported="true" '
            'AddressAssignment="DCP" DeviceAccessSupported="true" PNIO_Version="V2.3" CheckDeviceID_Allowed="true" '
            'NameOfStationNotTransferable="false" LLDP_NoD_Supported="true" ResetToFactoryModes="2">'
            f'<ModuleInfo><Name TextId="{name}"/><InfoText TextId="Info"/><OrderNumber Value="{order}"/></ModuleInfo>'
            '<CertificationInfo ConformanceClass="B" ApplicationClass="" NetloadClass="I"/>'
            '<IOConfigData MaxInputLength="244" MaxOutputLength="244"/>'
            f"<UseableModules>{refs}</UseableModules><VirtualSubmoduleList>"
            f'<VirtualSubmoduleItem ID="{name}_1" SubmoduleIdentNumber="0x00000001" MayIssueProcessAlarm="false">'
            f'<IOData/><ModuleInfo><Name TextId="{name}"/><InfoText TextId="Info"/></ModuleInfo>'
            "</VirtualSubmoduleItem></VirtualSubmoduleList><SystemDefinedSubmoduleList>"
            f'<InterfaceSubmoduleItem ID="{name}_IF" SubmoduleIdentNumber="0x00000002" SubslotNumber="32768" '
            'TextId="Word" SupportedRT_Classes="RT_CLASS_1" SupportedProtocols="SNMP;LLDP" '
            'DCP_HelloSupported="false" DCP_BoundarySupported="true" PTP_BoundarySupported="true">'
            '<ApplicationRelations StartupMode="Advanced;Legacy" NumberOfAR="2" PullModuleAlarmSupported="true">'
            '<TimingProperties SendClock="32" ReductionRatio="1 2 4 8 16 32 64"/></ApplicationRelations>'
            f"</InterfaceSubmoduleItem>{ports}</SystemDefinedSubmoduleList></DeviceAccessPointItem>"
        )

    points = access_point("Basic", 0x10, "DR-1", ("VECTOR",)) + access_point("Full", 0x20, "DR-2", tuple(_OBJECTS))
    words = "".join(f'<Text TextId="{key}" Value="{text}"/>' for key, text in texts.items())
    namespace = "http://www.profibus.com/GSDML/2003/11/DeviceProfile"
    return "\n".join((
        '<?xml version="1.0" encoding="utf-8"?>',
        f'<ISO15745Profile xmlns="{namespace}" xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance"',
        f'xsi:schemaLocation="{namespace} ..\\xsd\\GSDML-DeviceProfile-V2.35.xsd">',
        "<ProfileHeader><ProfileIdentification>PROFINET Device Profile</ProfileIdentification>",
        "<ProfileRevision>1.00</ProfileRevision><ProfileName>Device Profile for PROFINET Devices</ProfileName>",
        "<ProfileSource>PROFIBUS Nutzerorganisation e. V. (PNO)</ProfileSource><ProfileClassID>Device</ProfileClassID>",
        "<ISO15745Reference><ISO15745Part>4</ISO15745Part><ISO15745Edition>1</ISO15745Edition>",
        "<ProfileTechnology>GSDML</ProfileTechnology></ISO15745Reference></ProfileHeader>",
        '<ProfileBody><DeviceIdentity VendorID="0xFEED" DeviceID="0x0D01">',
        '<InfoText TextId="Info"/><VendorName Value="Sample Works"/></DeviceIdentity>',
        '<DeviceFunction><Family MainFamily="Drives" ProductFamily="Servo"/></DeviceFunction>',
        f"<ApplicationProcess><DeviceAccessPointList>{points}</DeviceAccessPointList>",
        f"<ModuleList>{objects}</ModuleList>",
        f"<SubmoduleList>{''.join(listed)}</SubmoduleList>",
        '<ChannelDiagList><ChannelDiagItem ErrorType="256"><Name TextId="Hot"/></ChannelDiagItem>',
        '<ProfileChannelDiagItem API="14848" ErrorType="36872"><Name TextId="Bus"/></ProfileChannelDiagItem>',
        "</ChannelDiagList>",
        f"<ExternalTextList><PrimaryLanguage>{words}</PrimaryLanguage></ExternalTextList>",
        "</ApplicationProcess></ProfileBody></ISO15745Profile>",
        "",
    ))  # fmt: skip
