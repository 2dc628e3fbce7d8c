"""Confirmed, contradicted, inconclusive: what the farm itself has seen of an injection."""

from fault_line import FaultLine

from pnfarm.faults.effects.evidence import NOTHING, Confirmation, Evidence


def test_a_fault_that_a_frame_reports_is_confirmed(line):
    fault = line.add("f702")
    line.run(0.1)
    seen = fault.evidence()
    assert (seen.confirmation, seen.reason) == (Confirmation.CONFIRMED, "")
    shown = fault.as_dict()["evidence"]
    assert (shown["confirmed"], shown["confirmation"], shown["reason"]) == (True, "confirmed", "")


def test_without_a_connection_nothing_can_show_it_and_it_is_inconclusive():
    line = FaultLine(controller=False)
    fault = line.add("not-ready")
    line.run(0.5)
    seen = fault.evidence()
    assert seen.confirmation is Confirmation.INCONCLUSIVE
    assert seen.reason == "it happened, and nothing that left the drive since could show it"


def test_what_had_nothing_to_act_on_and_what_chance_spared_are_told_apart():
    line = FaultLine(controller=False)
    loss = line.add("loss", params={"frames": "cyclic"})
    line.run(0.5)
    assert loss.evidence().reason == "there was nothing yet that it could act on"
    assert Evidence(7).reason == "it could have happened 7 times, and did not"


def test_frames_that_do_not_report_the_status_contradict_the_injection(line):
    fault = line.add("not-ready")
    # the drive gets back what the injection took away, behind its back
    line.farm.columns.axis[0].drive.settings.interlocks = 0
    line.run(0.5)
    seen = fault.evidence()
    assert seen.confirmation is Confirmation.CONTRADICTED
    assert not seen.confirmed
    assert seen.reason == "cyclic frames left since, and none reports inhibited"
    line.clear()
    line.run(0.1)
    (ended,) = [entry for entry in line.log.entries("axis-01") if entry.event == "injected fault ended"]
    assert ended.data["confirmation"] == "contradicted"


def test_the_end_of_an_injection_tells_its_confirmation_in_the_log(line):
    line.add("f702", as_="trip")
    line.run(2.0)
    (ended,) = [entry for entry in line.log.entries("axis-01") if entry.event == "injected fault ended"]
    assert (ended.data["confirmed"], ended.data["confirmation"], ended.data["why"]) == (True, "confirmed", "")


def test_one_drive_that_contradicts_counts_for_all_and_a_later_sight_confirms():
    good, bad = Evidence(1, 1, 5, 5, confirmed=True), Evidence(1, 1, 6, 6, contradicted="no")
    assert (good + bad).confirmation is Confirmation.CONTRADICTED
    assert (good + NOTHING).confirmation is Confirmation.CONFIRMED
