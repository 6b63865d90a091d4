# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""One bag through the estimator: the same messages in, the same topics out as the live node.

A bag streams through in blocks; memory does not grow with its length.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from lugre_steering.bag import Bag, BagWriter, Block
from lugre_steering.bag.find import REPLAYED
from lugre_steering.bag.given import in_stamp_order
from lugre_steering.bag.load import STRAY_NS, read_recording
from lugre_steering.bag.reader import damage_words, shortened
from lugre_steering.bag.writer import copied, stock_types
from lugre_steering.chain.step import Records
from lugre_steering.counted import counted
from lugre_steering.errors import BagError, DataError
from lugre_steering.estimator import Estimator, Options
from lugre_steering.estimator.plan import PLAN_BYTES, planned_angles
from lugre_steering.files import new_folder
from lugre_steering.fitting.hindsight import hindsight_rmse
from lugre_steering.online import Agreement, Comparison, Curves, Timeline, is_large, sheet_words
from lugre_steering.pool import Progress
from lugre_steering.provenance import MADE, Provenance
from lugre_steering.recording import AIR_LIMIT_DEGC, COMMAND, Channel, Finding, IntArray, Kind, Recording
from lugre_steering.replay.earlier import refuse_foreign
from lugre_steering.replay.outputs import Outputs
from lugre_steering.replay.page import write_page
from lugre_steering.replay.result import InputCounts, ReplayedBag, Series
from lugre_steering.report.available import no_pictures
from lugre_steering.vehicle import Vehicle

AIR = "air"
"""In place of an initial temperature: that of the first recorded air."""
TRAJECTORY = "trajectory_msgs/msg/JointTrajectory"
NOT_REJECTED = ("accepted", "unpaired", "gap", "overrun", "restart", "absurd_rate", "angle_jump")
"""Counters of the estimator about samples that it did use."""


class Passage:
    """One bag through a new estimator."""

    def __init__(
        self, path: Path, name: str, vehicle: Vehicle, options: Options, initial_temperature: str | None = None, *,
        look_ahead: bool = False,
    ) -> None:
        self.path, self.name, self.vehicle = path, name, vehicle
        self.estimator = Estimator(vehicle, options)
        self._look_ahead = look_ahead
        self._rubber_degC: float | None = None  # at the start, where it is not that of the vehicle file
        self._as_warm_as_air = initial_temperature == AIR
        if initial_temperature not in (None, AIR):
            self._begin_at(degrees(initial_temperature))
        self.fit = Comparison()
        self.motion = Curves(2 * len(vehicle.sides) + 1)  # angles, temperatures, torque
        self.check = Curves(2)  # cylinder torque, residual
        self._joints = [getattr(vehicle.topics, f"{side}_joint") for side in vehicle.sides]
        self._counts: Counter[str] = Counter()
        self._commands: Counter[str] = Counter()  # feed-forward plans that could not be used, by reason
        self._found: list[Finding] = []
        self._clocks: tuple[Timeline, Timeline] | None = None  # of estimates and of residuals
        self._last_log_ns: int | None = None
        self._lasted_ns = 0  # by log times, without leaps
        self._spans: dict[int, tuple[int, int]] = {}  # first and last stamp by channel

    def write(self, out: Path, origin: Provenance, progress: Progress | None) -> ReplayedBag:
        """Write the bag, the page and the picture; returns the summary of this bag."""
        with Bag(self.path) as bag, new_folder(out / self.name, replace=True) as result:
            channels = self._wanted(bag)
            topics = self._topics(bag, channels)
            marks = {**REPLAYED, MADE: "\n".join(origin.lines())}
            with BagWriter(result, custom_data=marks, compressed=True, final=out / self.name) as writer:
                self._stream(bag, channels, writer, progress)
            samples = self._samples(bag, topics)
            self._check_estimates(samples, bag.findings)
            refuse_foreign(out / self.name)  # again: a file may have been put there meanwhile
            ahead = self._ahead()
            findings = [*bag.findings, *self._found, *self._last_findings()]
        summary = self._summary(samples, findings, ahead)
        page = out / f"{self.name}.html"
        write_page(summary, self.vehicle, self.motion, self.check, origin, page)
        picture, note = self._picture(out / f"{self.name}.png", summary.fit, origin)
        return replace(summary, picture=picture, picture_note=note, page=page.name)

    def remember(self) -> ReplayedBag:
        """Write nothing, keep the torques in memory; returns the summary of this bag with them."""
        with Bag(self.path) as bag:
            channels = self._wanted(bag)
            topics = self._topics(bag, channels)
            command = self._optional(bag, COMMAND)
            kept = [self._take(block, bag, command) for block in bag.blocks(channels, all_messages=True) if len(block.messages)]
            samples = self._samples(bag, topics)
            self._check_estimates(samples, bag.findings)
            ahead = self._ahead()
            findings = [*bag.findings, *self._found, *self._last_findings()]
        return replace(self._summary(samples, findings, ahead), series=self._series(kept))

    def remember_recording(self, recording: Recording) -> ReplayedBag:
        """The same for samples in memory, which come in the order of their stamps."""
        channel, stamp_ns, value, rate = in_stamp_order(recording, self.vehicle.channels)
        kept = self._records(self.estimator.push_block(channel, stamp_ns, value, rate))
        estimates, residuals = kept
        self._counts.update(rows=stamp_ns.size, messages=stamp_ns.size, estimates=len(estimates))
        if stamp_ns.size:
            self._lasted_ns = int(stamp_ns[-1]) - int(stamp_ns[0])
            self._clocks = Timeline(int(stamp_ns[0])), Timeline(int(stamp_ns[0]))
            for i in np.unique(channel):
                stamps = stamp_ns[channel == i]
                self._spans[int(i)] = int(stamps[0]), int(stamps[-1])
            self._compare(estimates, residuals)
        samples = {
            label: replace(counts, topic=label if counts.used else None) for label, counts in self._samples(None, {}).items()
        }
        self._check_estimates(samples, recording.findings)
        ahead = self._ahead(recording)
        findings = [*recording.findings, *self._found, *self._last_findings()]
        return replace(self._summary(samples, findings, ahead), series=self._series([kept]))

    def _topics(self, bag: Bag, channels: Sequence[Channel]) -> Mapping[Channel, str]:
        """The recorded topic of each channel; refuses a bag without one of the angles."""
        topics = bag.match(channels)
        for channel in self.vehicle.channels:
            if channel.kind is Kind.ANGLE and channel not in topics:
                found = shortened(sorted(bag.topics)) or "none"
                damage = damage_words(bag.findings)
                raise BagError(f"{self.path}: topic {channel.topic!r} is missing; topics in the bag: {found}{damage}")
        return topics

    def _check_estimates(self, samples: Mapping[str, InputCounts], findings: Sequence[Finding]) -> None:
        if not self._counts["estimates"]:
            came = self._counted(samples, Kind.ANGLE)
            raise BagError(f"{self.path}: no torque could be estimated ({came}){damage_words(findings)}")

    def _ahead(self, recording: Recording | None = None) -> float | None:
        """Error [N m] of the model with the motion known from all samples, if it is asked for and can be told."""
        if not self._look_ahead:
            return None
        try:
            return hindsight_rmse(self.vehicle, recording or read_recording(self.path, self.vehicle.channels), self._rubber_degC)
        except DataError as error:
            self._found.append(Finding("no_look_ahead", "", str(error)))
            return None

    def _summary(self, samples: Mapping[str, InputCounts], findings: Sequence[Finding], ahead: float | None) -> ReplayedBag:
        fit = self.fit.result()
        return ReplayedBag(
            bag=str(self.path),
            name=self.name,
            duration_s=self._lasted_ns * 1e-9,
            messages=self._counts["messages"],
            estimates=self._counts["estimates"],
            fit=fit,
            fit_note=None if fit else f"residual not available ({self._why_no_fit(samples)})",
            samples=samples,
            saturated_rubber_table_steps=self.estimator.saturated_steps,
            findings=tuple(findings),
            look_ahead_rmse_Nm=ahead,
        )

    def _series(self, kept: Sequence[tuple[Records, Records]]) -> Series:
        """All estimates and residuals as columns."""
        estimates, residuals = (np.concatenate(tables) for tables in zip(*kept, strict=True))
        start_ns = int(estimates["stamp_ns"].min())
        of_side = {name: dict(zip(self.vehicle.sides, estimates[name].T, strict=False)) for name in ("theta", "temperature")}
        return Series(
            time_s=(estimates["stamp_ns"] - start_ns) * 1e-9,
            angle=of_side["theta"],
            torque=estimates["total"],
            rubber_temperature=of_side["temperature"] if self.vehicle.rubber is not None else {},
            residual_time_s=(residuals["stamp_ns"] - start_ns) * 1e-9,
            measured=residuals["measured_torque"],
            residual=residuals["residual"],
            angle_unit=self.vehicle.coordinate.unit,
            torque_unit=self.vehicle.coordinate.force_unit,
        )

    def _wanted(self, bag: Bag) -> Sequence[Channel]:
        """The vehicle's channels, without the optional one where the bag leaves open which topic it is."""
        *needed, air = self.vehicle.channels  # air is the last, so that all keep their numbers
        return self.vehicle.channels if self._optional(bag, air.topic) else needed

    def _optional(self, bag: Bag, name: str) -> str | None:
        """The recorded topic of an optional input; None where there is none, or more than one."""
        try:
            return bag.find_topic(name)
        except BagError as error:
            self._found.append(Finding("ambiguous_topic", "", f"{error}; none of them was used"))
            return None

    def _stream(self, bag: Bag, channels: Sequence[Channel], writer: BagWriter, progress: Progress | None) -> None:
        """All messages through the estimator and, with what comes of them, into the output."""
        outputs = Outputs(writer, self.vehicle)
        if old := sorted(outputs.topics & set(bag.topics)):
            statement = f"{', '.join(old)}: recorded before; replaced in the output by the results of this replay"
            self._found.append(Finding("replaced_topics", "", statement))
        command = self._optional(bag, COMMAND)
        for block in bag.blocks(channels, all_messages=True):
            if not len(block.messages):
                continue
            # Connections may still be added while a damaged file is read.
            number = [-1 if c.topic in outputs.topics else writer.add_connection(c) for c in bag.connections]
            first = self._counts["rows"]
            estimates, residuals = self._take(block, bag, command)
            writer.write(
                [
                    *copied(block.messages, np.array(number, np.int32)),
                    *outputs.of_estimates(estimates, block.log_ns[estimates["message"] - first]),
                    *outputs.of_residuals(residuals, block.log_ns[residuals["message"] - first]),
                ]
            )
            if progress is not None:
                progress(self.name, self._counts["messages"], bag.message_count)

    def _take(self, block: Block, bag: Bag, command: str | None) -> tuple[Records, Records]:
        """One block through the estimator, counted and compared."""
        estimates, residuals = self._push(block, bag, command)
        self._learn(block, estimates, residuals)
        self._counts.update(rows=block.channel.size, messages=len(block.messages), estimates=len(estimates))
        self._last(block.messages.log_ns)
        return estimates, residuals

    def _last(self, log_ns: IntArray) -> None:
        """Add the times at which the next messages were recorded to how long the recording lasts."""
        since = np.diff(log_ns, prepend=log_ns[0] if self._last_log_ns is None else self._last_log_ns)
        leaps = since > STRAY_NS
        self._lasted_ns += int(since[~leaps].sum())
        self._counts["leaps"] += int(leaps.sum())
        self._last_log_ns = int(log_ns[-1])

    def _push(self, block: Block, bag: Bag, command: str | None) -> tuple[Records, Records]:
        """One block through the estimator; each plan takes effect at its place among the samples, as in the node."""
        commands = [k for k, c in enumerate(bag.connections) if c.topic == command]
        plans = np.flatnonzero(np.isin(block.messages.connection, commands))
        channel, begin, parts = block.channel.astype(np.int64), 0, []
        if self._as_warm_as_air:
            self._begin_with_air(block)
        for plan, end in zip([*plans, None], [*np.searchsorted(block.message, plans), channel.size], strict=True):
            rows = slice(begin, end)
            parts.append(
                self.estimator.push_block(channel[rows], block.stamp_ns[rows], block.value[rows], block.rate[rows])
            )
            if plan is not None:
                self._plan(block.messages.bytes_of(int(plan)))
            begin = end
        estimates, residuals = (np.concatenate(tables) for tables in zip(*parts, strict=True))
        return self._records((estimates, residuals))

    def _records(self, pushed: tuple[Records, Records]) -> tuple[Records, Records]:
        """Estimates and residuals that are finite numbers."""
        return self._finite(pushed[0], "total"), self._finite(pushed[1], "residual")

    def _begin_with_air(self, block: Block) -> None:
        """Rubber as warm as the first air of the first block; the vehicle file's where none is recorded there."""
        self._as_warm_as_air = False
        number = next((i for i, c in enumerate(self.vehicle.channels) if c.kind is Kind.AIR_TEMPERATURE), -1)
        recorded = block.value[(block.channel == number) & (np.abs(block.value) < AIR_LIMIT_DEGC)]
        if recorded.size:
            self._begin_at(float(recorded[0]))
        else:
            statement = "no air temperature at the start; the rubber begins as the vehicle file says"
            self._found.append(Finding("no_air_temperature", "", statement))

    def _begin_at(self, rubber_degC: float) -> None:
        self.estimator.begin_at(rubber_degC)
        self._rubber_degC = rubber_degC

    def _finite(self, rows: Records, field: str) -> Records:
        """Rows whose torque is a finite number; the node publishes no other either."""
        finite = np.isfinite(rows[field])
        self._counts["withheld"] += int((~finite).sum())
        return np.asarray(rows[finite])

    def _plan(self, raw: bytes) -> None:
        latest_ns = max(self.estimator.latest_ns[f"angle/{side}"] for side in self.vehicle.sides)
        try:
            if len(raw) > PLAN_BYTES:
                raise DataError(f"more than {PLAN_BYTES} bytes")
            try:
                message = stock_types().deserialize_cdr(raw, TRAJECTORY)
            except Exception as error:  # flipped bytes may raise anything
                raise DataError("malformed") from error
            self.estimator.set_plan(*planned_angles(message, self._joints, latest_ns))
            self._commands["accepted"] += 1
        except DataError as error:
            self._commands[str(error)] += 1
            self.estimator.refuse_plan()

    def _learn(self, block: Block, estimates: Records, residuals: Records) -> None:
        """Statistics and curves."""
        for i in range(len(self.vehicle.channels)):
            stamps = block.stamp_ns[(block.channel == i) & (block.stamp_ns > 0)]
            if stamps.size:
                begin, end = self._spans.get(i, (stamps[0], stamps[0]))
                self._spans[i] = min(begin, int(stamps.min())), max(end, int(stamps.max()))
        if self._clocks is None:
            start_ns = _first_stamp(block, len(self.vehicle.sides))
            if start_ns is None:
                return
            self._clocks = Timeline(start_ns), Timeline(start_ns)
        self._compare(estimates, residuals)

    def _compare(self, estimates: Records, residuals: Records) -> None:
        """Curves, and the agreement with the measured torque."""
        assert self._clocks is not None
        sides = len(self.vehicle.sides)
        time_s = self._clocks[0](estimates["stamp_ns"])
        columns = estimates["theta"][:, :sides], estimates["temperature"][:, :sides], estimates["total"][:, None]
        self.motion.add(time_s, np.concatenate(columns, axis=1).T)
        time_s = self._clocks[1](residuals["stamp_ns"])
        self.check.add(time_s, np.stack([residuals["measured_torque"], residuals["residual"]]))
        self.fit.add(time_s, residuals["measured_torque"], residuals["residual"])

    def _samples(self, bag: Bag | None, topics: Mapping[Channel, str]) -> dict[str, InputCounts]:
        """Per input: the recorded topic, samples used, rejected by reason, and what is worth a note about used ones."""
        table: dict[str, InputCounts] = {}
        for channel, (label, counts) in zip(self.vehicle.channels, self.estimator.counters.items(), strict=True):
            rejected = {reason: n for reason, n in counts.items() if reason not in NOT_REJECTED}
            if bag is not None and channel in topics and bag.malformed[topics[channel]]:
                rejected["malformed"] = bag.malformed[topics[channel]]
            noted = {reason: counts[reason] for reason in NOT_REJECTED[1:] if reason in counts}
            table[label] = InputCounts(topics.get(channel), counts["accepted"], rejected, noted)
        if self._commands and bag is not None:
            used = self._commands.pop("accepted", 0)
            table["command"] = InputCounts(bag.find_topic(COMMAND), used, dict(self._commands), {})
        return table

    def _why_no_fit(self, samples: Mapping[str, InputCounts]) -> str:
        """What came of pressures or measured torque, and how far their stamps are from the angles' where they miss them."""
        angle, words = self._spans[0], [self._counted(samples, Kind.PRESSURE, Kind.TORQUE)]
        for i, (channel, label) in enumerate(zip(self.vehicle.channels, samples, strict=False)):
            if channel.kind not in (Kind.PRESSURE, Kind.TORQUE):
                continue
            begin, end = self._spans.get(i, angle)
            if end < angle[0]:
                words.append(f"{label}: stamps end {(angle[0] - end) * 1e-9:.1f} s before those of the angles begin")
            elif begin > angle[1]:
                words.append(f"{label}: stamps begin {(begin - angle[1]) * 1e-9:.1f} s after those of the angles end")
        return "; ".join(words)

    def _last_findings(self) -> Iterator[Finding]:
        fit = self.fit
        sums = fit.squares, fit.estimates, fit.spread + fit.count * fit.mean**2
        residual, estimate, measured = (math.sqrt(squares / max(fit.count, 1)) for squares in sums)
        if said := sheet_words(*sums, self.vehicle):
            yield Finding("wrong_sheet", "", said)
        elif is_large(residual, estimate, measured, self.vehicle):
            statement = "the residual is as large as the torque: units, signs, plugs or clocks may be wrong; 'diagnose' tells which"
            yield Finding("large_residual", "", statement)
        if leaps := self._counts["leaps"]:
            statement = f"times of recording leap by more than a day {counted(leaps, 'time')}; leaps are not counted as recorded"
            yield Finding("log_time", "", statement)
        set_back = self._clocks[0].set_back if self._clocks else 0
        if set_back:
            yield Finding("clock_set_back", "", f"stamps jumped back {counted(set_back, 'time')}")
        if restarts := self.estimator.restarts:
            statement = f"the estimator began anew {counted(restarts, 'time')} (clock set back, or a torque that was no finite number)"
            yield Finding("restart", "", statement)
        if self._counts["withheld"]:
            statement = f"{counted(self._counts['withheld'], 'result was no finite number', 'results were no finite numbers')}; left out"
            yield Finding("withheld", "", statement)
        if self.estimator.saturated_steps:
            statement = "with a temperature outside the rubber table, whose edge was used"
            yield Finding("rubber_table_left", "", f"{counted(self.estimator.saturated_steps, 'step')} {statement}")
        for law, steps in self.estimator.law_left_steps.items():
            if steps:
                statement = f"{law} of the vehicle file: {counted(steps, 'step')} with a coordinate outside the range on which it was seen"
                yield Finding("law_left", "", f"{statement}; the law is not known there")

    def _counted(self, samples: Mapping[str, InputCounts], *kinds: Kind) -> str:
        """What came on the inputs of some kinds, in words."""
        words = []
        for channel, (label, counts) in zip(self.vehicle.channels, samples.items(), strict=False):
            if channel.kind not in kinds:
                continue
            if counts.topic is None:
                words.append(f"{label}: topic '{channel.topic}' missing")
                continue
            reasons = [f"{n} {reason}" for part in (counts.rejected, counts.noted) for reason, n in part.items()]
            if not reasons and not counts.used and channel.joint:
                reasons = [f"'{counts.topic}' has no message with the joint '{channel.joint}'"]
            words.append(", ".join([f"{label}: {counted(counts.used, 'sample')} used", *reasons]))
        return "; ".join(words) or "no pressure or torque sensor in the vehicle file"

    def _picture(self, file: Path, fit: Agreement | None, origin: Provenance) -> tuple[str | None, str | None]:
        if note := no_pictures():
            file.unlink(missing_ok=True)  # of an earlier run: it would not belong to this result
            return None, note
        from lugre_steering.replay.figure import draw_replay

        draw_replay(self.name, self.vehicle, self.motion, self.check, fit, origin, file)
        return file.name, None


def degrees(text: str | None) -> float:
    """A temperature as it is typed."""
    try:
        return float(text or "")
    except ValueError:
        raise DataError(f"--initial-temperature {text}: expected a number of degC, or 'air'") from None


def _first_stamp(block: Block, sides: int) -> int | None:
    """First header stamp [ns] that belongs to this recording: not zero, not far from where the angles' clock puts it.

    None without such a stamp. The angles are the first channels; they alone give torques.
    """
    offset = block.stamp_ns - block.log_ns
    usual = np.sort(offset[(block.channel < sides) & (block.stamp_ns > 0)])
    if not usual.size:
        return None
    # One of them, not the mean of two: half of the stamps may be of another clock.
    near = (block.stamp_ns > 0) & (np.abs(offset - usual[(usual.size - 1) // 2]) <= STRAY_NS)
    return int(block.stamp_ns[near].min())
