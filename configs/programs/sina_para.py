"""SINA_PARA: reads or writes up to 16 parameters of a drive, with the inputs and outputs of Siemens' block.

Written from the public documentation of SinaPara and SinaParaS (GitHub simatic-ax/sinamics-drive-functions,
docs/SinaPara) and of the profile's parameter access (requests and responses in record 47, formats).  Not said there,
and so assumed:

- `Start` = 0 ends a job at any time, and takes Done and Error back; Ready means that none runs;
- bit n - 1 of the first word of ErrorId is parameter n; the second word is 1 for a request that got no answer;
- DiagId: octets 2 and 3 of the drive's status, if a record was refused (0x80B5: it works on the request still); 0xFFFF
  without a status or an answer;
- a job gives up after ten seconds; ParaNo beyond 1 to 16, and a value that its format cannot hold, are errors at once;
- values of a byte, word or REAL are in srValue, those of a double word in sdValue (SinaParaS has them so).

A program of your own derives from it: it sets inputs, and calls `super().cycle(inputs, outputs, now)`.
"""

import struct
from dataclasses import dataclass, field

from pnfarm import AxisProgram

RECORD = 47
READ, CHANGE, VALUE = 1, 2, 0x10
ERROR = 0x44
#: Format -> how its value is packed: signed and unsigned numbers of 1, 2 and 4 octets, REAL; byte, word, double word.
FORMATS = {
    0x02: ">bx", 0x03: ">h", 0x04: ">i", 0x05: ">Bx", 0x06: ">H", 0x07: ">I", 0x08: ">f",
    0x41: ">Bx", 0x42: ">H", 0x43: ">I", 0x44: ">H",
}  # fmt: skip
DOUBLE = (0x04, 0x07, 0x43)
NOTHING = (0x00, 0x40)  # no value follows: this parameter was written
BUSY = 0x80B5  # the drive works on the request still
MOST = 16
LIMIT_NS = 10_000_000_000
NO_ANSWER = 1


@dataclass
class SinaParameter:
    siParaNo: int = 0
    siIndex: int = 0
    srValue: float = 0.0
    sdValue: int = 0
    syFormat: int = 0
    swErrorNo: int = 0


@dataclass
class Job:
    """What is asked, step by step: a write reads the formats first."""

    code: int
    began_ns: int
    record: object = None
    wrote: bool = False
    asked: list[SinaParameter] = field(default_factory=list)


class SinaPara(AxisProgram):
    # inputs
    Start: bool = False
    ReadWrite: bool = False  # 0 = read, 1 = write
    ParaNo: int = 1
    AxisNo: int = 1
    # outputs
    Ready: bool = True
    Busy: bool = False
    Done: bool = False
    Error: bool = False
    ErrorId: int = 0
    DiagId: int = 0

    def __init__(self):
        self.sxParameter = [SinaParameter() for _ in range(MOST + 1)]  # [1] to [16]
        self.job = None
        self.started = False
        self.reference = 0

    def cycle(self, inputs, outputs, now):
        if not self.Start:
            self.job, self.Busy, self.Done, self.Error, self.ErrorId, self.DiagId = None, False, False, False, 0, 0
        elif not self.started:
            self._begin(READ, now)
        elif self.job is not None:
            self._go_on(now)
        self.started, self.Ready = self.Start, self.job is None

    def _begin(self, code, now):
        if not 1 <= self.ParaNo <= MOST:
            self._end(error=NO_ANSWER)
            return
        self.Busy, self.job = True, Job(code, now, asked=self.sxParameter[1 : self.ParaNo + 1])
        self.reference = self.reference % 0xFF + 1
        request = struct.pack(">4B", self.reference, code, self.AxisNo, self.ParaNo)
        try:
            for one in self.job.asked:
                request += struct.pack(">BBHH", VALUE, 1, one.siParaNo, one.siIndex)
            for one in self.job.asked if code == CHANGE else ():
                value = one.sdValue if one.syFormat in DOUBLE else one.srValue
                pack = FORMATS[one.syFormat]
                request += struct.pack(">BB", one.syFormat, 1) + struct.pack(pack, value if "f" in pack else int(value))
        except (struct.error, KeyError, ValueError, OverflowError):
            self._end(error=NO_ANSWER)
            return
        self.job.record = self.write_record(RECORD, request)

    def _go_on(self, now):
        record, job = self.job.record, self.job
        late = now - job.began_ns > LIMIT_NS
        if not record.done and not late:
            return
        refused = record.status >> 8 & 0xFFFF
        if late or (record.failure and not (job.wrote and refused == BUSY)):
            self._end(error=NO_ANSWER, diag=refused or 0xFFFF)
        elif record.failure or not job.wrote:
            job.wrote, job.record = True, self.read_record(RECORD)
        else:
            self._take(record.data, now)

    def _take(self, answer, now):
        wrong = self._values(answer)
        if wrong is None:
            self._end(error=NO_ANSWER, diag=0xFFFF)
        elif wrong or self.job.code == CHANGE or not self.ReadWrite:
            self._end(error=wrong << 16)
        else:
            self._begin(CHANGE, now)

    def _values(self, answer):
        """Take the answer; which parameters are wrong, bit by bit; None where it is no answer to the request."""
        asked, wrong, place = self.job.asked, 0, 4
        if len(answer) < place or answer[0] != self.reference or answer[1] & 0x7F != self.job.code:
            return None
        for number, one in enumerate(asked if len(answer) > place else ()):
            if len(answer) < place + 2:
                return None
            code, count = answer[place], answer[place + 1]
            if code in NOTHING:
                place += 2
                continue
            pack = FORMATS.get(code)
            if pack is None or not count or len(answer) < place + 2 + struct.calcsize(pack):
                return None
            (value,) = struct.unpack_from(pack, answer, place + 2)
            place += 2 + struct.calcsize(pack) * (count if code == ERROR else 1)
            if code == ERROR:
                one.swErrorNo, wrong = value, wrong | 1 << number
                continue
            one.swErrorNo, one.syFormat = 0, code
            if self.ReadWrite:
                continue  # what is to be written stays
            one.srValue, one.sdValue = (one.srValue, value) if code in DOUBLE else (float(value), one.sdValue)
        return wrong

    def _end(self, error=0, diag=0):
        self.job, self.Busy = None, False
        self.Done, self.Error, self.ErrorId, self.DiagId = not error, bool(error), error, diag


class ReadsOnce(SinaPara):
    """The block in use: it reads the telegram (922) and the identification (964, index 0 to 3) once."""

    def cycle(self, inputs, outputs, now):
        outputs["STW1"] = 0x0400
        self.sxParameter[1].siParaNo, self.ParaNo = 922, 5
        for index in range(4):
            self.sxParameter[2 + index].siParaNo, self.sxParameter[2 + index].siIndex = 964, index
        self.Start = inputs.valid
        super().cycle(inputs, outputs, now)
