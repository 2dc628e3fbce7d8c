"""What is legible of Appendix B of the AKD EtherNet/IP manual: pieces of its text, and the rows that each gives.

The scan broke the table into columns.  A piece is a run of its text whose rows are certain by the order of the
parameters.  A size is in octets; None where the piece has none.
"""

from __future__ import annotations

Row = tuple[int, str | None, int | None]

LEGIBLE: list[tuple[str, list[Row]]] = [
    (
        "4 Byte 2 Byte 4 Byte 2 Byte Signed 8 Byte 2 Byte 4 Byte 4 Byte 2 Byte 8 Byte 8 Byte Signed",
        [
            (number, None, size)
            for number, size in zip(
                (1, 2, 3, 4, 5, 7, 8, 10, 11, 13, 15),
                (4, 2, 4, 2, 8, 2, 4, 4, 2, 8, 8),
                strict=True,
            )
        ],
    ),
    ("8 Byte Signed 4 Byte 1 Byte 4 Byte", [(17, None, 8), (19, None, 4), (20, None, 1), (21, None, 4)]),
    (
        "8 1 Byte 9 4 Byte 0 1 Byte 1 1 Byte 2 1 Byte 3 1 Byte 4 1 Byte 5 1 Byte 6",
        [(38, None, 1), (39, None, 4), *((number, None, 1) for number in range(40, 46))],
    ),
    (
        "1 Byte 1 Byte 1 Byte 1 Byte 4 Byte 1 Byte 8 byte 1 Byte 4 Byte 8 Byte 1 Byte 1 Byte 1 Byte 2 Byte",
        [
            (number, None, size)
            for number, size in zip(
                (48, 49, 50, 51, 52, 53, 54, 56, 57, 58, 59), (1, 1, 1, 1, 4, 1, 8, 1, 4, 8, 1), strict=True
            )
        ],
    ),
    ("127 2 Byte 128 DRV EN", [(127, None, 2), (128, "DRV.EN", None)]),
    ("1Byte 4Byte 1Byte", [(129, None, 1), (130, None, 4), (131, None, 1)]),
    (
        "180 4 Byte 181 4 Byte 182 4 Byte 83 1 Byte 8 Byte 8 Byte 2 Byte 2 Byte",
        [
            (180, None, 4), (181, None, 4), (182, None, 4), (183, None, 1), (184, None, 8), (186, None, 8),
            (188, None, 2), (189, None, 2),
        ],
    ),
    ("06 HOME P", [(206, "HOME.P", None)]),
    (
        "27 4 Byte Float 28 IL KP 2Byte Float 29 4 Byte Float",
        [(227, None, 4), (228, "IL.KP", 2), (229, None, 4)],
    ),
    ("69 MT DEC", [(269, "MT.DEC", None)]),
    (
        "12 PLS P1 14 PLS P2 16 PLS P3 18 PLS P4",
        [(312, "PLS.P1", None), (314, "PLS.P2", None), (316, "PLS.P3", None), (318, "PLS.P4", None)],
    ),
    (
        "320 PLS P5 322 PLS P6 324 PLS P7 326 PLS P8",
        [(320, "PLS.P5", None), (322, "PLS.P6", None), (324, "PLS.P7", None), (326, "PLS.P8", None)],
    ),
    (
        "PLS T1 31 PLS T2 32 PLS T3 33 PLS T4 34 PLS T5 35 PLS T6 36 PLS T7 37 PLS T8",
        [(329 + n, f"PLS.T{n}", None) for n in range(1, 9)],
    ),
    ("76 SM MODE TI SM MOVE 78 SM T1 79 SM T2 80 SM V1 81 SM V2", [
        (376, "SM.MODE", None), (377, "SM.MOVE", None), (378, "SM.T1", None), (379, "SM.T2", None),
        (380, "SM.V1", None), (381, "SM.V2", None),
    ]),
    ("05 VL ARPF1 06 VL ARPF2 07 VL ARPF3 08 VL ARPF4", [(404 + n, f"VL.ARPF{n}", None) for n in range(1, 5)]),
    ("12 VL ARPQ4 4 Byte Float 13 VL ARTYPE1 1Byte Integer", [(412, "VL.ARPQ4", 4), (413, "VL.ARTYPE1", 1)]),
    (
        "14 1Byte 15 1Byte 16 1Byte 17 4Byte 18 4Byte 19 4Byte 20 4Byte 21 4Byte 22 4Byte 23 4Byte 24 4 Byte",
        [*((n, None, 1) for n in range(414, 417)), *((n, None, 4) for n in range(417, 425))],
    ),
    ("28 VL ERR 29 VL FB", [(428, "VL.ERR", None), (429, "VL.FB", None)]),
    ("41 VL LMJR 42 VL MODEL 43 VL OBSBW", [
        (441, "VL.LMJR", None), (442, "VL.MODEL", None), (443, "VL.OBSBW", None),
    ]),
    (
        "52 WS MODE 1 Byte 53 1 Byte 54 1 Byte 55 2 Byte 56 2 Byte 57 2 Byte 58 2 Byte",
        [(452, "WS.MODE", 1), (453, None, 1), (454, None, 1), *((n, None, 2) for n in range(455, 459))],
    ),
    ("Instance Parameter Data Size Data Type 90 2 Byte", [(490, None, 2)]),
    ("28 1 Byte", [(528, None, 1)]),
    ("22 AIN2 MODE", [(622, "AIN2.MODE", None)]),
    ("766 1 Byte 767 1 Byte 768 1 Byte", [(766, None, 1), (767, None, 1), (768, None, 1)]),
    ("16 2 Byte 17 FB2 P", [(816, None, 2), (817, "FB2.P", None)]),
    ("869 REGEN POWERFILTERED 8Byte", [(869, "REGEN.POWERFILTERED", 8)]),
    ("VBUS VALUE 2 Byte 8193 STATUS3 1 Byte 8195 DIN STATES 1Byte", [
        (8193, "STATUS3", 1), (8195, "DIN.STATES", 1),
    ]),
    ("579 VM START 580 VM STATE 581 VM STOP 582 VM ERR", [
        (579, "VM.START", None), (580, "VM.STATE", None), (581, "VM.STOP", None), (582, "VM.ERR", None),
    ]),
    # elsewhere in the manual
    ("Instance 113 DRV CLRFAULTS", [(113, "DRV.CLRFAULTS", None)]),
    ("Instance 470 DRV NVSAVE", [(470, "DRV.NVSAVE", None)]),
    ("HOME MOVE instance 205", [(205, "HOME.MOVE", None)]),
    ("DRV FAULT1 DRV FAULT3 are at indexes 478 480", [(478, "DRV.FAULT1", None), (480, "DRV.FAULT3", None)]),
    ("383 SWLS EN 2Byte", [(383, "SWLS.EN", 2)]),
    ("386 SWLS LIMIT1", [(386, "SWLS.LIMIT1", None)]),
]  # fmt: skip
