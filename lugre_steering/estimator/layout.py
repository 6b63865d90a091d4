# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What the compiled loop reads and writes: records and rings, and the reasons for which a sample is counted."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lugre_steering.chain.step import Records
from lugre_steering.recording import Array, IntArray

REASONS = (
    "duplicate", "backward", "zero_stamp", "not_finite", "absurd", "spike", "time_jump", "unpaired", "gap", "overrun",
    "restart", "absurd_rate", "angle_jump", "below_range",
)  # fmt: skip
(
    DUPLICATE, BACKWARD, ZERO, NOT_FINITE, ABSURD, SPIKE, JUMP, UNPAIRED, GAP, OVERRUN, RESTART, RATE, ANGLE_JUMP, BELOW,
) = range(len(REASONS))  # fmt: skip

ESTIMATE = np.dtype(
    [
        ("stamp_ns", np.int64),
        ("theta", np.float64, (2,)),
        ("omega", np.float64, (2,)),
        ("torque", np.float64, (2,)),
        ("temperature", np.float64, (2,)),
        ("feed_forward", np.float64, (2,)),
        ("total", np.float64),
        ("predicted", np.float64),  # total as the pressure sensors would show it (lagged)
        ("message", np.int64),  # the pushed message that completed it, counted from 0
        ("doubts", np.int64),  # bits after ``doubt.DOUBTS``: why the feed-forward is not to be trusted
    ]
)
RESIDUAL = np.dtype(
    [("stamp_ns", np.int64), ("measured_torque", np.float64), ("residual", np.float64), ("message", np.int64)]
)

CONFIG = np.dtype(
    [
        ("pair_tolerance_ns", np.int64),
        ("max_gap_ns", np.int64),
        ("backward_jump_ns", np.int64),
        ("forward_jump_ns", np.int64),
        ("max_angle", np.float64),
        ("max_rate", np.float64),
        ("accelerates", np.bool_),  # its rates come from a filter that holds the acceleration
        ("pressure_range", np.float64),
        ("max_pressure", np.float64),
        ("angle_noise", np.float64),
        ("gauge_offset", np.float64),
        ("pressure_gain", np.float64),
        ("delay_ns", np.int64),
        ("lag", np.float64),
        ("horizon", np.float64),
        ("start_ns", np.int64),
        ("start_known", np.bool_),  # whether it has been seen, or is remembered, what the bristles held at the start
        ("start_residual", np.float64),  # the first residual [N m], until the next one is believed too, and its stamp
        ("start_residual_ns", np.int64),
        ("start_share", np.float64),  # of what they can hold, where that differs from the estimate
        ("begin_ns", np.int64),  # stamp from which on they hold it; 0: nothing differs
        ("lagged", np.float64),
        ("lag_input", np.float64),  # the total that it followed last
        ("lagged_ns", np.int64),
        ("pending_first", np.int64),
        ("pending_count", np.int64),
        ("plan_size", np.int64),
        ("plan_refused_ns", np.int64),  # newest angle's stamp when a command was refused; 0: the last one was none of those
        ("effects", np.int64),  # see ``chain.step.acting``
        ("step_door", np.int64),  # see ``chain.doors``
        ("arm_door", np.int64),
        ("line_door", np.int64),
        ("swing_ns", np.int64),  # stamp of the last measured torque
        ("swing_from", np.float64),  # measured torque of late, followed slowly while the angles stand still [N m]
        ("residual_ns", np.int64),  # stamp of the last residual
        ("residual_square", np.float64),  # of late [(N m)^2], and the same of the measured and the estimated torque
        ("measured_square", np.float64),
        ("estimate_square", np.float64),
        ("agreed_ns", np.int64),  # since when residuals have been small; 0: the last one is not
        ("residual_now", np.float64),  # the same three of the very last time
        ("measured_now", np.float64),
        ("estimate_now", np.float64),
        ("residual_slow", np.float64),  # latest residual without what swings fast, at most as far beyond the bound as counts [N m]
        ("beyond", np.float64),  # share of the bound that residuals have had of late, squared
        ("explained_ns", np.int64),  # stamp of the last measured torque that was compared with the estimate
        ("explained", np.float64),  # time for which the lines have explained the estimate [s]
        ("exchange_seen", np.int64),  # pair of lines that explains the last one, exchanged (see ``lines``); 0: they do as they are
        ("exchange_count", np.int64),  # how often in a row the same was seen
        ("exchanged", np.int64),  # the pair that is taken for exchanged; 0: none
        ("residual_bound", np.float64),  # RMS [N m] beyond which a residual is implausible; 0: none is known
        ("friction", np.float64),  # the larger of static and sliding friction of all sides [N m]
        ("seen_angle", np.float64),  # largest angle [rad] and rate [rad/s] that the calibration saw; inf: not told
        ("seen_rate", np.float64),
        ("seen_coldest", np.float64),  # rubber [degC] unlike all that it saw, colder or warmer; infinite: not told
        ("seen_warmest", np.float64),
        ("released_ns", np.int64),  # stamp of the last feed-forward
        ("weight", np.float64),  # of the feed-forward, 0 ... 1
        ("limit", np.float64),  # of its value [N m] and rate [N m/s], each side
        ("rate_limit", np.float64),
        ("withdrawal_ramp", np.float64),  # [s]
        ("recovery_ramp", np.float64),  # [s]
        ("plan_tolerance", np.float64),  # [rad]
        ("side_tolerance", np.float64),  # [rad]
        ("side_ratio", np.float64),  # of the steering geometry, from the first side to the second; NaN: nothing ties them together
        ("plan_rate", np.float64),  # fastest plan [rad/s]
        ("message", np.int64),  # number of the message being processed, from 0
    ]
)
CHANNEL = np.dtype(
    [
        ("kind", np.int64),
        ("index", np.int64),
        ("last_ns", np.int64),
        ("suspect_ns", np.int64),
        ("suspect_value", np.float64),
        ("last_value", np.float64),
        ("repeats", np.float64),  # share of samples of late that were equal to the one before
        ("still", np.int64),  # samples equal to the one before, in a row
        ("still_ns", np.int64),  # stamp of the first of them
        ("back_ns", np.int64),  # stamp of the first of the samples in a row, up to the last one, that came from the past; 0: it did not
        ("back_last_ns", np.int64),  # stamp of the last of them
        ("lived", np.int64),  # readings of a line that differed from the one before
        ("frozen", np.bool_),  # a line whose readings hardly ever repeat has given the same one for a while
        ("below", np.bool_),  # the last reading of a line was refused as below its range
        ("wrong_from_ns", np.int64),  # between these stamps a line is not believed
        ("wrong_until_ns", np.int64),
        ("goes_below", np.bool_),  # a line has come below its range without a jump: it shows a difference
        ("accepted", np.int64),
        ("period_ns", np.int64),  # from the last but one accepted sample to the last
        ("head", np.int64),  # samples stored so far in the ring of this line or side
        ("cursor", np.int64),  # first ring sample that may still be needed
        ("reasons", np.int64, (len(REASONS),)),
    ]
)
WAITING = np.dtype(
    [
        ("stamp_ns", np.int64),
        ("theta", np.float64),
        ("omega", np.float64),
        ("torque", np.float64),
        ("temperature", np.float64),
        ("feed_forward", np.float64),
        ("doubts", np.int64),
    ]
)


def rows_of(records: Records) -> Array:
    """Records of numbers (n,) -> the same numbers (n, fields)."""
    return records.view(np.float64).reshape(records.size, records.dtype.itemsize // 8)


def records_of(rows: Array, kind: np.dtype[np.void]) -> Records:
    """The same numbers (n, fields) as records (n,) of that kind."""
    return rows.view(kind)[:, 0]


class Core(NamedTuple):
    """Everything the compiled loop reads and writes; arrays only, so that it can be copied and restored.

    Of parameters and states it holds rows of numbers, which alone know nothing of the effects: ``chain.doors``.
    """

    config: Records
    channels: Records
    parameters: Array
    line_parameters: Array
    state: Array
    motion: Records
    trust: Records
    guard: Records
    nothing: Records
    """What motion, trust and guard are before anything was seen; never written."""
    shadow: Array
    earlier: Array
    """States of the sides before their time last jumped forward."""
    bounds: Array
    released: Array
    output: Records
    waiting: Records
    rubber: Array
    pending: Records
    line_ns: IntArray
    line_value: Array
    geometry: Array
    areas: Array
    lines: IntArray
    law_left: IntArray
    """For each law of the vehicle file, named or not, where in a row of ``state`` its steps outside the range seen are counted."""
    plan_ns: IntArray
    plan_theta: Array
    scratch_value: Array
    scratch_state: Array
    scratch_output: Records
