"""Everything about one drive."""

from __future__ import annotations

from common import (
    ACTIVATIONS,
    BAD_BITS,
    BITS,
    CONNECTIONS,
    DRIVE_UID,
    FARM_UID,
    NONE_IS_GOOD,
    RATE,
    STATES,
    annotations,
    connection,
    drive,
    farm,
    farm_variable,
    grown,
    mean,
    quantile,
    spaced,
    station,
    station_variable,
)
from panels import (
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    RED,
    Board,
    Json,
    color,
    heatmap,
    override,
    stat,
    state_timeline,
    target,
    targets,
    thresholds,
    timeseries,
    value_names,
    zero_is,
)

from pnfarm.farm.views.snapshot import STW1_BITS, ZSW1_BITS


def one_drive() -> Json:
    """Everything about one drive."""
    board = Board(
        DRIVE_UID,
        "pnfarm: one drive",
        "One drive: control and status words, motor, frames, faults.",
        ["pnfarm", "profinet"],
    )
    farm_variable(board)
    board.variable(
        "drive", "Drive", farm("pnfarm_axis_state"), "drive", everything=False, description="Name in the farm file."
    )
    station_variable(board)
    annotations(board, of_drive=True)
    board.dashboard_link("Farm overview", f"/d/{FARM_UID}?var-farm=${{farm}}")
    _drive_now(board)
    _drive_motor(board)
    _word_bits(board)
    _drive_connection(board)
    _drive_faults(board)
    return board.json


def _drive_now(board: Board) -> None:
    board.row("$drive now")
    grey = thresholds((None, GREY))
    board.add(
        stat(
            "State",
            [target(drive("pnfarm_axis_state"))],
            "PROFIdrive state machine.",
            mappings=value_names(STATES),
            steps=grey,
        ),
        6,
        4,
    )
    board.add(
        stat(
            "Fault",
            [target(drive("pnfarm_axis_fault_active"))],
            "Number of the active fault (PNU 947), as in the manual.",
            mappings=[zero_is("none")],
            steps=NONE_IS_GOOD,
        ),
        3,
        4,
    )
    board.add(
        stat(
            "Connection",
            [target(connection(station, drive, "instance"))],
            "State of CMDEV; DATA: cyclic data flows (on any bus).",
            mappings=value_names(CONNECTIONS),
            steps=grey,
        ),
        3,
        4,
    )
    board.add(
        stat(
            "Cycle",
            [target(station("pnfarm_ar_cycle_seconds"))],
            "Cycle of the IO data, as requested by the controller.",
            unit="s",
            mappings=[zero_is("-")],
        ),
        3,
        4,
    )
    board.add(
        stat(
            "Speed",
            [target(drive("pnfarm_axis_velocity_rpm"))],
            "Velocity of the shaft (VL.FB).",
            unit="rotrpm",
            decimals=0,
            sparkline=True,
        ),
        3,
        4,
    )
    board.add(
        stat(
            "Current",
            [target(drive("pnfarm_axis_current_amperes"))],
            "Torque-producing current (IL.FB).",
            unit="amp",
            decimals=2,
            sparkline=True,
        ),
        3,
        4,
    )
    board.add(
        stat(
            "Watchdog",
            [target(f"sum({station('pnfarm_watchdog_expirations_total')})")],
            "Number of times that the controller's frames stopped.",
            steps=NONE_IS_GOOD,
        ),
        3,
        4,
    )


def _drive_motor(board: Board) -> None:
    board.row("Motor")
    board.add(
        timeseries(
            "Speed",
            targets(
                (drive("pnfarm_axis_velocity_max_rpm"), "shaft (VL.FB), largest"),
                (drive("pnfarm_axis_velocity_min_rpm"), "shaft (VL.FB), smallest"),
                (drive("pnfarm_axis_setpoint_max_rpm"), "set point (NSOLL_A), largest"),
                (drive("pnfarm_axis_setpoint_min_rpm"), "set point (NSOLL_A), smallest"),
            ),
            "Extremes of the shaft's speed and of the controller's set point in the last 5 to 10 s, measured by the "
            "engine at each step: motion faster than the scrapes appears as a band, not as a slow wave.",
            unit="rotrpm",
            overrides=[
                override("shaft (VL.FB), largest", color=color(GREEN)),
                override("shaft (VL.FB), smallest", color=color(GREEN), custom__fillBelowTo="shaft (VL.FB), largest"),
                override("set point (NSOLL_A), largest", color=color(BLUE), custom__lineInterpolation="stepAfter"),
                override("set point (NSOLL_A), smallest", color=color(BLUE), custom__lineInterpolation="stepAfter"),
            ],
        ),
        12,
        9,
    )
    board.add(
        timeseries(
            "Current",
            targets((drive("pnfarm_axis_current_amperes"), "current (IL.FB)")),
            "Torque-producing current.",
            unit="amp",
        ),
        6,
        9,
    )
    board.add(
        timeseries(
            "Position",
            targets(
                (drive("pnfarm_axis_position_revolutions"), "position (PL.FB)"),
                (drive("pnfarm_axis_following_error_revolutions"), "following error (PL.ERR)"),
            ),
            "Revolutions from the home position; the following error on the right.",
            unit="none",
            overrides=[override("following error (PL.ERR)", custom__axisPlacement="right")],
        ),
        6,
        9,
    )
    board.add(
        timeseries(
            "Torque and heat",
            targets(
                (drive("pnfarm_axis_torque_newton_metres"), "torque"),
                (drive("pnfarm_axis_thermal_load_ratio"), "heat"),
            ),
            "Torque of the motor in N m; its thermal load on the right, 1 is the limit (I2t).",
            unit="none",
            overrides=[override("heat", custom__axisPlacement="right", unit="percentunit")],
        ),
        12,
        7,
    )
    board.add(
        timeseries(
            "DC link",
            targets((drive("pnfarm_axis_bus_volts"), "voltage (VBUS.VALUE)")),
            "It rises while the motor brakes.",
            unit="volt",
        ),
        12,
        7,
    )


def _bit(word: str, number: int) -> str:
    return f"floor({drive(word)} / {1 << number}) % 2"


def _word_bits(board: Board) -> None:
    board.row("Words")
    for title, word, names, what in (
        ("Control word 1 (STW1)", "pnfarm_axis_stw1", STW1_BITS, "Bits from the controller."),
        ("Status word 1 (ZSW1)", "pnfarm_axis_zsw1", ZSW1_BITS, "Bits from the drive."),
    ):
        bits = [
            target(_bit(word, number), f"{number} {spaced(name)}", ref=f"B{number}")
            for number, name in enumerate(names)
        ]
        panel = state_timeline(title, bits, what, BITS)
        panel["options"]["showValue"] = "never"
        panel["fieldConfig"]["overrides"] = [
            override(f"{number} {spaced(name)}", mappings=value_names({0: BITS[0], 1: ("1", RED)}))
            for number, name in enumerate(names)
            if name in BAD_BITS
        ]
        board.add(panel, 12, 10)
    board.add(
        state_timeline("State", targets((drive("pnfarm_axis_state"), "state")), "PROFIdrive state machine.", STATES),
        12,
        4,
    )
    board.add(
        state_timeline(
            "Connection",
            targets((connection(station, drive, "instance"), "connection")),
            "State of CMDEV.",
            CONNECTIONS,
        ),
        12,
        4,
    )


def _drive_connection(board: Board) -> None:
    board.row("Controller and frames")
    interval = station("pnfarm_controller_frame_interval_seconds_bucket")
    board.add(
        heatmap(
            "Interval of the controller's frames",
            f"sum by (le) (increase({interval}[{RATE}]))",
            "Time between two valid frames.",
        ),
        8,
        8,
    )
    jitter = station("pnfarm_controller_jitter_seconds_bucket")
    board.add(
        timeseries(
            "Jitter",
            [
                *targets(*((quantile(share, jitter), name) for share, name in ((0.5, "p50"), (0.99, "p99")))),
                target(f"rate({station('pnfarm_controller_missed_updates_total')}[{RATE}])", "missed updates", ref="C"),
            ],
            "Deviation of the controller's frames from the agreed cycle; missed updates per second on the right.",
            unit="s",
            minimum=0,
            overrides=[override("missed updates", unit="pps", custom__axisPlacement="right", color=color(RED))],
        ),
        8,
        8,
    )
    board.add(
        timeseries(
            "Cause of expired watchdogs",
            targets(
                (f"sum by (cause) (increase({station('pnfarm_watchdog_expirations_total')}[{RATE}]))", "{{cause}}")
            ),
            "Expired watchdogs; cause farm: the farm itself was later than its budget.",
            unit="none",
            minimum=0,
            steps=True,
            overrides=[override("controller", color=color(RED)), override("farm", color=color(GREY))],
        ),
        8,
        8,
    )
    board.add(
        timeseries(
            "Interval",
            [
                *targets((quantile(0.5, interval), "p50"), (quantile(0.99, interval), "p99")),
                target(f"{station('pnfarm_ar_cycle_seconds')} > 0", "agreed cycle", ref="C"),
            ],
            "Quantiles of the interval, and the agreed cycle.",
            unit="s",
            minimum=0,
            overrides=[override("agreed cycle", color=color(GREY), custom__lineStyle={"fill": "dash", "dash": [8, 8]})],
        ),
        9,
        8,
    )
    board.add(
        timeseries(
            "Sign-of-life errors",
            targets((f"rate({drive('pnfarm_sign_of_life_errors_total')}[{RATE}])", "errors")),
            "Frames whose sign of life (STW2) did not follow the last one's; 0 if the drive does not monitor it.",
            unit="cps",
            minimum=0,
        ),
        6,
        8,
    )
    board.add(
        timeseries(
            "Cyclic frames",
            targets(
                (f"rate({station('pnfarm_frames_sent_total')}[{RATE}])", "sent"),
                (f"rate({station('pnfarm_frames_received_total')}[{RATE}])", "received"),
                (
                    f"sum by (reason) (rate({station('pnfarm_frames_discarded_total')}[{RATE}])) > 0",
                    "discarded: {{reason}}",
                ),
            ),
            "RT_CLASS_1 frames, and frames that the drive discarded.",
            unit="pps",
            minimum=0,
        ),
        9,
        8,
    )


def _drive_faults(board: Board) -> None:
    board.row("Faults and recovery")
    codes = f"sum by (code) ({grown(drive('pnfarm_axis_faults_total'), '$__range')}) > 0"
    aborts = f"sum by (reason, cause) ({grown(station('pnfarm_ar_aborts_total'), '$__range')}) > 0"
    acts = f"sum by (kind) ({grown(ACTIVATIONS, '$__range')}) > 0"
    for title, expression, legend, what in (
        ("Faults", codes, "F{{code}}", "Faults of the drive in the shown range, by number."),
        (
            "Connections lost",
            aborts,
            "{{reason}}, {{cause}}",
            "Aborted connections in the shown range, by reason and cause; farm: the farm itself was late.",
        ),
        ("Injected", acts, "{{kind}}", "Activations of injected faults in the shown range, by kind."),
    ):
        board.add(
            stat(
                title,
                [target(expression, legend, instant=True)],
                what,
                decimals=0,
                no_value="none",
                text_mode="value_and_name",
                steps=thresholds((None, ORANGE)),
            ),
            4,
            8,
        )
    selector = '{instance=~"$farm", drive="$drive"}'
    for title, name, what in (
        (
            "Reaction to a fault",
            "pnfarm_controller_fault_reaction_seconds",
            "Until the controller removes the enable.",
        ),
        ("Recovery time", "pnfarm_controller_reconnect_seconds", "Until the drive runs again."),
    ):
        buckets = f"sum by (le) ({grown(f'{name}_bucket{selector}', '$__range')})"
        board.add(
            stat(
                title,
                [
                    target(mean(name, selector), "mean", ref="A", instant=True),
                    target(f"histogram_quantile(0.99, {buckets})", "p99", ref="C", instant=True),
                    target(f"sum({grown(f'{name}_count{selector}', '$__range')})", "times", ref="B", instant=True),
                ],
                f"{what} Over the shown range.",
                unit="s",
                decimals=1,
                no_value="none yet",
            ),
            6,
            8,
        )
        board.panels[-1]["fieldConfig"]["overrides"] = [override("times", unit="none", decimals=0)]
