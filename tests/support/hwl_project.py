"""Hardware of SIMATIC AX, in the form of its public examples."""

ISLAND = "GSDML-V2.35-EXAMPLE-ISLAND-20261127.XML"
TEMPLATES = f"""
Templates:
  Modules:
    - Name: head
      Placeholders: [{{Name: NAME}}, {{Name: IP}}, {{Name: STATION, Value: island-9}}]
      Content:
        Name: ${{NAME}}
        TypeIdentifier: {{FileName: {ISLAND}, GsdId: DAP 1}}
        Interfaces:
          - Name: PN-IO
            Addresses: {{Configured: [{{IPv4: "${{IP}}"}}, {{ProfinetDeviceName: "${{STATION}}"}}]}}
    - Name: inputs
      Placeholders: [{{Name: SLOT, Value: 1}}]
      Content: {{Name: di, TypeIdentifier: {{FileName: {ISLAND}, GsdId: DI16}}, Slot: "${{SLOT}}"}}
    - Name: empty
      Content: {{Name: none, TypeIdentifier: NotAssigned}}
  Devices:
    - Name: island
      Placeholders: [{{Name: NAME}}, {{Name: IP}}, {{Name: FIRST, Value: empty}}]
      Content:
        Name: ${{NAME}}
        Modules:
          - Apply: head
            Arguments: {{NAME: head, IP: "${{IP}}", STATION: "${{NAME}}"}}
          - Apply: ${{FIRST}}
          - Name: out
            TypeIdentifier: {{FileName: {ISLAND}, GsdId: DO8}}
"""
DEVICES = f"""
Devices:
  - Name: plc
    Modules:
      - Name: plc_1
        TypeIdentifier: {{OrderNumber: 6ES7 516-3AP03-0AB0, Version: V3.1}}
        Interfaces:
          - Name: x1
            Addresses: {{Configured: [{{IPv4: 10.7.0.1/24}}, {{ProfinetDeviceName: plc_1}}]}}
  - Apply: island
    Arguments: {{NAME: island_1, IP: 10.7.0.41/24, FIRST: inputs}}
  - Apply: {{TemplateName: island, Arguments: {{NAME: island-2, IP: 10.7.0.42}}}}
  - Name: island-3
    Modules:
      - {{Apply: head, Arguments: {{NAME: head, IP: 10.7.0.43/24, STATION: island-3}}}}
      - Name: carrier
        TypeIdentifier: {{FileName: {ISLAND}, GsdId: CARRIER}}
        Slot: 4
        Submodules:
          - {{Name: a, TypeIdentifier: {{FileName: {ISLAND}, GsdId: PLUG_IO8}}, Slot: 3}}
          - {{Name: b, TypeIdentifier: {{FileName: {ISLAND}, GsdId: PLUG_OUT4}}, Position: 5}}
IoSystems:
  - Name: line
    ControllerInterfaces: [{{Ref: plc/plc_1/x1}}]
    DeviceInterfaces:
      - {{Ref: island_1/head/PN-IO, Parameters: {{PnWatchdogFactor: 7}}}}
      - {{Ref: island-2/head/PN-IO}}
      - {{Ref: island-3/head/PN-IO}}
"""
