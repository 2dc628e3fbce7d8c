"""The state tables of the alarm protocol machines (IEC 61158-6-10, APMS, APMR, ALPMI, ALPMR), as :mod:`priority`
runs them.

Machine  is between                           and is
-------  -----------------------------------  --------------------------------------------------------
APMS     ALPMI, ALPMR and the wire            the sender of DATA-RTA-PDUs: repeats until acknowledged
APMR     the wire and ALPMI, ALPMR            the receiver of DATA-RTA-PDUs: acknowledges, in sequence
ALPMI    sender of alarms and APMS, APMR      the initiator: an alarm out, its AlarmAck in
ALPMR    receiver of alarms and APMS, APMR    the responder: an alarm in, its AlarmAck out

Each priority of each AR has one of each.  WCNF is left within the same call, since a frame that is passed on counts as
sent.  A row's action is the name of a method of :class:`~pnfarm.protocols.profinet.alarms.priority.AlarmLine`, empty
for no action.  An input without a row changes nothing and is counted.
"""

from __future__ import annotations

from enum import StrEnum

from pnfarm.protocols.named import Named

__all__ = ["ALPMI", "ALPMR", "APMR", "APMS", "AlpmiState", "AlpmrState", "ApmrState", "ApmsState", "Sign"]


class ApmsState(StrEnum):
    CLOSED = "CLOSED"
    OPEN = "OPEN"
    WTACK = "WTACK"


class ApmrState(StrEnum):
    CLOSED = "CLOSED"
    OPEN = "OPEN"
    WCNF = "WCNF"


class AlpmiState(StrEnum):
    W_START = "W_START"
    W_ALARM = "W_ALARM"
    W_ACK = "W_ACK"


class AlpmrState(StrEnum):
    W_START = "W_START"
    W_NOTIFY = "W_NOTIFY"
    W_USER_ACK = "W_USER_ACK"
    W_TACK = "W_TACK"


class Sign(Named):
    """Inputs of the machines, named by service and primitive."""

    ACTIVATE = "Activate.req"
    CLOSE = "Close.req"
    # APMS
    DATA_REQ = "APMS_A_Data.req"
    TACK = "A_Data.ind acknowledges"
    TIMER = "TimerExpired"
    RETRIES_SPENT = "TimerExpired, no retry left"
    #: Not in the standard: see the module alarm, peers with one sequence.
    WITHDRAW = "withdrawn"
    # APMR
    DATA_IND = "A_Data.ind, expected SendSeqNum"
    DUPLICATE_IND = "A_Data.ind, last SendSeqNum"
    SEQUENCE_IND = "A_Data.ind, other SendSeqNum"
    DATA_CNF = "A_Data.cnf"
    # ALPMI
    ALARM_REQ = "ALPMI_Alarm.req"
    ALARM_ACK_IND = "APMR_A_Data.ind AlarmAck"
    # ALPMR
    NOTIFICATION_IND = "APMR_A_Data.ind AlarmNotification"
    ACK_REQ = "ALPMR_Alarm_Ack.req"
    # ALPMI and ALPMR
    SENT = "APMS_A_Data.cnf(+)"
    NOT_SENT = "APMS_A_Data.cnf(-)"


_S = ApmsState
APMS: dict[tuple[ApmsState, Sign], tuple[ApmsState, str]] = {
    (_S.CLOSED, Sign.ACTIVATE): (_S.OPEN, ""),
    (_S.OPEN, Sign.DATA_REQ): (_S.WTACK, "send_data"),
    (_S.OPEN, Sign.CLOSE): (_S.CLOSED, ""),
    (_S.WTACK, Sign.TACK): (_S.OPEN, "confirm_sent"),
    (_S.WTACK, Sign.TIMER): (_S.WTACK, "repeat_data"),
    (_S.WTACK, Sign.RETRIES_SPENT): (_S.OPEN, "confirm_not_sent"),
    (_S.WTACK, Sign.WITHDRAW): (_S.OPEN, "stop_timer"),
    (_S.WTACK, Sign.CLOSE): (_S.CLOSED, "stop_timer"),
}

_R = ApmrState
APMR: dict[tuple[ApmrState, Sign], tuple[ApmrState, str]] = {
    (_R.CLOSED, Sign.ACTIVATE): (_R.OPEN, ""),
    (_R.OPEN, Sign.DATA_IND): (_R.WCNF, "accept_data"),
    (_R.OPEN, Sign.DUPLICATE_IND): (_R.OPEN, "send_ack"),
    (_R.OPEN, Sign.SEQUENCE_IND): (_R.OPEN, "send_nack"),
    (_R.OPEN, Sign.CLOSE): (_R.CLOSED, ""),
    (_R.WCNF, Sign.DATA_CNF): (_R.OPEN, "deliver_data"),
    (_R.WCNF, Sign.CLOSE): (_R.CLOSED, ""),
}

_I = AlpmiState
ALPMI: dict[tuple[AlpmiState, Sign], tuple[AlpmiState, str]] = {
    (_I.W_START, Sign.ACTIVATE): (_I.W_ALARM, ""),
    (_I.W_ALARM, Sign.ALARM_REQ): (_I.W_ACK, "send_notification"),
    (_I.W_ALARM, Sign.SENT): (_I.W_ALARM, ""),
    (_I.W_ALARM, Sign.NOT_SENT): (_I.W_ALARM, "fail_notification"),
    (_I.W_ALARM, Sign.CLOSE): (_I.W_START, ""),
    (_I.W_ACK, Sign.SENT): (_I.W_ACK, ""),
    (_I.W_ACK, Sign.NOT_SENT): (_I.W_ALARM, "fail_notification"),
    (_I.W_ACK, Sign.ALARM_ACK_IND): (_I.W_ALARM, "confirm_alarm"),
    (_I.W_ACK, Sign.WITHDRAW): (_I.W_ALARM, ""),
    (_I.W_ACK, Sign.CLOSE): (_I.W_START, ""),
}

_T = AlpmrState
ALPMR: dict[tuple[AlpmrState, Sign], tuple[AlpmrState, str]] = {
    (_T.W_START, Sign.ACTIVATE): (_T.W_NOTIFY, ""),
    (_T.W_NOTIFY, Sign.NOTIFICATION_IND): (_T.W_USER_ACK, "indicate_alarm"),
    (_T.W_NOTIFY, Sign.CLOSE): (_T.W_START, ""),
    (_T.W_USER_ACK, Sign.ACK_REQ): (_T.W_TACK, "keep_ack"),
    (_T.W_USER_ACK, Sign.NOTIFICATION_IND): (_T.W_USER_ACK, "fail_protocol"),
    (_T.W_USER_ACK, Sign.CLOSE): (_T.W_START, ""),
    (_T.W_TACK, Sign.SENT): (_T.W_NOTIFY, ""),
    (_T.W_TACK, Sign.NOT_SENT): (_T.W_NOTIFY, "fail_ack"),
    (_T.W_TACK, Sign.NOTIFICATION_IND): (_T.W_TACK, "fail_protocol"),
    (_T.W_TACK, Sign.CLOSE): (_T.W_START, ""),
}
