# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""From configure to cleanup: each input message is one sample pushed into the estimator; what comes out is published at once."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.node import Node

from lugre_steering.chain.cache import tell_compiling
from lugre_steering.chain.step import Records
from lugre_steering.effects.registry import made
from lugre_steering.estimator import Estimator, Options, doubts
from lugre_steering.estimator.doubt import INPUTS
from lugre_steering.live.health import Health
from lugre_steering.live.inputs import Inputs
from lugre_steering.live.outputs import Outputs
from lugre_steering.live.parameters import Settings
from lugre_steering.provenance import source
from lugre_steering.recording import COMMAND, Array, IntArray
from lugre_steering.vehicle import Vehicle
from lugre_steering.watch import detector
from lugre_steering.watch.detector import Watch
from lugre_steering.watch.window import Part, SampleRing, part_since, write_window

LEAVE_S = 2.0
"""No longer does the last ramp to zero take: who stops the node waits a few seconds before he kills it."""
ARRIVAL_S = 0.5
"""So long, at most, the last zero on each topic is waited for."""
TICK_S = 0.02


class Session:
    """One vehicle, its estimator, and the topics around it. Publishes nothing unless ``active``; the state goes on."""

    def __init__(
        self,
        node: Node,
        settings: Settings,
        vehicle: Vehicle,
        guarded: Callable[[Callable[..., None]], Callable[..., None]],
        latency_window: int,
    ) -> None:
        self.settings, self.vehicle, self.active = settings, vehicle, False
        self._sheet = source(settings.vehicle_file)  # as it was read
        tell_compiling(node.get_logger().info)
        warm_up(vehicle, settings.options)
        self.estimator = Estimator(vehicle, settings.options)
        self.health = Health(vehicle, settings.angle_timeout_s, settings.pressure_timeout_s, latency_window, node.get_name())
        self.outputs = Outputs(node, vehicle, settings, self.estimator.rate_limit)
        self.watch = Watch(vehicle)
        self.samples = SampleRing() if settings.watch_folder is not None else None
        self.alarm = False  # the watch has just found that the model no longer matches
        self._node = node
        self._torque_ns = 0  # stamp of the newest torque
        self._fed_ns = 0  # monotonic time of the sample that gave the newest feed-forward
        self._doubts = 0
        self.news = False  # the doubts have changed since the last report, or the node has been switched on or off
        self.before_first: Callable[[int], None] | None = None  # to be called once, with the stamp of the first sample
        self._now_ns: Callable[[], int] = time.time_ns
        self.choose_clock()
        self._inputs = Inputs(
            node, vehicle, settings.input_depth, self.health, guarded, self._push, self._set_plan, self._refuse_plan
        )

    def close(self) -> None:
        """Leave the topics."""
        self._inputs.close()
        self.outputs.close()

    def activate(self) -> None:
        self.active = self.news = True
        if self._torque_ns:  # what has come meanwhile was for nobody: the feed-forward comes back from what was last published
            self._come_back()
        self.outputs.fading = None

    def deactivate(self) -> None:
        """Lead the feed-forward to zero; nothing else is published any more."""
        self.active, self.news = False, True
        self.outputs.begin_fade(self.settings.options.withdrawal_ramp_s)

    def withdraw(self) -> None:
        """Lead the feed-forward to zero and return when it is there: nobody will be left to do so."""
        self.active, outputs = False, self.outputs
        outputs.begin_fade(self.settings.options.withdrawal_ramp_s, LEAVE_S)
        while not outputs.faded:
            time.sleep(TICK_S)
            outputs.fade(self._now_ns())
        outputs.await_arrival(ARRIVAL_S)

    def change(self, settings: Settings) -> None:
        """Go on with other settings (those that are not fixed)."""
        self.settings = settings
        self.estimator.set_options(settings.options)
        self.health.set_timeouts(settings.angle_timeout_s, settings.pressure_timeout_s)
        self.outputs.set_ramp(settings, self.estimator.rate_limit)

    def prepare(self, vehicle: Vehicle) -> None:
        """Compile what another file of the same vehicle needs, in any thread; ``DataError`` if it is of another one."""
        tell_compiling(self._node.get_logger().info)
        self.estimator.check_continued(vehicle)
        warm_up(vehicle, self.settings.options)

    def reload(self, vehicle: Vehicle, file: Path) -> None:
        """Go on with another file of the same vehicle; ``DataError``, and all as before, if it is of another one."""
        self.estimator = self.estimator.continued(vehicle)
        self.vehicle, self._sheet = vehicle, source(file)
        self.watch = Watch(vehicle)
        self.health.set_vehicle(vehicle)
        self.outputs.set_ramp(self.settings, self.estimator.rate_limit)

    def tick(self) -> None:
        """Called often: leads the feed-forward to zero where that is due."""
        outputs = self.outputs
        if outputs.fading is None:
            silent_ns = time.monotonic_ns() - self._fed_ns
            if self.active and self._stale_to_zero() and silent_ns > self.settings.angle_timeout_s * 1e9 and not outputs.faded:
                self.health.withheld["feed-forward led to zero: inputs stale or withheld"] += 1
                outputs.begin_fade(self.settings.options.withdrawal_ramp_s)
        elif not outputs.faded:
            outputs.fade(self._now_ns())
            self.estimator.set_released(outputs.released)

    def count_lost(self) -> None:
        """Count what the middleware has lost since the last time."""
        self._inputs.count_lost()

    def _stale_to_zero(self) -> bool:
        return self.settings.when_stale == "zero"

    def choose_clock(self) -> None:
        """ROS time: simulated time where it is in use, else the system clock itself (30 times cheaper to read)."""
        clock = self._node.get_clock()
        self.simulated = bool(clock.ros_time_is_active)
        self._now_ns = (lambda: int(clock.now().nanoseconds)) if self.simulated else time.time_ns

    def window(self, reason: str) -> Callable[[], tuple[Path, Part]] | None:
        """Mark this moment in the report. What writes the samples of the time since the mismatch began, and of some time before, and says
        where and which they are; None without a folder for them."""
        self.health.mark, self.news = f"{self._torque_ns * 1e-9:.3f} s: {reason}", True
        folder = self.settings.watch_folder
        if folder is None or self.samples is None:
            return None
        options, sheet = {"watch_before_s": self.settings.watch_before_s}, self._sheet
        onset_ns = self.watch.since_ns
        since_ns = (onset_ns or self._torque_ns) - round(self.settings.watch_before_s * 1e9)
        kept, vehicle, file = self.samples.copy(), self.vehicle, folder / f"window_{self._torque_ns // 1_000_000}.npz"

        def write() -> tuple[Path, Part]:
            part = part_since(kept, since_ns, onset_ns)
            why = f"{reason}; no match since {onset_ns * 1e-9:.3f} s" if onset_ns else reason
            write_window(file, vehicle, "; ".join(filter(None, [why, part.missing])), part.samples, made("node", options, sheet))
            self.health.window = " ".join(filter(None, [str(file), part.missing and f"({part.missing})"]))
            return file, part

        return write

    @property
    def untold(self) -> bool:
        """Whether there is something that the last report did not tell."""
        return self.news or self.alarm or self.health.untold(self._now_ns(), self.estimator.rejections)

    def statuses(self, monotonic_ns: int, elapsed_s: float) -> Iterator[DiagnosticStatus]:
        self.news = False
        estimator, now_ns = self.estimator, self._now_ns()
        self.health.simulated, self.health.active = self.simulated, self.active
        self.health.mismatch_s = (now_ns - self.watch.since_ns) * 1e-9 if self.watch.since_ns else math.nan
        self.health.bound_Nm, self.health.watching = self.watch.bound_Nm, self.watch.words
        self.health.told(now_ns, estimator.rejections)
        counters, steps = estimator.counters, estimator.saturated_steps
        return self.health.statuses(now_ns, monotonic_ns, elapsed_s, counters, steps, estimator.line_troubles)

    # --------------------------------------------------------------- samples

    def _set_plan(self, plan: Callable[[int], tuple[IntArray, Array]]) -> None:
        latest_ns = max(self.estimator.latest_ns[f"angle/{side}"] for side in self.vehicle.sides)
        self.estimator.set_plan(*plan(latest_ns))
        if self.settings.options.feed_forward_horizon_s == 0.0:
            self.health.unused[f"{COMMAND}: not looked at, as 'feed_forward_horizon_s' is 0"] += 1

    def _refuse_plan(self) -> None:
        self.estimator.refuse_plan()

    def _push(self, channel: int, stamp_ns: int, value: float, rate: float) -> None:
        # Arrival is the begin of the callback: the time of reception that rclpy offers (MessageInfo) makes
        # EventsExecutor of rclpy 7.1 raise SystemError.
        begin_ns = time.monotonic_ns()
        health = self.health
        now_ns = self._now_ns()
        health.arrive(channel, now_ns, stamp_ns)
        if self.before_first is not None:
            self.before_first(stamp_ns)
            self.before_first = None
        estimates, residuals = self.estimator.push(channel, stamp_ns, value, rate)
        if self.samples is not None:
            self.samples.add(channel, stamp_ns, value, rate)
        if estimates.size:
            self._publish(estimates[0], begin_ns)
        for residual in residuals:
            # In doubt the inputs are at fault, not the model; and one that is no number is told below.
            if not self._doubts & INPUTS and math.isfinite(residual["residual"]):
                self.alarm |= self.watch.add(int(residual["stamp_ns"]), float(residual["residual"]))
        if not self.active:
            return
        for residual in residuals:
            if self.outputs.residual(residual):
                health.add_residual(float(residual["residual"]), float(residual["measured_torque"]))
            else:
                health.withheld["residual is not a finite number"] += 1

    def _publish(self, row: Records, begin_ns: int) -> None:
        health, outputs = self.health, self.outputs
        stamp_ns = int(row["stamp_ns"])
        if stamp_ns <= self._torque_ns:  # the estimator began anew
            outputs.interrupt_commands()
        self._torque_ns = stamp_ns
        self.watch.turned(row["theta"][: len(self.vehicle.sides)].tolist())
        if row["doubts"] != self._doubts:
            self._doubts, self.news = int(row["doubts"]), True
        if self._doubts:
            health.doubted.update(doubts(row))
        if not self.active:
            health.withheld["node not active"] += 1
            return
        if health.faulty(begin_ns):
            self._withhold("after an exception")
            return
        if not outputs.torque(stamp_ns, float(row["total"])):
            self._withhold("torque is not a finite number")
            return
        now_ns = self._now_ns()
        health.estimates += 1
        health.arrival_to_publish.add(time.monotonic_ns() - begin_ns)
        health.stamp_to_publish.add(now_ns - stamp_ns)
        if not outputs.estimate(stamp_ns, row):
            self._withhold("estimate is not a finite number")
        elif abs(now_ns - stamp_ns) > self.settings.angle_timeout_s * 1e9:
            self._withhold("feed-forward: stamps are not close to the clock")
        else:
            outputs.feed_forward(stamp_ns, now_ns, row)
            self._fed_ns = begin_ns

    def _withhold(self, reason: str) -> None:
        self.health.withheld[reason] += 1
        self.outputs.interrupt_commands()
        self._come_back()

    def _come_back(self) -> None:
        """The next feed-forward comes back from what was last published, over the recovery ramp."""
        self.estimator.set_released(self.outputs.released or [0.0] * len(self.vehicle.sides))


def warm_up(vehicle: Vehicle, options: Options) -> None:
    """Compile, or load from the cache, everything that callbacks call, on an estimator that is then thrown away."""
    detector.warm_up()
    estimator = Estimator(vehicle, options)
    for step in range(1, 200):
        stamp_ns = 1_000_000_000 + step * 10_000_000
        if step == 100:
            estimator.set_plan(np.array([stamp_ns, 2 * stamp_ns], np.int64), np.zeros((len(vehicle.sides), 2)))
        for channel in range(len(vehicle.channels)):
            estimator.push(channel, stamp_ns, 1e-3 * step)
