# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The estimator on well-behaved and ill-behaved messages: time rules, rejects, residual. All data are synthetic."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from lugre_steering.errors import DataError
from lugre_steering.estimator import WAITING_RING, Estimator, Options
from lugre_steering.recording import Array
from lugre_steering.vehicle import EffectEntry, TorqueSensor, Vehicle, load
from lugre_steering.vehicle.model import baseline_parameters

VEHICLE = load(Path(__file__).resolve().parents[1] / "config" / "test_vehicle.yaml")
JOINT = load(Path(__file__).resolve().parents[1] / "config" / "single_joint_example.yaml")
T0 = 1_790_000_000_000_000_000
MS = 1_000_000
LEFT, RIGHT, MAIN_A, MAIN_B, AUX_A, AUX_B, AIR = range(7)
Message = tuple[int, int, float]


def angle(stamp_ns: int, share: float = 1.0) -> float:
    return share * 0.3 * math.sin((stamp_ns - T0) * 1e-9 * 0.7)


BEGUN = 20
"""Samples at the start without a residual: these pressures disagree with bristles that are relaxed."""


def pressure(line: int, stamp_ns: int) -> float:
    return 5e6 + 1e6 * line + 4e6 * math.sin((stamp_ns - T0) * 1e-9 * 0.7 + line)


def messages(
    duration_s: float = 6.0, line_rates: tuple[float, ...] = (50.0, 50.0, 80.0, 40.0), offset_ms: float = 0.0
) -> list[Message]:
    """100 Hz angles, lines at their own rates and phases, air at 1 Hz; in stamp order."""
    found: list[Message] = []
    for i in range(round(duration_s * 100)):
        stamp = T0 + i * 10 * MS
        found += [(LEFT, stamp, angle(stamp)), (RIGHT, stamp + round(offset_ms * MS), angle(stamp, 0.95))]
    for line, rate in enumerate(line_rates):
        for i in range(round(duration_s * rate) + 1):
            stamp = T0 - 7 * MS + line * MS + round(i / rate * 1e9)
            found.append((MAIN_A + line, stamp, pressure(line, stamp)))
    found += [(AIR, T0 + i * 1000 * MS, 15.0) for i in range(round(duration_s))]
    return sorted(found, key=lambda m: m[1])


def feed(stream: list[Message], vehicle: Vehicle = VEHICLE, options: Options | None = None):  # type: ignore[no-untyped-def]
    estimator = Estimator(vehicle, options)
    channel, stamp, value = (np.array(column) for column in zip(*stream, strict=True))
    estimates, residuals = estimator.push_block(
        channel, stamp.astype(np.int64), value.astype(float), np.full(len(stream), np.nan)
    )
    return estimator, estimates, residuals


def drop_message(records: Array) -> list[Array]:
    """Every field but those that depend on the order of arrival: the number of the completing message, and what was known
    of the residual by then, which decides about the feed-forward."""
    return [records[name] for name in records.dtype.names if name not in ("message", "doubts", "feed_forward")]


def rejected(estimator: Estimator) -> dict[str, dict[str, int]]:
    return {
        k: {r: n for r, n in row.items() if r != "accepted"} for k, row in estimator.counters.items() if len(row) > 1
    }


def test_every_angle_pair_gives_one_torque_and_residuals_follow_in_order() -> None:
    estimator, estimates, residuals = feed(messages())
    assert estimates.size == 600
    assert rejected(estimator) == {}
    assert np.all(np.diff(residuals["stamp_ns"]) > 0)
    assert residuals.size >= 595 - BEGUN
    assert set(residuals["stamp_ns"]) <= set(estimates["stamp_ns"])


def test_single_pushes_equal_a_block() -> None:
    stream = messages(2.0)
    _, estimates, residuals = feed(stream)
    one = Estimator(VEHICLE)
    torque, residual = [], []
    for m in stream:
        e, r = one.push(*m)
        torque += list(e["total"])
        residual += list(r["residual"])
    np.testing.assert_array_equal(torque, estimates["total"])
    np.testing.assert_array_equal(residual, residuals["residual"])


@pytest.mark.parametrize("channel", [-1, len(VEHICLE.channels), 50_000, 10**9])
def test_a_channel_that_there_is_not_is_refused(channel: int) -> None:
    """The compiled loop checks no bounds: it wrote beside its memory, or took the process with it."""
    estimator = Estimator(VEHICLE)
    with pytest.raises(DataError, match=rf"channel: got {channel}, expected 0 to {len(VEHICLE.channels) - 1}"):
        estimator.push(channel, T0, 0.1)
    stamps, values = np.array([T0, T0]), np.zeros(2)
    with pytest.raises(DataError, match=rf"channel: got {channel}, expected 0 to"):
        estimator.push_block(np.array([0, channel]), stamps, values, values)
    assert not any(counts["accepted"] for counts in estimator.counters.values())


def test_columns_that_do_not_belong_together_are_refused() -> None:
    with pytest.raises(DataError, match=r"got arrays of shapes \(4,\), \(1,\), \(1,\), \(1,\), expected \(n,\) of all"):
        Estimator(VEHICLE).push_block(np.array([0, 1, 0, 1]), np.array([T0]), np.zeros(1), np.zeros(1))


def test_the_snapshot_of_another_model_is_refused() -> None:
    estimator = Estimator(VEHICLE)
    other = VEHICLE.replace(effects=(EffectEntry("end_stop", {"engage_angle": 0.4, "stiffness": 9e4}),))
    with pytest.raises(DataError, match="not the snapshot of this model"):
        estimator.restore(Estimator(other).snapshot())


def test_residual_by_hand() -> None:
    _, estimates, residuals = feed(messages())
    assert VEHICLE.hydraulics is not None
    k = 300
    r = residuals[k]
    e = estimates[estimates["stamp_ns"] == r["stamp_ns"]][0]
    p: dict[str, float] = {"tank": 0.0}
    for line, (name, rate) in enumerate(zip(VEHICLE.hydraulics.lines, (50.0, 50.0, 80.0, 40.0), strict=True)):
        stamps = [T0 - 7 * MS + line * MS + round(i / rate * 1e9) for i in range(400)]
        after = next(s for s in stamps if s >= r["stamp_ns"])
        before = stamps[stamps.index(after) - 1]
        w = (r["stamp_ns"] - before) / (after - before)
        p[name] = (1 - w) * pressure(line, before) + w * pressure(line, after)
    torque = 0.0
    for c in VEHICLE.hydraulics.cylinders.values():
        th = e["theta"][VEHICLE.sides.index(c.side)]

        def length(a: float, c=c) -> float:  # type: ignore[no-untyped-def]
            kx, ky = c.knuckle_m
            x, y = kx * math.cos(a) - ky * math.sin(a), kx * math.sin(a) + ky * math.cos(a)
            return math.hypot(x - c.chassis_m[0], y - c.chassis_m[1])

        arm = (length(th + 1e-6) - length(th - 1e-6)) / 2e-6
        force = p[c.cap] * math.pi / 4 * c.bore_m**2 - p[c.rod] * math.pi / 4 * (c.bore_m**2 - c.rod_m**2)
        torque += force * arm
    assert r["measured_torque"] == pytest.approx(torque, rel=1e-7)
    assert r["residual"] == pytest.approx(torque - e["total"], rel=1e-6)


@pytest.mark.parametrize("seed", range(5))
def test_arrival_order_across_topics_does_not_matter(seed: int) -> None:
    stream = messages(4.0)
    rng = np.random.default_rng(seed)
    delay = {k: rng.uniform(0.0, 60 * MS) for k in range(7)}  # each topic has its own latency, up to six samples
    late = sorted(stream, key=lambda m: m[1] + delay[m[0]])
    assert late != stream
    _, estimates, residuals = feed(stream)
    other, late_estimates, late_residuals = feed(late)
    assert rejected(other) == {}
    for a, b in zip(drop_message(late_estimates), drop_message(estimates), strict=True):
        np.testing.assert_array_equal(a, b)
    n = min(residuals.size, late_residuals.size)
    assert n > 390 - BEGUN
    for a, b in zip(drop_message(late_residuals[:n]), drop_message(residuals[:n]), strict=True):
        np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize("offset_ms", [0.5, 3.0, 4.9])
def test_staggered_angle_topics_still_pair(offset_ms: float) -> None:
    estimator, estimates, _ = feed(messages(offset_ms=offset_ms))
    assert estimates.size >= 599
    assert rejected(estimator) == {}


@pytest.mark.parametrize("offset_ms", [30, 49])
def test_staggered_sides_of_ten_hertz_still_pair(offset_ms: int) -> None:
    angles = [m for m in messages() if m[0] in (LEFT, RIGHT) and (m[1] - T0) // (10 * MS) % 10 == 0]
    stream = [(k, stamp + offset_ms * MS * (k == RIGHT), *rest) for k, stamp, *rest in angles]
    estimator, estimates, _ = feed(sorted(stream, key=lambda m: m[1]))
    assert estimates.size >= len(angles) // 2 - 1
    assert rejected(estimator) == {}


def test_sides_at_different_rates() -> None:
    stream = [m for m in messages() if not (m[0] == RIGHT and (m[1] - T0) // (10 * MS) % 2)]
    estimator, estimates, _ = feed(stream)
    assert estimates.size == 300
    assert rejected(estimator) == {"angle/left": {"unpaired": 299}}
    # The side that has all its samples is the same as ever.
    _, every, _ = feed(messages())
    np.testing.assert_array_equal(estimates["torque"][:, 0], every["torque"][::2, 0])


def test_jitter_of_stamps() -> None:
    rng = np.random.default_rng(1)
    stream = []
    for i in range(600):
        stamp = T0 + i * 10 * MS + int(rng.uniform(-2, 2) * MS)
        stream += [(LEFT, stamp, angle(stamp)), (RIGHT, stamp + int(rng.uniform(0, 1) * MS), angle(stamp, 0.95))]
    _, estimates, residuals = feed(stream)
    assert estimates.size == 600
    assert residuals.size == 0
    _, clean, _ = feed([m for m in messages() if m[0] in (LEFT, RIGHT)])
    assert np.sqrt(np.mean((estimates["total"] - clean["total"]) ** 2)) < 0.01 * np.abs(clean["total"]).max()


def test_duplicates_and_backward_stamps_are_rejected_and_change_nothing() -> None:
    stream = messages()
    _, clean, _ = feed(stream)
    dirty: list[Message] = []
    for i, m in enumerate(stream):
        dirty.append(m)
        if i % 50 == 10:
            dirty.append(m)
        if i % 50 == 30:
            dirty.append((m[0], m[1] - 15 * MS, m[2] + 0.01))
    estimator, estimates, _ = feed(dirty)
    for a, b in zip(drop_message(estimates), drop_message(clean), strict=True):
        np.testing.assert_array_equal(a, b)
    counts = rejected(estimator)
    assert sum(row.get("duplicate", 0) for row in counts.values()) == sum(i % 50 == 10 for i in range(len(stream)))
    assert sum(row.get("backward", 0) for row in counts.values()) >= len(stream) // 50 - 7


@pytest.mark.parametrize(
    ("value", "reason"), [(math.nan, "not_finite"), (math.inf, "not_finite"), (40.0, "absurd"), (1.5, "spike")]
)
def test_single_bad_angles_are_rejected(value: float, reason: str) -> None:
    stream = messages()
    k = next(i for i, m in enumerate(stream) if m[0] == LEFT and m[1] >= T0 + 2000 * MS)
    stream[k] = (LEFT, stream[k][1], value)
    estimator, estimates, _ = feed(stream)
    assert rejected(estimator) == {"angle/left": {reason: 1}, "angle/right": {"unpaired": 1}}
    assert estimates.size == 599
    _, clean, _ = feed(messages())
    assert abs(estimates["total"][-1] - clean["total"][-1]) < 5.0


def rate_of(message: Message, lag_s: float = 0.0) -> float:
    """The rate of an angle message [rad/s], as a sensor would give it that is late by ``lag_s``."""
    share = 1.0 if message[0] == LEFT else 0.95
    return share * 0.3 * 0.7 * math.cos(((message[1] - T0) * 1e-9 - lag_s) * 0.7)


def with_rates(give):  # type: ignore[no-untyped-def]
    """The estimator and its torques with the rates that ``give`` makes of an angle message."""
    estimator, totals = Estimator(VEHICLE), []
    for message in messages():
        rate = give(message) if message[0] in (LEFT, RIGHT) else math.nan
        totals += [float(e["total"]) for e in estimator.push(*message, rate)[0]]
    return estimator, np.array(totals)


@pytest.mark.parametrize("lag_s", [0.0, 0.02])
@pytest.mark.parametrize("share", [1.0, 1.1, 0.9])
def test_rates_that_go_with_the_angle_are_used(lag_s: float, share: float) -> None:
    noise = np.random.default_rng(3).normal(0.0, 0.02, (2, 600))
    estimator, totals = with_rates(lambda m: share * rate_of(m, lag_s) + noise[m[0], (m[1] - T0) // (10 * MS)])
    assert rejected(estimator) == {}
    _, without = with_rates(lambda _: math.nan)
    assert not np.array_equal(totals, without)


@pytest.mark.parametrize("rate", [1.0, -1.0, 5.0, 9.9, 11.0, -50.0, math.inf, -math.inf, 1e300])
def test_single_rates_that_the_angle_contradicts_are_left_out(rate: float) -> None:
    bad = {(LEFT, T0 + i * 10 * MS) for i in (150, 152, 300, 450)}
    absurd, totals = with_rates(lambda m: rate if m[:2] in bad else rate_of(m))
    _, expected = with_rates(lambda m: math.nan if m[:2] in bad else rate_of(m))
    np.testing.assert_array_equal(totals, expected)
    assert rejected(absurd) == {"angle/left": {"absurd_rate": 4}}


@pytest.mark.parametrize("give", [
    pytest.param(lambda _: 0.0, id="zeros"),
    pytest.param(lambda m: math.degrees(rate_of(m)), id="degrees"),
    pytest.param(lambda m: -rate_of(m), id="sign"),
    pytest.param(lambda m: 0.5 * rate_of(m), id="half"),
    pytest.param(lambda m: rate_of(m) + 0.1, id="offset"),
    pytest.param(lambda m: rate_of(m, 1.0), id="late"),
])  # fmt: skip
def test_rates_that_the_angles_refute_are_no_longer_used(give) -> None:  # type: ignore[no-untyped-def]
    estimator, totals = with_rates(give)
    _, without = with_rates(lambda _: math.nan)
    counts = rejected(estimator)
    assert sorted(counts) == ["angle/left", "angle/right"]
    assert all(row["absurd_rate"] > 400 for row in counts.values())
    assert np.sqrt(np.mean((totals - without)[200:] ** 2)) < 0.01 * np.ptp(without)


def left_out(theta: Array, rate: Array, period_s: float = 0.01) -> Array:
    """How many rates of the left side have been left out, after every tenth sample of both sides (n / 10,)."""
    estimator, found = Estimator(VEHICLE), []
    for i, (angle_rad, rate_rad_s) in enumerate(zip(theta, rate, strict=True)):
        for side in (LEFT, RIGHT):
            estimator.push(side, T0 + round(i * period_s * 1e9), float(angle_rad), float(rate_rad_s))
        if i % 10 == 9:
            found.append(estimator.counters["angle/left"].get("absurd_rate", 0))
    return np.array(found)


SIGMA = math.hypot(math.radians(0.01), math.radians(0.0055) / math.sqrt(12.0))
"""Noise of one angle sample by the sheet [rad]."""


@pytest.mark.parametrize("spike_deg", [0.3, 1.0, 3.0])
@pytest.mark.parametrize("moving", [True, False])
def test_a_spike_of_the_angle_does_not_refute_the_rate(spike_deg: float, moving: bool) -> None:
    t = np.arange(0.0, 12.0, 0.01)
    theta = 0.3 * np.sin(0.7 * t) * moving + np.random.default_rng(1).normal(0.0, SIGMA, t.size)
    theta[600] += math.radians(spike_deg)
    assert left_out(theta, 0.21 * np.cos(0.7 * t) * moving)[-1] <= 2


@pytest.mark.parametrize("period_s", [0.01, 0.05])
def test_noise_of_the_rate_does_not_refute_it(period_s: float) -> None:
    """Ten minutes parked."""
    rng, t = np.random.default_rng(2), np.arange(0.0, 600.0, period_s)
    assert left_out(rng.normal(0.0, SIGMA, t.size), rng.normal(0.0, 0.01, t.size), period_s)[-1] == 0


@pytest.mark.parametrize(("share", "frequency_Hz", "amplitude"), [(0.0, 1.0, 0.1), (0.5, 0.3, 0.1), (2.0, 1.0, 0.1), (-1.0, 2.0, 0.02)])
def test_wrong_rates_of_an_oscillation_do_not_redeem_themselves(share: float, frequency_Hz: float, amplitude: float) -> None:
    t, omega = np.arange(0.0, 60.0, 0.01), 2.0 * math.pi * frequency_Hz
    theta = amplitude * np.sin(omega * t) + np.random.default_rng(4).normal(0.0, SIGMA, t.size)
    assert left_out(theta, share * amplitude * omega * np.cos(omega * t))[-1] > 5000


def test_rates_that_come_right_are_used_again() -> None:
    t = np.arange(0.0, 40.0, 0.01)
    theta = 0.3 * np.sin(0.7 * t) + np.random.default_rng(3).normal(0.0, SIGMA, t.size)
    found = left_out(theta, np.where(t < 10.0, 0.0, 0.21 * np.cos(0.7 * t)))
    assert found[99] > 900
    assert found[-1] == found[-100]


def test_a_torque_that_is_no_number_starts_the_estimator_anew() -> None:
    estimator, totals = Estimator(VEHICLE), []
    for i, m in enumerate(messages()):
        if i == 1000:
            estimator._state["z"][0] = math.nan
        totals += [float(e["total"]) for e in estimator.push(*m)[0]]
    assert len(totals) == 600
    assert sum(math.isnan(total) for total in totals) == 1
    assert estimator.restarts == 1
    assert max(abs(total) for total in totals[-100:]) > 1000.0


def test_a_torque_that_is_no_number_is_no_feed_forward_either() -> None:
    """Limits of value and rate had made one of it, on the way to the largest that they allow."""
    estimator, rows = Estimator(VEHICLE), []
    for i, m in enumerate(messages(3.0)):
        if i == 600:
            estimator._state["z"][0] = math.nan
        rows += [row.copy() for row in estimator.push(*m)[0]]
    bad = next(k for k, row in enumerate(rows) if math.isnan(row["total"]))
    before, during, after = (float(row["feed_forward"][0]) for row in rows[bad - 1 : bad + 2])
    assert math.isnan(during)
    fastest = 1.0 * float(baseline_parameters(VEHICLE)["sigma_0"])  # 1 rad/s, as nothing else is asked for [N m/s]
    assert abs(after - before) <= 1.001 * fastest * 0.01


@pytest.mark.parametrize("first", [3.0, -1.0])
def test_a_bad_first_angle_is_not_held_for_ever(first: float) -> None:
    """Then the vehicle stands: as soon as two samples contradict the first one, it never happened."""
    parked = [(k, T0 + i * 10 * MS, first if i + k == 0 else 0.0) for i in range(300) for k in (LEFT, RIGHT)]
    _, estimates, _ = feed(parked)
    assert estimates.size == 299
    assert np.all(estimates["total"][1:] == 0.0)
    assert np.all(estimates["theta"][1:] == 0.0)


def test_bad_pressures_and_air_are_rejected() -> None:
    stream = messages()
    extra = [
        (MAIN_A, T0 + 2003 * MS, math.nan),
        (MAIN_B, T0 + 2003 * MS, 1e12),
        (AIR, T0 + 2003 * MS, 400.0),
        (AUX_A, 0, 5e6),
    ]
    estimator, _, residuals = feed(sorted(stream + extra, key=lambda m: m[1] or T0 + 2003 * MS))
    assert rejected(estimator) == {
        "pressure/main_a": {"not_finite": 1},
        "pressure/main_b": {"absurd": 1},
        "air_temperature": {"absurd": 1},
        "pressure/aux_a": {"zero_stamp": 1},
    }
    _, _, clean = feed(stream)
    np.testing.assert_array_equal(residuals["residual"], clean["residual"])


def test_a_true_step_of_the_angle_is_believed_when_confirmed() -> None:
    stream = [(k, s, v + (1.0 if s >= T0 + 3000 * MS and k <= RIGHT else 0.0)) for k, s, v in messages()]
    estimator, estimates, _ = feed(stream)
    assert rejected(estimator)["angle/left"] == {"spike": 1, "angle_jump": 1}
    assert estimates.size == 599
    assert estimates["theta"][-1, 0] > 0.5


@pytest.mark.parametrize("channel", [LEFT, MAIN_A])
def test_a_single_absurd_stamp_far_ahead_does_not_lock_out(channel: int) -> None:
    stream = messages()
    k = next(i for i, m in enumerate(stream) if m[0] == channel and m[1] >= T0 + 2000 * MS)
    stream.insert(k, (channel, T0 + 10**9 * 10**9, stream[k][2]))
    estimator, estimates, residuals = feed(stream)
    assert list(rejected(estimator).values()) == [{"time_jump": 1}]
    assert estimates.size == 600
    assert residuals.size >= 595 - BEGUN


def test_jump_back_in_time_starts_anew_once_confirmed() -> None:
    first, again = messages(5.0), messages(5.0)
    estimator, estimates, residuals = feed(first + again)
    _, alone, alone_residuals = feed(again)
    restart = int(np.argmin(np.diff(estimates["stamp_ns"]))) + 1
    assert estimates["stamp_ns"][restart] < T0 + 50 * MS
    # One message of each side was spent on the confirmation.
    lost = alone.size - (estimates.size - restart)
    assert 1 <= lost <= 2
    assert abs(estimates["torque"][restart - 1, 0]) > 5000.0
    assert abs(estimates["torque"][restart, 0]) < 50.0  # bristles relaxed again
    np.testing.assert_allclose(estimates["total"][-1], alone["total"][-1], rtol=2e-2)  # on rubber as warm as it had become
    assert np.all(estimates["temperature"][-1] > alone["temperature"][-1] + 0.5)
    assert np.all(np.diff(residuals["stamp_ns"][-alone_residuals.size + 10 :]) > 0)
    assert rejected(estimator)["angle/left"]["time_jump"] == 1


def torque_error(estimates: Array, clean: Array) -> float:
    """Largest deviation of the total torque [N m] from that of a clean run, at the stamps both have."""
    _, i, j = np.intersect1d(estimates["stamp_ns"], clean["stamp_ns"], return_indices=True)
    assert i.size > 0.9 * clean.size
    return float(np.abs(estimates["total"][i] - clean["total"][j]).max())


@pytest.mark.parametrize("channel", [MAIN_A, AIR])
def test_stray_stamps_of_a_line_or_of_the_air_do_not_touch_the_torque(channel: int) -> None:
    stream = messages()
    k = next(i for i, m in enumerate(stream) if m[0] == channel and m[1] >= T0 + 3000 * MS)
    stream[k:k] = [(channel, T0 + 3600 * 1000 * MS + i * 10 * MS, stream[k][2]) for i in range(2)]
    estimator, estimates, residuals = feed(stream)
    _, clean, _ = feed(messages())
    np.testing.assert_array_equal(estimates["total"], clean["total"])
    assert estimator.restarts == 0
    assert residuals["stamp_ns"].max() > T0 + 5900 * MS


@pytest.mark.parametrize("channel", [MAIN_A, AIR])
def test_a_line_or_air_clock_set_back_does_not_touch_the_torque(channel: int) -> None:
    stream = [(k, s - 3000 * MS if k == channel and s > T0 + 4000 * MS else s, v) for k, s, v in messages(8.0)]
    stream.sort(key=lambda m: m[1] + (3000 * MS if m[0] == channel and m[1] > T0 + 1000 * MS else 0))
    estimator, estimates, _ = feed(stream)
    _, clean, _ = feed(messages(8.0))
    np.testing.assert_array_equal(estimates["total"], clean["total"])
    assert estimator.restarts == 0


@pytest.mark.parametrize("ahead_s", [5, 3600])
def test_stray_stamps_of_one_side_do_not_wipe_the_model(ahead_s: int) -> None:
    stream = messages()
    k = next(i for i, m in enumerate(stream) if m[0] == LEFT and m[1] >= T0 + 2000 * MS)
    stray = T0 + ahead_s * 1000 * MS + 2000 * MS
    stream[k:k] = [(LEFT, stray + i * 10 * MS, stream[k][2]) for i in range(2)]
    estimator, estimates, _ = feed(stream)
    _, clean, _ = feed(messages())
    assert estimator.restarts == 0
    assert estimates.size >= 598
    assert torque_error(estimates, clean) < 0.01 * np.abs(clean["total"]).max()


@pytest.mark.parametrize("ahead_ms", [600, 900, 1900, 9000])
def test_one_stray_stamp_costs_one_sample(ahead_ms: int) -> None:
    """Of a topic that both joints share."""
    sound, at = messages(), T0 + 2000 * MS
    stray = [(k, s + (ahead_ms * MS if s == at and k in (LEFT, RIGHT) else 0), v) for k, s, v in sound]
    estimator, estimates, _ = feed(stray)
    _, clean, _ = feed(sound)
    assert rejected(estimator) == {"angle/left": {"time_jump": 1}, "angle/right": {"time_jump": 1}}
    assert estimates.size == clean.size - 1
    assert torque_error(estimates, clean) < 0.02 * np.abs(clean["total"]).max()


@pytest.mark.parametrize("back_ms", [600, 1500, 1900])
def test_a_clock_set_back_by_less_than_a_jump_costs_half_a_second(back_ms: int) -> None:
    """So long it may be a sensor that catches up; from then on all samples are used."""
    stream = [(k, s - (back_ms * MS if i > 3000 else 0), v) for i, (k, s, v) in enumerate(messages(12.0))]
    estimator, estimates, _ = feed(stream)
    assert estimator.restarts == 1
    assert estimates.size == 1150


def test_a_flood_of_old_samples_sets_no_clock_back() -> None:
    """What a sensor sends once more, four tenths of a second of it at once, is refused."""
    sound = messages()
    k = next(i for i, m in enumerate(sound) if m[1] >= T0 + 3000 * MS)
    old = [m for m in sound[:k] if m[1] > T0 + 2600 * MS and m[0] in (LEFT, RIGHT)]
    estimator, estimates, _ = feed([*sound[:k], *old, *sound[k:]])
    _, clean, _ = feed(sound)
    assert estimator.restarts == 0
    assert np.array_equal(estimates["total"], clean["total"])


def test_heat_of_a_time_that_was_none_is_forgotten() -> None:
    """Stamps an hour ahead for a second, then right again: the rubber has not cooled in that hour."""
    hot = VEHICLE.replace(initial=dataclasses.replace(VEHICLE.initial, rubber_temperature_degC=60.0))
    sound = [m for m in messages(12.0) if m[0] in (LEFT, RIGHT)]
    false = [(k, s + (3_600_000 * MS if T0 + 4000 * MS < s < T0 + 5000 * MS else 0), v) for k, s, v in sound]
    _, estimates, _ = feed(false, hot)
    _, clean, _ = feed(sound, hot)
    during = estimates["stamp_ns"] > T0 + 3_600_000 * MS
    assert estimates["temperature"][during].max() < 40.0
    assert estimates["temperature"][-1] == pytest.approx(clean["temperature"][-1], abs=1.0)


def test_one_side_set_back_is_refused_until_its_clock_has_caught_up() -> None:
    stream = [(k, s - (2500 * MS if k == RIGHT and s >= T0 + 2000 * MS else 0), v) for k, s, v in messages()]
    estimator, estimates, _ = feed(stream)
    assert estimator.restarts == 0
    assert {"time_jump": 50, "backward": 199, "duplicate": 1}.items() <= rejected(estimator)["angle/right"].items()
    assert estimates["stamp_ns"].max() == T0 + 3490 * MS


def test_a_pause_of_both_sides_is_no_restart() -> None:
    stream = [(k, s + (60_000 * MS if s >= T0 + 3000 * MS else 0), v) for k, s, v in messages()]
    estimator, estimates, _ = feed(stream)
    assert estimator.restarts == 0
    assert estimates.size == 599  # the first sample of each side had to be confirmed
    assert rejected(estimator)["angle/left"] == {"time_jump": 1, "gap": 1}


@pytest.mark.parametrize("back_ms", [2500, 4000])
def test_a_clock_set_back_restarts_once_and_is_counted(back_ms: int) -> None:
    stream = [(k, s - (back_ms * MS if i > 3000 else 0), v) for i, (k, s, v) in enumerate(messages(12.0))]
    estimator, estimates, _ = feed(stream)
    assert estimator.restarts == 1
    assert sum(row.get("restart", 0) for row in estimator.counters.values()) == 1
    assert estimates.size >= 1198
    assert np.sum(np.diff(estimates["stamp_ns"]) < 0) == 1


def test_sides_of_different_rates_restart_together() -> None:
    slow = [m for m in messages() if not (m[0] == RIGHT and (m[1] - T0) // (10 * MS) % 10)]
    estimator, estimates, _ = feed(slow + slow)
    assert estimator.restarts == 1
    assert 118 <= estimates.size <= 120


def test_a_restart_keeps_the_count_of_steps_outside_the_rubber_table_and_counts_torques_without_pressures() -> None:
    hot = VEHICLE.replace(initial=dataclasses.replace(VEHICLE.initial, rubber_temperature_degC=150.0))
    angles = [m for m in messages() if m[0] in (LEFT, RIGHT)]
    estimator, _, _ = feed(angles, hot)
    before = estimator.saturated_steps
    assert before > 0
    for m in angles[:4]:
        estimator.push(*m)
    assert estimator.restarts == 1
    assert estimator.saturated_steps == before + 2  # of the first four, two confirmed the jump
    assert rejected(estimator)["angle/left"]["overrun"] == 600


def test_air_slower_than_any_jump_limit_is_taken_over() -> None:
    """Every 20 s: each sample stands alone."""
    stream = [m for m in messages(42.0) if m[0] in (LEFT, RIGHT)]
    rare = [(AIR, T0 + i * 20_000 * MS + MS, 15.0 - 20.0 * i) for i in range(3)]
    estimator, estimates, _ = feed(sorted(stream + rare, key=lambda m: m[1]))
    assert estimator.counters["air_temperature"] == {"accepted": 3}
    _, mild, _ = feed(sorted([*stream, rare[0]], key=lambda m: m[1]))
    assert np.all(estimates["temperature"][-1] < mild["temperature"][-1])


def test_gap_is_counted_and_no_residual_is_interpolated_across_it() -> None:
    stream = [m for m in messages() if not (m[0] == MAIN_A and T0 + 2000 * MS < m[1] < T0 + 3000 * MS)]
    estimator, estimates, residuals = feed(stream)
    assert estimates.size == 600
    assert rejected(estimator) == {"pressure/main_a": {"time_jump": 1, "gap": 1}}  # the first sample after it had to be confirmed
    inside = (residuals["stamp_ns"] > T0 + 2010 * MS) & (residuals["stamp_ns"] < T0 + 2980 * MS)
    assert not inside.any()
    assert residuals["stamp_ns"].max() > T0 + 5900 * MS


def test_late_line_and_missing_line() -> None:
    late = [m for m in messages() if not (m[0] == AUX_B and m[1] < T0 + 3000 * MS)]
    _, estimates, residuals = feed(late)
    assert estimates.size == 600
    assert residuals["stamp_ns"].min() >= T0 + 3000 * MS - 25 * MS
    assert residuals.size > 250
    missing = [m for m in messages() if m[0] != AUX_B]
    _, estimates, residuals = feed(missing)
    assert estimates.size == 600
    assert residuals.size == 0


def test_missing_side_gives_no_torque_and_is_told() -> None:
    estimator, estimates, _ = feed([m for m in messages(15.0) if m[0] != RIGHT])
    assert estimates.size == 0
    assert estimator.latest_ns["angle/right"] == 0
    assert rejected(estimator)["angle/left"]["unpaired"] == 1500 - WAITING_RING


def test_a_side_that_comes_much_later_than_the_other_still_pairs() -> None:
    """500 Hz, the right side 0.5 s late: 250 samples wait."""
    stream = [(k, T0 + i * 2 * MS, 1e-4 * i) for i in range(1500) for k in (LEFT, RIGHT)]
    estimator, estimates, _ = feed(sorted(stream, key=lambda m: m[1] + (500 * MS if m[0] == RIGHT else 0)))
    assert estimates.size == 1500
    assert rejected(estimator) == {}


def test_absolute_pressure_reference_is_removed() -> None:
    absolute = VEHICLE.replace(sensors=dataclasses.replace(VEHICLE.sensors, pressure_reference="absolute"))
    raised = [(k, s, v + (101_325.0 if MAIN_A <= k <= AUX_B else 0.0)) for k, s, v in messages()]
    _, _, gauge = feed(messages())
    _, _, shifted = feed(raised, absolute)
    np.testing.assert_allclose(shifted["measured_torque"], gauge["measured_torque"], rtol=1e-9, atol=1e-5)


def test_single_side_with_torque_sensor() -> None:
    """Such a vehicle has no pressure that could be absolute."""
    absolute = dataclasses.replace(VEHICLE.sensors, pressure_reference="absolute")
    one = VEHICLE.replace(sides=("left",), hydraulics=None, torque_sensor=TorqueSensor(), sensors=absolute)
    stream: list[Message] = []
    for i in range(300):
        stamp = T0 + i * 10 * MS
        stream += [(0, stamp, angle(stamp)), (1, stamp + 4 * MS, 100.0 + i)]
    _, estimates, residuals = feed(stream, one)
    assert estimates.size == 300
    k = 100
    r = residuals[k]
    i = (r["stamp_ns"] - T0) // (10 * MS)
    assert r["measured_torque"] == pytest.approx(100.0 + i - 0.4)
    assert r["residual"] == pytest.approx(r["measured_torque"] - estimates["total"][i])


def test_chambers_at_tank_pressure_add_nothing() -> None:
    """The torque of all chambers is that of the caps, the rods at the tank, and that of the rods, the caps at the tank."""
    assert VEHICLE.hydraulics is not None
    cylinders, measured = VEHICLE.hydraulics.cylinders, []
    for tank in ({}, {"rod": "tank"}, {"cap": "tank"}):
        at_tank = {name: dataclasses.replace(cylinder, **tank) for name, cylinder in cylinders.items()}
        vehicle = VEHICLE.replace(hydraulics=dataclasses.replace(VEHICLE.hydraulics, cylinders=at_tank))
        measured.append(feed(messages(1.0), vehicle)[2]["measured_torque"])
    both, caps, rods = measured
    np.testing.assert_allclose(caps + rods, both, rtol=0.0, atol=1e-9 * np.abs(caps).max())
    assert np.abs(rods).max() > 2e3


def test_an_angle_without_noise_is_taken_as_it_is() -> None:
    exact = VEHICLE.replace(sensors=dataclasses.replace(VEHICLE.sensors, angle_noise_deg=0.0, angle_resolution_deg=0.0))
    stops = [(k, s, round(v, 2) if k in (LEFT, RIGHT) else v) for k, s, v in messages(3.0)]  # stands and steps by turns
    _, estimates, _ = feed(stops, exact)
    assert len(set(estimates["theta"][:, 0])) > 20
    np.testing.assert_allclose(estimates["theta"][:, 0], [v for k, _, v in stops if k == LEFT], atol=1e-12)


def test_rubber_begins_as_warm_as_told() -> None:
    estimator = Estimator(VEHICLE)
    estimator.begin_at(60.0)
    assert estimator.push(LEFT, T0, 0.0)[0].size == 0
    assert estimator.push(RIGHT, T0, 0.0)[0]["temperature"][0] == pytest.approx([60.0, 60.0])
    for degC in (-80.1, 150.1, math.nan):
        with pytest.raises(DataError, match="expected -80 to 150 degC"):
            estimator.begin_at(degC)
    with pytest.raises(DataError, match="this vehicle has no rubber"):
        Estimator(JOINT).begin_at(20.0)


def test_air_temperature_is_taken_over() -> None:
    cold = [(k, s, -20.0 if k == AIR else v) for k, s, v in messages()]
    _, estimates, _ = feed(cold)
    _, mild, _ = feed(messages())
    assert np.all(estimates["temperature"][-1] < mild["temperature"][-1])


def test_snapshot_and_restore() -> None:
    stream = messages(4.0)
    estimator = Estimator(VEHICLE)
    for m in stream[:1000]:
        estimator.push(*m)
    saved = estimator.snapshot()
    first = [float(e["total"][0]) for m in stream[1000:] for e, _ in [estimator.push(*m)] if e.size]
    estimator.restore(saved)
    second = [float(e["total"][0]) for m in stream[1000:] for e, _ in [estimator.push(*m)] if e.size]
    assert first == second
    fresh = Estimator(VEHICLE)
    fresh.restore(saved)
    assert [float(e["total"][0]) for m in stream[1000:] for e, _ in [fresh.push(*m)] if e.size] == first


def test_feed_forward_without_a_horizon_is_the_torque_and_ahead_leads_it() -> None:
    angles = [m for m in messages() if m[0] in (LEFT, RIGHT)]  # the made-up pressures would speak against the model
    _, now, _ = feed(angles)
    np.testing.assert_array_equal(now["feed_forward"], now["torque"])
    _, ahead, _ = feed(angles, options=Options(feed_forward_horizon_s=0.1))
    lead = np.sqrt(np.mean((ahead["feed_forward"][100:-10, 0] - now["torque"][110:, 0]) ** 2))
    assert lead < np.sqrt(np.mean((now["torque"][100:-10, 0] - now["torque"][110:, 0]) ** 2))
