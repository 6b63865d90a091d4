# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What the node knows about its own health, and its /diagnostics messages (names after REP-107)."""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue

from lugre_steering.counted import counted
from lugre_steering.online import NOTABLE_SHARE, is_large, sheet_words
from lugre_steering.recording import NODE, IntArray, Kind
from lugre_steering.vehicle import Vehicle
from lugre_steering.vehicle.model import most_friction_of_all

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR
STALE = "stale"
UNCHECKED = "no measured torque: nothing tells whether the feed-forward, which comes of the angles, is plausible"
FAULT_HOLD_NS = 1_000_000_000
RESIDUAL_SECONDS = 10
SHEET_SECONDS = 60
PERIOD_S = 0.5
"""Rates and levels are taken over at least so long, however soon after the last one a report comes."""
AIR_LOST_S = 600.0
"""No sensor of the air's temperature says nothing for so long, however slow it is."""
FAR_NS = 10_000_000_000
"""A clock that is wrong by more than that is another clock."""
OTHER_CLOCK = "is use_sim_time to be set, or a bag played at another rate?"
RECENT = 1000
"""Latencies that percentiles are taken of, so that they cost the same however many are kept."""


class Latencies:
    """The latest values of a duration [ns], in a ring of fixed size."""

    def __init__(self, size: int) -> None:
        self.values = np.full(size, 0, np.int64)  # written once now, so that memory does not grow as the ring fills
        self.count = 0
        self.max_ns = 0

    def add(self, value_ns: int) -> None:
        self.values[self.count % self.values.size] = value_ns
        self.count += 1
        if value_ns > self.max_ns:
            self.max_ns = value_ns

    def percentiles_ms(self, *percent: float) -> list[float]:
        """Percentiles [ms] of the latest values in the ring, RECENT at most; NaN without any."""
        if not self.count:
            return [math.nan] * len(percent)
        kept = min(self.count, self.values.size, RECENT)
        latest = np.sort(self.values[np.arange(self.count - kept, self.count) % self.values.size])
        places = np.array(percent) * (kept - 1) / 100.0  # np.percentile does the same, and takes five times as long
        return [float(value) * 1e-6 for value in np.interp(places, np.arange(kept), latest)]


class Health:
    """Arrivals, latencies, residual level and faults; all cheap to update in a callback."""

    def __init__(self, vehicle: Vehicle, angle_timeout_s: float, pressure_timeout_s: float, window: int, node: str = NODE) -> None:
        """``node``: its name."""
        self._node = node
        self.active = True
        self.leaving = False
        self.mismatch_s = math.nan  # since when the watch says that the model no longer matches
        self.watching = ""  # what the watch can tell
        self.bound_Nm = 0.0  # of residuals, by the calibration; 0: none
        self.simulated = False
        self.namesakes = 0  # other nodes of the same name
        self.state_trouble = ""  # why the state cannot be kept
        self.window_trouble = ""  # why the last window of an alarm was not written
        self.mark = ""  # time and reason of the last window, written or not
        self.window = ""  # the last one that was written, and what is missing in it
        self.doubted: Counter[str] = Counter()  # torques whose feed-forward was held back, by reason
        self._then_doubted: Counter[str] = Counter()
        self._kinds = [channel.kind for channel in vehicle.channels]
        self._topics: list[str] = [""] * len(self._kinds)
        self._timeouts_s: list[float] = []
        self.set_timeouts(angle_timeout_s, pressure_timeout_s)
        self.arrivals = [0] * len(self._kinds)
        self.arrived_ns = [0] * len(self._kinds)  # ROS time of the last message
        self.behind_ns = [0] * len(self._kinds)  # ROS time minus stamp of the last message
        self.late = [0] * len(self._kinds)  # messages whose stamps were older than the timeout of their kind when they arrived
        self._then_late = list(self.late)
        self.arrival_to_publish = Latencies(window)
        self.stamp_to_publish = Latencies(window)
        self.callbacks = 0
        self.estimates = 0
        self.residuals = 0
        self.withheld: Counter[str] = Counter()  # outputs not published, by reason
        self.unused: Counter[str] = Counter()  # messages that never reached the estimator, by reason
        self.foreign: Counter[str] = Counter()  # messages without a wanted joint, by topic
        self.exceptions = 0
        self.last_exception = ""
        self._fault_ns = -FAULT_HOLD_NS
        self._vehicle = vehicle
        self._residual_squares = self._estimate_squares = self._measured_squares = 0.0
        self._levels: deque[tuple[float, float, float, int, float]] = deque(maxlen=round(SHEET_SECONDS / PERIOD_S))
        self._then: Mapping[str, int] = {}
        self._then_arrivals = list(self.arrivals)
        self._period_s = 0.0
        self._rates = [0.0] * len(self._kinds)  # arrivals [Hz], and their number when it was taken
        self._rated = list(self.arrivals)
        self._told: frozenset[tuple[object, ...]] = frozenset()
        self._told_rejections: IntArray | None = None
        self._told_counts: list[Counter[str]] = [Counter()] * 3
        self._told_exceptions = 0
        self._then_residuals = 0
        self._then_saturated = 0
        self._then_exceptions = 0
        self._then_withheld: Counter[str] = Counter()
        self._then_estimates = 0
        self._pairs: dict[tuple[str, str], tuple[object, KeyValue]] = {}

    def set_timeouts(self, angle_timeout_s: float, pressure_timeout_s: float) -> None:
        self._timeouts_s = [angle_timeout_s if kind is Kind.ANGLE else pressure_timeout_s for kind in self._kinds]

    def set_vehicle(self, vehicle: Vehicle) -> None:
        """Another file of the same vehicle."""
        self._vehicle = vehicle

    def set_topics(self, topics: Sequence[str]) -> None:
        """Full names of the input topics, in the order of the channels."""
        self._topics = list(topics)

    def arrive(self, channel: int, now_ns: int, stamp_ns: int) -> None:
        """A message of a channel has come."""
        behind_ns = now_ns - stamp_ns
        self.arrivals[channel] += 1
        self.arrived_ns[channel], self.behind_ns[channel] = now_ns, behind_ns
        if behind_ns > self._timeouts_s[channel] * 1e9:
            self.late[channel] += 1

    def fault(self, error: BaseException, monotonic_ns: int) -> None:
        """Remember an exception; outputs are withheld until a second has passed without another."""
        self.exceptions += 1
        self.last_exception = f"{type(error).__name__}: {error}"
        self._fault_ns = monotonic_ns

    def faulty(self, monotonic_ns: int) -> bool:
        return self.exceptions > 0 and monotonic_ns - self._fault_ns < FAULT_HOLD_NS

    def add_residual(self, residual: float, measured: float) -> None:
        self.residuals += 1
        self._residual_squares += residual * residual
        self._estimate_squares += (measured - residual) * (measured - residual)
        self._measured_squares += measured * measured

    def _troubles(self, now_ns: int, rejections: IntArray) -> frozenset[tuple[object, ...]]:
        """What is wrong now, or has come up since the last report: stale inputs, counts that have grown."""
        found: set[tuple[object, ...]] = set()
        for i, (kind, timeout_s) in enumerate(zip(self._kinds, self._timeouts_s, strict=True)):
            if kind is not Kind.AIR_TEMPERATURE and not 0 <= now_ns - self.arrived_ns[i] <= timeout_s * 1e9:
                found.add((STALE, i))
        if self._told_rejections is not None:
            found.update(zip(*(index.tolist() for index in np.nonzero(rejections > self._told_rejections)), strict=True))
        for which, (counts, told) in enumerate(zip(self._counts, self._told_counts, strict=True)):
            found.update((which, key) for key, n in counts.items() if n > told[key])
        if self.exceptions > self._told_exceptions:
            found.add(("exception",))
        if self.namesakes > 0:
            found.add(("namesakes", self.namesakes))
        return frozenset(found)

    @property
    def _counts(self) -> tuple[Counter[str], ...]:
        return self.withheld, self.unused, self.foreign

    def untold(self, now_ns: int, rejections: IntArray) -> bool:
        """Whether anything is wrong that was not when the last report was made; ``rejections`` as the estimator counts them."""
        found = self._troubles(now_ns, rejections)
        # An input that came back since is news when it ends again; a count goes on until the next report.
        self._told = frozenset(trouble for trouble in self._told if trouble[0] != STALE or trouble in found)
        return not found <= self._told

    def told(self, now_ns: int, rejections: IntArray) -> None:
        """A report is being made."""
        self._told = self._troubles(now_ns, rejections)
        self._told_rejections = rejections
        self._told_counts = [counts.copy() for counts in self._counts]
        self._told_exceptions = self.exceptions

    def statuses(
        self,
        now_ns: int,
        monotonic_ns: int,
        elapsed_s: float,
        counters: Mapping[str, Mapping[str, int]],
        saturated_steps: int,
        line_troubles: Sequence[str] = (),
    ) -> Iterator[DiagnosticStatus]:
        """The status messages of the last ``elapsed_s`` seconds, each made when asked for; ``counters`` and troubles as the
        estimator tells them."""
        self._period_s += elapsed_s
        if self._period_s >= PERIOD_S:
            self._take_levels()
        yield self._inputs(now_ns, list(counters))
        yield self._rejected(counters)
        yield self._latency()
        yield self._residual(saturated_steps, line_troubles)
        yield self._outputs(monotonic_ns)
        self._then_arrivals = list(self.arrivals)

    def _take_levels(self) -> None:
        """The rates and residual levels of the period that ends now."""
        arrivals = zip(self.arrivals, self._rated, strict=True)
        self._rates = [(now - then) / self._period_s for now, then in arrivals]
        self._rated = list(self.arrivals)
        sums = self._residual_squares, self._estimate_squares, self._measured_squares
        self._levels.append((*sums, self.residuals - self._then_residuals, self._period_s))
        self._residual_squares = self._estimate_squares = self._measured_squares = self._period_s = 0.0
        self._then_residuals = self.residuals

    def _sums(self, seconds: float) -> tuple[float, float, float, int]:
        """Squares of residual, estimate and measured torque, and the number of residuals, over the last ``seconds`` of data."""
        residual, estimate, measured, count, spent = 0.0, 0.0, 0.0, 0, 0.0
        for row in reversed(self._levels):
            if spent >= seconds:
                break
            residual, estimate, measured, count = residual + row[0], estimate + row[1], measured + row[2], count + row[3]
            spent += row[4]
        return residual, estimate, measured, count

    def _status(self, component: str, level: bytes, message: str, values: Mapping[str, object]) -> DiagnosticStatus:
        pairs = [self._pair(component, key, value) for key, value in values.items()]
        name = f"{self._node}: {component}"
        return DiagnosticStatus(level=level, name=name, message=message, hardware_id=self._vehicle.name, values=pairs)

    def _pair(self, component: str, key: str, value: object) -> KeyValue:
        """A message is dear to make, and most of them say what they said before."""
        said, pair = self._pairs.get((component, key), (None, None))
        if pair is None or said != value:
            pair = KeyValue(key=key, value=_text(value))
            self._pairs[component, key] = value, pair
        return pair

    def _inputs(self, now_ns: int, labels: Sequence[str]) -> DiagnosticStatus:
        level = OK
        having: dict[str, list[str]] = {}  # what is wrong with which inputs
        values: dict[str, object] = {}
        for i, label in enumerate(labels):
            age_s = (now_ns - self.arrived_ns[i]) * 1e-9 if self.arrivals[i] else math.inf
            values[f"{label} topic"] = self._topics[i]
            values[f"{label} rate [Hz]"] = self._rates[i]
            values[f"{label} age [s]"] = age_s
            if self.arrivals[i]:
                values[f"{label} stamp behind clock [s]"] = self.behind_ns[i] * 1e-9
                values[f"{label} late"] = self.late[i]
            if self._kinds[i] is Kind.AIR_TEMPERATURE:  # optional and slow
                if self.arrivals[i] and not age_s <= AIR_LOST_S:
                    having.setdefault(STALE, []).append(label)
                    level = max(level, WARN)
                continue
            if not 0.0 <= age_s <= self._timeouts_s[i]:
                having.setdefault(STALE if self.arrivals[i] else "missing", []).append(label)
                level = max(level, ERROR if self._kinds[i] is Kind.ANGLE else WARN)
            elif abs(self.behind_ns[i]) > self._timeouts_s[i] * 1e9:
                hint = "" if self.simulated or abs(self.behind_ns[i]) < FAR_NS else f" ({OTHER_CLOCK})"
                having.setdefault(f"stamps are not close to the clock{hint}", []).append(label)
                level = max(level, WARN)
            elif self.late[i] > self._then_late[i]:
                having.setdefault("came late", []).append(label)
                level = max(level, WARN)
        self._then_late = list(self.late)
        troubles = [f"{', '.join(inputs)} {what}" for what, inputs in having.items()]
        measuring = [label for i, label in enumerate(labels) if self._kinds[i] in (Kind.PRESSURE, Kind.TORQUE)]
        if measuring and set(measuring) <= {label for what in (STALE, "missing") for label in having.get(what, [])}:
            values["plausibility"] = UNCHECKED
        if self.namesakes > 0:
            troubles.append(f"{counted(self.namesakes, 'other node')} of this name: their outputs mix with these")
            level = max(level, WARN)
        return self._status("inputs", level, "; ".join(troubles) or "all inputs arrive", values)

    def _rejected(self, counters: Mapping[str, Mapping[str, int]]) -> DiagnosticStatus:
        values = {f"{label} {reason}": n for label, counts in counters.items() for reason, n in counts.items()}
        values.update(self.unused)
        # Other joints beside the wanted ones are usual on a shared topic; instead of them they are a mistake.
        values |= {f"{topic} without a wanted joint": n for topic, n in self.foreign.items()}
        usual = {f"{topic} without a wanted joint" for topic, n in zip(self._topics, self.arrivals, strict=True) if n}
        now = {key: n for key, n in values.items() if not key.endswith(" accepted") and key not in usual}
        new = [key for key, n in now.items() if n > self._then.get(key, 0)]
        self._then = now
        message = f"new: {', '.join(new)}" if new else "nothing new rejected"
        return self._status("rejected", WARN if new else OK, message, values)

    def _latency(self) -> DiagnosticStatus:
        values: dict[str, object] = {"torques published": self.estimates}
        windows = {"stamp to publish": self.stamp_to_publish, "arrival to publish": self.arrival_to_publish}  # the latter is said, too
        for name, window in windows.items():
            p50, p99 = window.percentiles_ms(50.0, 99.0)
            values |= {f"{name} p50 [ms]": p50, f"{name} p99 [ms]": p99, f"{name} max [ms]": window.max_ns * 1e-6}
        values["samples in window"] = min(self.stamp_to_publish.count, self.stamp_to_publish.values.size)
        said = f"from arrival to publish: p50 {p50:.2g} ms, p99 {p99:.2g} ms" if self.estimates else "nothing published yet"
        return self._status("latency", OK, said, values)

    def _residual(self, saturated_steps: int, line_troubles: Sequence[str]) -> DiagnosticStatus:
        *squares, count = self._sums(RESIDUAL_SECONDS)
        rms, estimate, measured = (math.sqrt(s / count) if count else math.nan for s in squares)
        large = is_large(rms, estimate, measured, self._vehicle)
        saturated = saturated_steps > self._then_saturated
        self._then_saturated = saturated_steps
        message = "rubber temperature outside the rubber table" if saturated else ""
        if large:
            message = "; ".join(filter(None, [message, "residual as large as the torque: check units, signs, plugs; then diagnose"]))
        words = self._wrong_sheet()
        unlike = math.isfinite(self.mismatch_s)
        if unlike:  # without the time, which would make news of it each second
            message = "; ".join(filter(None, [message, "the residual is not what it was: the model no longer matches; diagnose"]))
        withheld = f"withheld: {', '.join(line_troubles)}" if line_troubles else ""
        message = "; ".join(filter(None, [withheld, message, words]))
        message = message or ("residual formed" if count else "no residual: pressures missing or not around the stamps")
        values: dict[str, object] = {
            f"RMS over {RESIDUAL_SECONDS} s [N m]": rms,
            "residuals": self.residuals,
            "steps outside rubber table": saturated_steps,
        }
        if self.bound_Nm:
            values["implausible from [N m]"] = self.bound_Nm
        if self.watching:
            values["the watch tells"] = self.watching
        if unlike:
            values["no longer matches since [s]"] = self.mismatch_s
        if self.mark:
            values["last mark"] = self.mark
        if self.window:
            values["last window"] = self.window
        return self._status("residual", WARN if saturated or large or withheld or words or unlike or not count else OK, message, values)

    def _wrong_sheet(self) -> str:
        """What to check in the vehicle file, where the measured torque has the shape of the estimate but another size."""
        residual, estimate, measured, count = self._sums(SHEET_SECONDS)
        friction = most_friction_of_all(self._vehicle)
        if not count or estimate < (NOTABLE_SHARE * friction) ** 2 * count:
            return ""
        return sheet_words(residual, estimate, measured, self._vehicle) or ""

    def _outputs(self, monotonic_ns: int) -> DiagnosticStatus:
        faulty = self.faulty(monotonic_ns) or self.exceptions > self._then_exceptions  # every exception is told once
        self._then_exceptions = self.exceptions
        troubles = [f"exception: {self.last_exception}"] if faulty else []
        withheld = self.withheld - self._then_withheld
        del withheld["node not active"]  # as it should be
        troubles += [f"withheld: {reason}" for reason in withheld]
        new = self.doubted - self._then_doubted
        self._then_doubted = self.doubted.copy()
        doubts = [f"feed-forward to zero: {reason}" for reason in new]
        if not self.active:
            doubts.append("node not active")
        if self.state_trouble:
            doubts.append(f"temperatures and bristles will not survive: {self.state_trouble}")
        if self.window_trouble:
            doubts.append(f"window not written: {self.window_trouble}")
        if self.leaving:
            doubts.append("node stops: feed-forward to zero")
        arrived = [
            now - then
            for now, then, kind in zip(self.arrivals, self._then_arrivals, self._kinds, strict=True)
            if kind is Kind.ANGLE
        ]
        if self.active and self.estimates == self._then_estimates and min(arrived) > 1:
            troubles.append("no torque although angles arrive")
        self._then_withheld, self._then_estimates = self.withheld.copy(), self.estimates
        if self.exceptions and not faulty:
            doubts.append(f"{counted(self.exceptions, 'exception')} so far: {self.last_exception}")
        level = ERROR if troubles else (WARN if doubts else OK)
        message = "; ".join([*troubles, *doubts]) or "running"
        values: dict[str, object] = {"exceptions": self.exceptions, "last exception": self.last_exception}
        values |= {f"feed-forward to zero: {reason}": n for reason, n in self.doubted.items()}
        values |= {f"withheld: {reason}": n for reason, n in self.withheld.items()}
        return self._status("outputs", level, message, values)


def _text(value: object) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)
