"""A soak in pieces: stopped, gone on with, refused; slopes of series with and without a leak; the report."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from random import Random

import pytest

from tests.soak.cell import on_serial_line
from tests.soak.kept import Kept, KeptError
from tests.soak.losses import Losses
from tests.soak.pieces import run_pieces
from tests.soak.report import page, verdict
from tests.soak.slopes import BOUNDS, MIB, _student, slope, slope_check

ROOT = Path(__file__).resolve().parents[2]
OPTIONS = {"hours": 1.0, "piece": 1200.0, "seed": 7, "drives": 8, "rate": 1.5, "link": "veth", "virtual": False}


# -- pieces


def piece_of(seconds: float, leak: float = 0.0, **more):
    """The report of a piece whose farm grows by so many octets an hour."""
    samples = [
        {"seconds": float(at), "farm pid": 1, "farm rss": 200 * MIB + leak * at / 3600, "farm cpu": at * 0.3}
        for at in range(0, int(seconds) + 1, 10)
    ]
    return {
        "seconds": seconds, "samples": samples, "checks": [{"name": "no fault left", "ok": True, "told": "none"}],
        "actions": {"fault": 10, "fault 201": 9}, "kinds": {"loss": 3}, "losses": {"loss": 2},
        "returns": {"loss": [1.5, "akd-01"]}, **more,
    }  # fmt: skip


class Runs:
    """Runs of pieces, without programs: ``codes`` are their exit codes, 0 after the last one."""

    def __init__(self, *codes: int, **more) -> None:
        self.codes, self.more = list(codes), more
        self.asked: list[tuple[float, int]] = []

    def __call__(self, seconds: float, seed: int, out: Path) -> int:
        self.asked.append((seconds, seed))
        code = self.codes.pop(0) if self.codes else 0
        ran = {0: seconds, 1: seconds, 130: seconds / 2}.get(code)
        if ran is not None:
            out.write_text(json.dumps(piece_of(ran, **self.more)))
        return code


def test_a_soak_is_run_in_pieces_each_with_a_seed_of_its_own_until_nothing_is_left(tmp_path):
    path, runs = tmp_path / "soak.json", Runs()
    assert run_pieces(Kept.of(path, OPTIONS), path, runs, 1e9) == 0
    assert runs.asked == [(1200.0, 7001), (1200.0, 7002), (1200.0, 7003)]
    kept = Kept.read(path)
    assert (kept.left, [piece["number"] for piece in kept.pieces]) == (0.0, [1, 2, 3])
    assert sorted(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("name", ["soak.json", "soak.json.xz"])
def test_one_that_was_interrupted_keeps_what_it_had_and_is_gone_on_with(tmp_path, name):
    path = tmp_path / name
    assert run_pieces(Kept.of(path, OPTIONS), path, Runs(0, 130), 1e9) == 130
    kept = Kept.of(path, OPTIONS)
    assert (len(kept.pieces), kept.seconds) == (2, 1800.0)
    again = Runs()
    assert run_pieces(kept, path, again, 1e9) == 0
    assert again.asked == [(1200.0, 7003), (600.0, 7004)]
    assert Kept.read(path).seconds == 3600.0


def test_it_stops_behind_the_time_that_it_has_today(tmp_path):
    path, runs = tmp_path / "soak.json", Runs()
    assert run_pieces(Kept.of(path, OPTIONS), path, runs, 1500.0) == 0
    assert [seconds for seconds, _ in runs.asked] == [1200.0, 300.0]
    assert Kept.read(path).left == 2100.0


def test_a_piece_that_fails_is_kept_and_the_next_one_begins_but_not_if_it_never_began(tmp_path):
    path = tmp_path / "soak.json"
    assert run_pieces(Kept.of(path, OPTIONS), path, Runs(1), 1e9) == 0
    assert [piece["code"] for piece in Kept.read(path).pieces] == [1, 0, 0]
    other, runs = tmp_path / "other.json", Runs(4)
    assert run_pieces(Kept.of(other, OPTIONS), other, runs, 1e9) == 4
    assert (len(runs.asked), other.exists()) == (1, False)


@pytest.mark.parametrize(
    ("changed", "told"),
    [({"seed": 8}, "--seed 7, not 8"), ({"drives": 9}, "--drives 8, not 9"), ({"virtual": True}, "--virtual False")],
)
def test_another_soaks_file_is_refused_with_what_differs(tmp_path, changed, told):
    path = tmp_path / "soak.json"
    Kept.of(path, OPTIONS).write(path)
    with pytest.raises(KeptError, match=told):
        Kept.of(path, OPTIONS | changed)


@pytest.mark.parametrize("text", ["", "[]", '{"soak": 99}', '{"soak": 1, "opt'])
@pytest.mark.parametrize("name", ["soak.json", "soak.json.xz"])
def test_a_file_that_no_soak_wrote_is_refused(tmp_path, text, name):
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(KeptError, match="no state of a soak"):
        Kept.of(path, OPTIONS)


def soak(path: Path) -> subprocess.Popen[str]:
    command = [
        sys.executable, "-m", "tests.soak", "--virtual", "--drives", "1", "--hours", "1", "--piece", "1s",
        "--state", str(path),
    ]  # fmt: skip
    return subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True, start_new_session=True)


@pytest.mark.slow
def test_a_killed_soak_in_virtual_time_loses_the_piece_at_work_alone_and_goes_on(tmp_path):
    path = tmp_path / "soak.json"
    with soak(path) as begun:
        while not begun.stdout.readline().startswith("piece 2"):
            assert begun.poll() is None
        begun.kill()
    (kept,) = Kept.read(path).pieces
    assert (kept["seed"], kept["code"], kept["seconds"] >= 1) == (1001, 0, True)
    with soak(path) as again:
        assert again.stdout.readline().startswith("piece 2, seed 1002")
        again.terminate()
        said = again.stdout.read()
    assert again.returncode == 130, said
    assert f"in 1 pieces, in {path}" in said


# -- slopes


def slope_of(runs):
    """Of series of an hour, whose first ten minutes are left out."""
    return slope(runs, warm=600.0)


def noise(rng: Random, count: int, keeps: float) -> list[float]:
    """Of deviation 1; each keeps this part of the one before."""
    found, last = [], rng.gauss(0, 1)
    for _ in range(count):
        last = keeps * last + rng.gauss(0, 1) * (1 - keeps**2) ** 0.5
        found.append(last)
    return found


def runs_of(seed: int, per_hour: float, *, pieces: int = 8, keeps: float = 0.9, warm: float = 0.0):
    """Series of an hour each, at levels of their own, that rise in the first minutes."""
    rng = Random(seed)
    found = []
    for _ in range(pieces):
        level, each = rng.uniform(100, 300), noise(rng, 360, keeps)
        found.append(
            [
                (at * 10.0, level + per_hour * at / 360 + value + warm * min(1.0, at / 50))
                for at, value in enumerate(each)
            ]
        )
    return found


def test_a_leak_is_found_and_a_warm_up_is_none():
    flat = slope_of(runs_of(1, 0.0, warm=100.0))
    leak = slope_of(runs_of(1, 5.0, warm=100.0))
    assert flat.low < 0 < flat.high
    assert leak.low < 5.0 < leak.high
    assert leak.low > 3.0


@pytest.mark.parametrize("keeps", [0.0, 0.9, 0.97])
def test_intervals_have_the_slope_in_them_as_often_as_they_say_also_if_samples_resemble_their_neighbours(keeps):
    found = [slope_of(runs_of(seed, 2.0, keeps=keeps, pieces=6)) for seed in range(100)]
    assert sum(one.low <= 2.0 <= one.high for one in found) >= 88
    # and they are not so wide that they would have anything in them
    assert max(one.half for one in found) < 8.0


def test_slopes_that_differ_from_process_to_process_make_the_interval_wider():
    alike = slope_of([run for seed in range(6) for run in runs_of(seed, 0.0, pieces=1, keeps=0.0)])
    different = slope_of([run for seed in range(6) for run in runs_of(seed, 4.0 * (seed % 2), pieces=1, keeps=0.0)])
    assert different.half > 2 * alike.half
    assert different.low < 2.0 < different.high


def test_too_little_is_no_slope():
    assert slope_of([]) is None
    assert slope_of([[(at * 10.0, 1.0) for at in range(90)]]) is None


@pytest.mark.parametrize(("leak", "ok"), [(0.0, True), (0.5, True), (3.0, False)])
def test_memory_is_judged_by_the_interval_against_a_mebibyte_an_hour(leak, ok):
    runs = [[(at, MIB * (200 + value / 10)) for at, value in run] for run in runs_of(3, 10 * leak)]
    assert slope_check("farm", "rss", slope_of(runs)).ok is ok


def test_an_interval_with_the_bound_in_it_is_not_judged():
    runs = [[(at, MIB * value) for at, value in run] for run in runs_of(3, 1.0, pieces=1)]
    check = slope_check("farm", "rss", slope_of(runs))
    assert check.ok is None
    assert "too short to judge" in check.told


@pytest.mark.parametrize(("free", "quantile"), [(4, 2.776), (5, 2.571), (8, 2.306), (20, 2.086), (200, 1.972)])
def test_the_interval_is_students(free, quantile):
    assert _student(free) == pytest.approx(quantile, rel=0.003)


def test_no_slope_is_not_judged():
    check = slope_check("farm", "rss", None)
    assert (check.ok, check.told) == (None, "too short to judge")


def test_what_never_changes_has_no_interval():
    found = slope_of([[(at * 10.0, 7.0) for at in range(360)]])
    assert (found.per_hour, found.half) == (0.0, 0.0)
    assert slope_check("hub", "threads", found).ok is True


# -- losses


def entry(at, event, drive="akd-01", **more):
    return {"time": at, "event": event, "drive": drive, **more}


def losses_of(*entries):
    losses = Losses("time")
    for one in entries:
        losses.entry(one)
    return losses


def verdicts(losses):
    return [check.ok for check in losses.checks()]


INJECTED = entry(10.0, "fault injected", id="f", kind="silence")
ENDED = entry(13.0, "injected fault ended", id="f", kind="silence")
LOST, BACK = entry(10.6, "ar aborted"), entry(14.5, "ar established")


def test_a_loss_in_a_fault_has_its_reason_and_the_return_counts_from_the_end_of_the_fault():
    losses = losses_of(INJECTED, LOST, ENDED, BACK)
    assert verdicts(losses) == [True, True]
    assert losses.report() == {
        "losses": {"silence": 1}, "unexplained": [], "returns": {"silence": [1.5, "akd-01"]},
    }  # fmt: skip


def test_a_fault_of_the_axis_is_no_reason_for_a_loss():
    assert verdicts(losses_of(entry(10.0, "fault injected", id="f", kind="f702"), LOST, BACK)) == [False, True]


def test_a_fault_that_breaks_at_once_and_is_in_the_log_behind_the_loss_is_its_reason():
    late = entry(10.6, "fault injected", id="f", kind="ar-abort")
    assert verdicts(losses_of(LOST, late, BACK)) == [True, True]
    assert verdicts(losses_of(LOST, {**late, "time": 11.6}, BACK)) == [False, True]


def test_a_fault_of_many_stations_is_the_reason_of_the_first_that_it_broke():
    """It is noted for all of them behind the last one, with the time at which it began."""
    lost = entry(10.6, "ar aborted", farm_seconds=500.0)
    late = entry(10.9, "fault injected", id="f", kind="watchdog-expire", farm_seconds=500.0)
    assert verdicts(losses_of(lost, late, BACK)) == [True, True]
    assert verdicts(losses_of(lost, {**late, "farm_seconds": 500.2}, BACK)) == [False, True]


def test_noise_of_one_slave_is_a_reason_for_the_others_of_its_line_alone():
    noise = entry(10.0, "fault injected", drive="dp-01", id="f", kind="line-noise")
    for of, drive, kind, ok in (
        ("dp-01", "slave", "line-noise", True),
        ("dp-01", "akd-01", "line-noise", False),
        ("dp-01", "slave", "silence", False),
        ("akd-01", "slave", "delay", False),
    ):
        losses = Losses("time", on_serial_line)
        losses.entry({**noise, "kind": kind, "drive": of})
        losses.entry(entry(10.5, "connection lost", drive=drive))
        assert verdicts(losses)[0] is ok


def test_of_several_reasons_the_one_that_is_in_force_counts_and_of_those_the_newest():
    over = entry(10.2, "fault injected", id="g", kind="delay"), entry(10.4, "injected fault ended", id="g")
    assert losses_of(INJECTED, *over, LOST).report()["losses"] == {"silence": 1}
    assert losses_of(INJECTED, over[0], LOST).report()["losses"] == {"delay": 1}


def test_a_loss_counts_once_whatever_is_found_out_later():
    late = entry(10.6, "fault injected", id="f", kind="ar-abort")
    assert losses_of(LOST, late, BACK).report()["losses"] == {"ar-abort": 1}


def test_a_released_connection_is_no_loss_but_its_station_is_to_come_back():
    released = entry(10.6, "ar released")
    assert losses_of(released).away == {"akd-01": (10.6, "released")}
    losses = losses_of(BACK, INJECTED, released, ENDED, BACK)
    assert verdicts(losses) == [True, True]
    assert losses.report() == {"losses": {}, "unexplained": [], "returns": {"silence": [1.5, "akd-01"]}}


def test_an_unexplained_loss_is_named_with_what_was_in_the_log_around_it():
    losses = losses_of(entry(8.0, "state changed"), LOST, entry(12.6, "state changed"), BACK)
    told = "akd-01 at 10.600: {'time': 10.6, 'event': 'ar aborted', 'drive': 'akd-01'}"
    assert losses.checks()[0].told == told
    assert losses.unexplained_at == {told: 10.6}
    assert losses.around(10.6, 2.0) == ["+0.000 akd-01 ar aborted", "+2.000 akd-01 state changed"]


def test_a_loss_without_a_reason_and_one_long_after_it_are_found():
    assert verdicts(losses_of(LOST, BACK)) == [False, True]
    assert verdicts(losses_of(INJECTED, ENDED, entry(40.0, "connection lost"), entry(41.0, "ar established"))) == [
        False, True,
    ]  # fmt: skip
    other = entry(10.6, "ar aborted", drive="msd-01")
    assert verdicts(losses_of(INJECTED, other, entry(11.0, "ar established", drive="msd-01"))) == [False, True]


def test_a_station_that_stays_away_is_found():
    assert verdicts(losses_of(INJECTED, LOST, ENDED)) == [True, False]


def test_a_fault_of_one_axis_is_a_reason_for_its_station_and_a_program_for_all():
    axis = entry(10.0, "fault injected", drive="system.b", id="f", kind="silence")
    assert verdicts(losses_of(axis, entry(11.0, "ar aborted", drive="system"))) == [True, False]
    losses = Losses("time")
    outage = losses.begin("controller: kill", 10.0)
    losses.entry(LOST)
    outage.end = 12.0
    losses.entry(BACK)
    assert losses.report()["returns"] == {"controller: kill": [2.5, "akd-01"]}


def test_a_loss_that_the_farm_owns_up_to_is_its_machines():
    losses = losses_of(entry(1.0, "connection lost", cause="farm"), entry(2.0, "connection established"))
    assert verdicts(losses) == [True, True]
    assert losses.by_reason == {"the farm was late": 1}


def test_a_loss_when_the_controller_did_not_run_is_its_machines():
    losses = losses_of(LOST, BACK)
    losses.stood("the controller did not run", 4.0, 1.0)
    assert verdicts(losses) == [False, True]
    losses.stood("the controller did not run", 9.9, 0.5)
    assert verdicts(losses) == [True, True]
    assert +losses.by_reason == {"the controller did not run": 1}
    losses = losses_of(LOST, BACK)
    losses.stood("the controller did not run", 2.0, 6.0)
    assert verdicts(losses) == [True, True], "8 s and a moment"


# -- report


def kept_of(*pieces):
    each = {"commit": "abc", "began": "2026-01-01 00:00:00", "code": 0, "machine": {
        "cores": 2, "kernel": "Linux 6", "python": "CPython 3.11", "architecture": "x86_64"}}  # fmt: skip
    return Kept(
        OPTIONS | {"hours": 5.0},
        [{"number": n, "seed": 7000 + n, **each, **piece} for n, piece in enumerate(pieces, 1)],
    )


def test_the_report_has_all_numbers_of_the_kept_pieces():
    bad = {"checks": [{"name": "no fault left", "ok": False, "told": "fault-9"}], "commit": "def+", "code": 1}
    text = page(kept_of(piece_of(6000.0), piece_of(6000.0, returns={"loss": [4.0, "msd-01"]}), piece_of(6000.0, **bad)))
    for part in (
        "**failed**", "5.00 of 5 h, in 3 pieces", "| seed | 7 |", "abc, def+", "2 cores, x86_64, Linux 6, CPython 3.11",
        "| no fault left | **FAILED** | piece 3: fault-9 |", "| farm: rss | ok | +0 MiB/h",
        "| loss | 4.0 s | msd-01 | 2 |", "| loss | 6 |", "| fault | 30 | 201: 27 |", "| loss | 9 |",
        "0.30 cores on average", "had changes that were not committed",
    ):  # fmt: skip
        assert part in text, part


def test_the_verdict_finds_what_grows_over_all_pieces():
    grown = {check.name: check.ok for check in verdict(kept_of(*[piece_of(6000.0, leak=2 * MIB)] * 3))}
    assert (grown["farm: rss"], grown["no fault left"]) == (False, True)
    assert set(BOUNDS) >= {"rss", "files", "threads", "tasks", "rows"}


def test_a_page_of_no_pieces_is_a_page():
    assert "so far held" in page(kept_of())
