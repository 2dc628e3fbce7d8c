from cm_support import UUID_1, Bench

from pnfarm.protocols.profinet.errors import OK, PnioStatus
from pnfarm.protocols.profinet.records.log_book import LogBook, LogDetail
from pnfarm.protocols.profinet.wire.records.iod import NIL_UUID
from pnfarm.protocols.profinet.wire.records.log_book import LogData, LogEntry


def noted(bench, book, now):
    for event in bench.events():
        book.note(event, now)


def test_the_book_shows_how_each_connection_began_and_ended():
    bench, book = Bench(), LogBook()
    key = bench.establish()
    noted(bench, book, 10)
    bench.cm.abort(key, 5, 20)
    noted(bench, book, 20)
    bench.establish()
    bench.release()
    noted(bench, book, 30)
    bench.call(0, b"")
    noted(bench, book, 40)
    data = book.data(50)
    assert data.time_stamp == 50
    assert [(e.time_stamp, e.ar_uuid, int(e.status), e.detail) for e in data.entries] == [
        (10, UUID_1, 0, LogDetail.CONNECTED),
        (20, UUID_1, 0xCF81FD05, LogDetail.ABORTED_BY_DEVICE),
        (30, UUID_1, 0, LogDetail.CONNECTED),
        (30, UUID_1, 0, LogDetail.RELEASED),
        (40, NIL_UUID, data.entries[-1].status.__int__(), LogDetail.CONNECT_REFUSED),
    ]
    assert data.entries[-1].status.error_code == 0xDB


def test_only_the_last_entries_are_kept():
    book = LogBook(size=3)
    for number in range(10):
        book.record(UUID_1, OK, number, number)
    assert [e.detail for e in book.data(10).entries] == [7, 8, 9]


def test_the_end_of_a_connection_without_an_entry_has_no_uuid():
    bench, book = Bench(), LogBook()
    bench.establish()
    bench.events()
    bench.release()
    noted(bench, book, 1)
    assert [(e.ar_uuid, e.detail) for e in book.data(1).entries] == [(NIL_UUID, LogDetail.RELEASED)]


def test_log_data_on_the_wire():
    entry = LogEntry(1_000_000_000, UUID_1, PnioStatus(0xCF, 0x81, 0xFD, 0x05), 3)
    assert LogData(2_000_000_000, (entry,)).emit().hex() == (
        "0019002c0100" + "0000000077359400" + "0001" + "000000003b9aca00" + UUID_1.hex + "cf81fd05" + "00000003"
    )
