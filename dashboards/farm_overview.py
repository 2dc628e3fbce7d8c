"""All drives of a farm, the engine, and the controller's behaviour."""

from __future__ import annotations

from common import (
    BY_LABEL,
    CONNECTIONS,
    DRIVE_UID,
    FARM_UID,
    LATENESS,
    NONE_IS_GOOD,
    RATE,
    STATES,
    TO_DRIVE,
    annotations,
    connection,
    farm,
    farm_variable,
    grown,
    mean,
    quantile,
    with_model,
)
from panels import (
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    RED,
    Board,
    Json,
    color,
    heatmap,
    link,
    override,
    stat,
    state_timeline,
    table,
    target,
    targets,
    thresholds,
    timeseries,
    value_names,
    zero_is,
)


def farm_overview() -> Json:
    """All drives of a farm, the engine, and the controller's behaviour."""
    board = Board(
        FARM_UID,
        "pnfarm: farm overview",
        "All drives of a farm: which run, which do not and why, the controller's jitter, the farm's lateness.",
        ["pnfarm", "profinet"],
    )
    farm_variable(board)
    annotations(board, of_drive=False)
    board.dashboard_link("One drive", f"/d/{DRIVE_UID}")
    _overview_now(board)
    _overview_drives(board)
    _overview_wire(board)
    _overview_controller(board)
    _overview_lines(board)
    _overview_engine(board)
    return board.json


def _overview_now(board: Board) -> None:
    count = f"count({farm('pnfarm_axis_state')})"
    operating = f"sum({farm('pnfarm_axis_state')} == bool 4)"
    board.row("Now")
    board.add(stat("Drives", [target(count)], "Drives of the farm, powered or not."), 3, 4)
    share = thresholds((None, RED), (0.5, ORANGE), (1, GREEN))
    board.add(
        stat(
            "Exchanging data",
            [target(f"avg({farm('pnfarm_ar_exchanging')})")],
            "Share of the stations, drives and devices, whose connection is completely set up.",
            unit="percentunit",
            steps=share,
            decimals=0,
        ),
        4,
        4,
    )
    board.add(
        stat(
            "In operation",
            [target(f"{operating} / {count}")],
            "Share of the drives in S4.",
            unit="percentunit",
            steps=share,
            decimals=0,
        ),
        4,
        4,
    )
    board.add(
        stat(
            "With a fault",
            [target(f"sum({farm('pnfarm_axis_fault_active')} > bool 0)")],
            "Drives with an active fault, injected or their own.",
            steps=NONE_IS_GOOD,
        ),
        3,
        4,
    )
    board.add(
        stat(
            "Injected faults",
            [target(f"sum({farm('pnfarm_faults_active')})")],
            "Number of active injected faults.",
            steps=thresholds((None, GREEN), (1, PURPLE)),
            no_value="0",
        ),
        3,
        4,
    )
    board.add(
        stat(
            "Engine late, p99",
            [target(quantile(0.99, farm("pnfarm_engine_lateness_seconds_bucket")))],
            "99 of 100 ticks of the engine begin at most this late. If it is high, do not trust the other figures.",
            unit="s",
            steps=LATENESS,
            decimals=0,
            sparkline=True,
        ),
        4,
        4,
    )
    board.add(
        stat(
            "Version",
            [target(farm("pnfarm_build_info"), "{{version}}", instant=True)],
            "Version of pnfarm.",
            text_mode="name",
        ),
        3,
        4,
    )


def _overview_drives(board: Board) -> None:
    board.row("Drives")
    overrides = [
        override(value, displayName=text, color=color(shade))
        for value, (text, shade) in ((str(v), s) for v, s in STATES.items())
    ]
    board.add(
        timeseries(
            "Drives by state",
            targets((f'count_values("state", {farm("pnfarm_axis_state")})', "{{state}}")),
            "Number of drives in each state of the PROFIdrive state machine.",
            unit="none",
            minimum=0,
            stacked=True,
            steps=True,
            overrides=overrides,
        ),
        12,
        8,
    )
    board.add(
        state_timeline(
            "Drives out of operation",
            targets((f"{farm('pnfarm_axis_state')} != 4", "{{drive}}")),
            "Drives while they are not in S4.",
            STATES,
            no_value="every drive is in S4 operation",
            links=[link("This drive", BY_LABEL)],
        ),
        12,
        8,
    )
    columns = [
        ("State", f"max by (drive) ({farm('pnfarm_axis_state')})"),
        ("Connection", f"max by (drive) ({connection(farm, farm, 'instance, drive')})"),
        ("Fault", f"max by (drive) ({farm('pnfarm_axis_fault_active')})"),
        ("Speed", f"max by (drive) ({farm('pnfarm_axis_velocity_rpm')})"),
        ("Set point", f"max by (drive) ({farm('pnfarm_axis_setpoint_rpm')})"),
        ("Current", f"max by (drive) ({farm('pnfarm_axis_current_amperes')})"),
        ("Cycle", f"max by (drive) ({farm('pnfarm_ar_cycle_seconds')})"),
        ("Connects", f"sum by (drive) ({farm('pnfarm_ar_connects_total')})"),
        ("Watchdog", f"sum by (drive) ({farm('pnfarm_watchdog_expirations_total')})"),
        ("Faults so far", f"sum by (drive) ({farm('pnfarm_axis_faults_total')})"),
    ]
    shaded = {"type": "color-text"}
    steps = thresholds((None, GREY))
    overrides = [
        override("Drive", links=[link("This drive", TO_DRIVE + "${__value.raw}")], custom__minWidth=140),
        override(
            "State", mappings=value_names(STATES), thresholds=steps, custom__cellOptions=shaded, custom__minWidth=190
        ),
        override("Connection", mappings=value_names(CONNECTIONS), thresholds=steps, custom__cellOptions=shaded),
        override("Fault", mappings=[zero_is("none")], thresholds=NONE_IS_GOOD, custom__cellOptions=shaded),
        override("Speed", unit="rotrpm", decimals=0),
        override("Set point", unit="rotrpm", decimals=0),
        override("Current", unit="amp", decimals=2),
        override("Cycle", unit="s", mappings=[zero_is("-")]),
        override("Watchdog", thresholds=NONE_IS_GOOD, custom__cellOptions=shaded),
    ]
    board.add(table("Drives now", columns, "Click on a drive for its dashboard.", overrides), 24, 9)


def _overview_wire(board: Board) -> None:
    board.row("Wire")
    sent, received = farm("pnfarm_frames_sent_total"), farm("pnfarm_frames_received_total")
    board.add(
        timeseries(
            "Cyclic frames",
            targets(
                (f"sum(rate({sent}[{RATE}]))", "sent by the drives"),
                (f"sum(rate({received}[{RATE}]))", "received from the controller"),
            ),
            "RT_CLASS_1 frames of all drives together.",
            unit="pps",
            minimum=0,
            calcs=["lastNotNull", "max"],
        ),
        8,
        8,
    )
    discarded = f"sum by (reason) (rate({farm('pnfarm_frames_discarded_total')}[{RATE}])) > 0"
    board.add(
        timeseries(
            "Discarded frames",
            targets((discarded, "{{reason}}")),
            "Frames that drives dropped, by reason.",
            unit="pps",
            minimum=0,
            no_value="nothing was discarded",
        ),
        8,
        8,
    )
    lost = f"sum by (cause) (increase({farm('pnfarm_watchdog_expirations_total')}[{RATE}]))"
    aborted = f"sum by (reason, cause) ({grown(farm('pnfarm_ar_aborts_total'), RATE)}) > 0"
    connects = f"sum(increase({farm('pnfarm_ar_connects_total')}[{RATE}]))"
    board.add(
        timeseries(
            "Connections",
            targets(
                (connects, "established"),
                (lost, "watchdog expired: {{cause}}"),
                (aborted, "aborted: {{reason}}, cause: {{cause}}"),
            ),
            "Connections established and lost; cause farm: the farm itself was late.",
            unit="none",
            minimum=0,
            steps=True,
            overrides=[
                override("established", color=color(GREEN)),
                override("watchdog expired: controller", color=color(RED)),
                override("watchdog expired: farm", color=color(GREY)),
            ],
        ),
        8,
        8,
    )


def _overview_controller(board: Board) -> None:
    board.row("Controller")
    jitter = farm("pnfarm_controller_jitter_seconds_bucket")
    board.add(
        timeseries(
            "Jitter, p99: the ten worst drives",
            targets(
                (with_model(f"topk(10, {quantile(0.99, jitter, 'instance, drive, le')})"), "{{drive}} ({{model}})")
            ),
            "Deviation of the controller's frames from the agreed cycle. The bucket limits determine the resolution.",
            unit="s",
            minimum=0,
            links=[link("This drive", BY_LABEL)],
            calcs=["lastNotNull", "max"],
        ),
        8,
        8,
    )
    selector = '{instance=~"$farm"}'
    for title, name, what in (
        (
            "Reaction to a fault",
            "pnfarm_controller_fault_reaction_seconds",
            "From a drive's fault until the controller removes the enable.",
        ),
        (
            "Recovery time",
            "pnfarm_controller_reconnect_seconds",
            "From a fault or a lost connection until the drive runs again.",
        ),
    ):
        buckets = f"sum by (le) ({grown(f'{name}_bucket{selector}', '$__range')})"
        board.add(
            stat(
                title,
                [
                    target(mean(name, selector), "mean", ref="A", instant=True),
                    target(f"histogram_quantile(0.5, {buckets})", "p50", ref="B", instant=True),
                    target(f"histogram_quantile(0.99, {buckets})", "p99", ref="C", instant=True),
                    target(f"sum({grown(f'{name}_count{selector}', '$__range')})", "times", ref="D", instant=True),
                ],
                f"{what} Over the shown range.",
                unit="s",
                decimals=1,
                no_value="none yet",
            ),
            4,
            8,
        )
        board.panels[-1]["fieldConfig"]["overrides"] = [override("times", unit="none", decimals=0)]
    acts = f"sum by (kind) ({grown(farm('pnfarm_fault_activations_total'), RATE)}) > 0"
    board.add(
        timeseries(
            "Activity of injected faults",
            targets((acts, "{{kind}}")),
            "Activations of injected faults, by kind.",
            minimum=0,
            steps=True,
            no_value="no injected fault was active",
        ),
        8,
        8,
    )
    reaction = farm("pnfarm_controller_fault_reaction_seconds_bucket")
    by_fault = f"sum by (code, kind, le) ({grown(reaction, '$__range')})"
    board.add(
        timeseries(
            "Reaction to a fault, p99 by fault and injection",
            targets((f"histogram_quantile(0.99, {by_fault}) >= 0", "F{{code}}, injected: {{kind}}")),
            "From a drive's fault until the controller removes the enable, by the drive's fault and by what was "
            "injected, in the shown range so far.",
            unit="s",
            minimum=0,
            no_value="none yet",
        ),
        12,
        8,
    )
    errors = f"sum by (instance, drive) (rate({farm('pnfarm_sign_of_life_errors_total')}[{RATE}]))"
    board.add(
        timeseries(
            "Sign-of-life errors: the ten worst drives",
            targets((with_model(f"topk(10, {errors})"), "{{drive}} ({{model}})")),
            "Frames whose sign of life (STW2) did not follow the last one's; 0 for drives that do not monitor it.",
            unit="cps",
            minimum=0,
            links=[link("This drive", BY_LABEL)],
        ),
        6,
        8,
    )
    recovery = farm("pnfarm_controller_reconnect_seconds_bucket")
    by_model = with_model(f"sum by (instance, drive, le) ({grown(recovery, '$__range')})")
    board.add(
        timeseries(
            "Recovery time, p50 by model",
            targets((f"histogram_quantile(0.5, sum by (model, le) ({by_model})) >= 0", "{{model}}")),
            "From a fault or a lost connection until the drive runs again, by model, in the shown range so far.",
            unit="s",
            minimum=0,
            no_value="none yet",
        ),
        6,
        8,
    )


def _overview_lines(board: Board) -> None:
    board.row("Serial lines (PROFIBUS)")
    telegrams, octets = farm("pnfarm_line_telegrams_total"), farm("pnfarm_line_octets_total")
    board.add(
        timeseries(
            "Telegrams on the line",
            targets((f"sum by (line, direction) (rate({telegrams}[{RATE}]))", "{{line}} {{direction}}")),
            "Whole telegrams that the farm received and sent.",
            unit="cps",
            minimum=0,
            no_value="no serial line",
        ),
        6,
        8,
    )
    load = f"sum by (line) (rate({octets}[{RATE}])) * 11"
    board.add(
        timeseries(
            "Bits on the line",
            targets((load, "{{line}}")),
            "Octets in both directions, 11 bits each: to compare with the line's rate.",
            unit="bps",
            minimum=0,
            no_value="no serial line",
        ),
        6,
        8,
    )
    reply = farm("pnfarm_line_reply_seconds_bucket")

    def quantile_of(share: float) -> tuple[str, str]:
        grouped = f"sum by (line, le) (rate({reply}[{RATE}]))"
        return f"histogram_quantile({share}, {grouped}) >= 0", f"{{{{line}}}} p{share * 100:g}"

    board.add(
        timeseries(
            "Reply time",
            targets(quantile_of(0.5), quantile_of(0.99)),
            "From the last octet of a request to its answer, in the farm's process: part of T_SDR.",
            unit="s",
            minimum=0,
            no_value="no serial line",
        ),
        6,
        8,
    )
    requests, dropped = farm("pnfarm_line_requests_total"), farm("pnfarm_line_dropped_total")
    withheld = farm("pnfarm_line_answers_withheld_total")
    board.add(
        timeseries(
            "Repetitions, diagnoses, wrong telegrams",
            targets(
                (f"sum by (line, kind) (rate({requests}[{RATE}]))", "{{line}} {{kind}}"),
                (f"sum by (line) (rate({withheld}[{RATE}]))", "{{line}} withheld"),
                (f"sum(rate({dropped}[{RATE}])) or vector(0)", "wrong"),
            ),
            "Requests that came again (same FCB), diagnoses that were read, set-ups that were refused; answers that "
            "would have been too late; received data that are not telegrams.",
            unit="cps",
            minimum=0,
            no_value="no serial line",
        ),
        6,
        8,
    )


def _overview_engine(board: Board) -> None:
    board.row("Engine")
    lateness = farm("pnfarm_engine_lateness_seconds_bucket")
    board.add(
        heatmap(
            "Lateness of ticks",
            f"sum by (le) (increase({lateness}[{RATE}]))",
            "The farm's own lateness: time from when a tick was due until it began.",
        ),
        12,
        8,
    )
    curves = targets(
        *((quantile(share, lateness), name) for share, name in ((0.5, "p50"), (0.99, "p99"), (0.999, "p99.9")))
    )
    board.add(
        timeseries(
            "Lateness",
            curves,
            "Quantiles of the farm's own lateness.",
            unit="s",
            minimum=0,
            calcs=["lastNotNull", "max"],
        ),
        6,
        8,
    )
    cycles, overruns = farm("pnfarm_engine_cycles_total"), farm("pnfarm_engine_overruns_total")
    board.add(
        timeseries(
            "Ticks",
            targets((f"sum(rate({cycles}[{RATE}]))", "ticks"), (f"sum(rate({overruns}[{RATE}]))", "overruns")),
            "Ticks of the engine, and ticks so late that a drive's cycle was skipped.",
            unit="hertz",
            minimum=0,
            overrides=[override("overruns", color=color(RED))],
            calcs=["lastNotNull", "max"],
        ),
        6,
        8,
    )
