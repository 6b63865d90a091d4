# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What the live node would publish, as topics of a bag."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from lugre_steering.bag import BagWriter, Part, cdr
from lugre_steering.chain.step import Records
from lugre_steering.recording import NODE, IntArray
from lugre_steering.vehicle import Vehicle

PREFIX = f"/{NODE}"
FRAME = "base_link"


class Outputs:
    """The node's output topics as columns, with the content the node would publish."""

    def __init__(self, writer: BagWriter, vehicle: Vehicle) -> None:
        self._sides = vehicle.sides
        self._joints = [getattr(vehicle.topics, f"{side}_joint") for side in vehicle.sides]
        types = {
            "torque": cdr.WRENCH_STAMPED,
            "estimate": cdr.JOINT_STATE,
            "feed_forward": cdr.JOINT_STATE,
            **({f"rubber_temperature/{side}": cdr.TEMPERATURE for side in vehicle.sides} if vehicle.rubber else {}),
            "cylinder_torque": cdr.WRENCH_STAMPED,
            "residual": cdr.WRENCH_STAMPED,
        }
        self._number = {name: writer.add_topic(f"{PREFIX}/{name}", kind) for name, kind in types.items()}
        self.topics = {f"{PREFIX}/{name}" for name in types}

    def of_estimates(self, rows: Records, cause_ns: IntArray) -> Iterator[Part]:
        """Torque, joint states and temperatures; logged right after the message that caused them."""
        log_ns = _right_after(cause_ns)
        yield Part(self._number["torque"], log_ns, cdr.encode_wrench(rows["stamp_ns"], FRAME, rows["total"]))
        n = len(self._sides)
        columns = [rows[name][:, :n] for name in ("theta", "omega", "torque", "temperature", "feed_forward")]
        whole = np.isfinite(np.concatenate(columns, axis=1)).all(axis=1)
        stamp, log_ns = rows["stamp_ns"][whole], log_ns[whole]
        theta, omega, torque, temperature, feed_forward = (column[whole] for column in columns)
        state = cdr.encode_joint_state(stamp, FRAME, self._joints, theta, omega, torque)
        yield Part(self._number["estimate"], log_ns, state)
        state = cdr.encode_joint_state(stamp, FRAME, self._joints, effort=feed_forward)
        yield Part(self._number["feed_forward"], log_ns, state)
        for i, side in enumerate(self._sides):
            if (number := self._number.get(f"rubber_temperature/{side}")) is not None:
                yield Part(number, log_ns, cdr.encode_temperature(stamp, f"{side}_track", temperature[:, i]))

    def of_residuals(self, rows: Records, cause_ns: IntArray) -> Iterator[Part]:
        """Cylinder torque and residual."""
        for name, field in (("cylinder_torque", "measured_torque"), ("residual", "residual")):
            yield Part(self._number[name], _right_after(cause_ns), cdr.encode_wrench(rows["stamp_ns"], FRAME, rows[field]))


def _right_after(log_ns: IntArray) -> IntArray:
    """The next nanosecond, as far as there is one."""
    return np.minimum(log_ns, np.iinfo(np.int64).max - 1) + 1
