# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Sensors, clocks and losses of the field: what a recording brings that no sheet says."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from lugre_steering.proof.sensors import NoiseKind, Samples

Array = NDArray[np.float64]

DEG = float(np.pi / 180.0)
STATED = {"angle_resolution_deg": 0.0055, "angle_noise_deg": 0.01, "pressure_reference": "gauge", "pressure_range_Pa": 25.0e6,
          "pressure_noise_Pa": 1.5e4}  # fmt: skip
"""What every sheet says of its sensors."""


class Dirt(NamedTuple):
    """How the sensors and the logger of one case behave (SI; shares of the pressure range where they are shares)."""

    angle_step: float = 0.0055 * DEG
    angle_noise: float = 0.01 * DEG
    pressure_bits: int = 15
    white_share: float = 6e-4
    coloured_share: float = 0.0
    colour_s: float = 0.3
    ripple_share: float = 0.0
    ripple_Hz: float = 40.0
    hysteresis_share: float = 0.0
    settling_share: float = 0.0
    late_s: float = 0.0
    jitter_s: float = 2e-4
    skew_s: float = 0.0
    drift: float = 0.0
    stagger_s: float = 0.0
    angle_Hz: float = 100.0
    pressure_Hz: float = 100.0
    lost: float = 0.0
    burst_s: float = 0.0
    gap_s: float = 0.0
    cut_share: float = 0.0
    air_topic: bool = False


def draw_clean(noise: NoiseKind, rng: np.random.Generator) -> Dirt:
    """As the sheet says, with one of three kinds of noise on top."""
    return Dirt(
        coloured_share=4e-4 if noise == "coloured" else 0.0, ripple_share=1e-3 if noise == "ripple" else 0.0,
        ripple_Hz=float(rng.uniform(3.0, 15.0)),
    )  # fmt: skip


def draw_dirt(noise: NoiseKind, rng: np.random.Generator) -> Dirt:
    """Every line of the table of what recordings bring; most are drawn evenly in the logarithm, some stay away in half the cases."""

    def between(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    def sometimes(value: float, share: float = 0.5) -> float:
        return value if rng.random() < share else 0.0

    step = between(0.005, 0.1) if rng.random() < 0.5 else 360.0 / 2 ** int(rng.integers(12, 15))
    angle_Hz = between(10.0, 400.0) if rng.random() < 0.9 else between(400.0, 1000.0)
    mixed = rng.random() < 0.5
    return Dirt(
        angle_step=min(step, 0.1) * DEG, angle_noise=between(0.002, 0.05) * DEG, pressure_bits=int(rng.integers(8, 17)),
        white_share=between(2e-4, 1e-2 if noise == "white" else 2e-3), coloured_share=between(2e-4, 5e-3) if noise == "coloured" else 0.0,
        colour_s=between(0.05, 1.0), ripple_share=between(2e-4, 5e-3) if noise == "ripple" else 0.0, ripple_Hz=between(10.0, 200.0),
        hysteresis_share=sometimes(5e-4), settling_share=sometimes(between(2e-4, 2e-3)), late_s=rng.uniform(0.0, 0.01),
        jitter_s=between(1e-4, 5e-3), skew_s=sometimes(rng.uniform(-0.03, 0.03)), drift=sometimes(rng.uniform(-5e-5, 5e-5)),
        stagger_s=sometimes(rng.uniform(0.0, 0.5 / angle_Hz)), angle_Hz=angle_Hz,
        pressure_Hz=float(np.clip(angle_Hz * between(0.2, 5.0), 10.0, 1000.0)) if mixed else angle_Hz,
        lost=sometimes(between(0.002, 0.4)), burst_s=sometimes(between(0.05, 1.0)), gap_s=sometimes(rng.uniform(1.0, 6.0), 0.3),
        cut_share=sometimes(rng.uniform(0.05, 0.3)), air_topic=bool(rng.random() < 0.5),
    )  # fmt: skip


def _stamps(span_s: float, rate_Hz: float, offset_s: float, dirt: Dirt, rng: np.random.Generator) -> tuple[Array, Array]:
    """Instants of one sensor and what its messages are stamped with, losses taken out."""
    instants = np.arange(offset_s + rng.uniform(0.0, 1.0 / rate_Hz), span_s - 0.02, 1.0 / rate_Hz)
    waits = np.minimum(rng.exponential(max(dirt.jitter_s, 1e-9), instants.size), 0.5 / rate_Hz + 2e-3)
    stamps = np.maximum.accumulate(instants + dirt.late_s + waits)
    stamps = stamps + 1e-7 * np.arange(stamps.size)  # received at once is still received one after the other
    kept = rng.random(instants.size) >= dirt.lost
    if dirt.burst_s > 0.0 and dirt.lost > 0.0:  # the same share, lost in stretches
        length = max(round(dirt.burst_s * rate_Hz), 1)
        kept = np.repeat(rng.random(instants.size // length + 1) >= dirt.lost, length)[: instants.size]
    return instants[kept], stamps[kept]


def _coloured(count: int, time_s: float, rate_Hz: float, rng: np.random.Generator) -> Array:
    keep = np.exp(-1.0 / (rate_Hz * time_s))
    return np.asarray(lfilter([np.sqrt(1.0 - keep**2)], [1.0, -keep], rng.normal(size=count)))


def _lagging(value: Array, width: float) -> Array:
    """Hysteresis of a sensor: a play of ``width`` that shows half on either side."""
    if width <= 0.0:
        return value
    out, at = np.empty_like(value), value[0]
    for k, now in enumerate(value):
        at = min(max(at, now - 0.5 * width), now + 0.5 * width)
        out[k] = at
    return out


def sense(
    time: Array, angles: Array, pressure: Array, dirt: Dirt, rng: np.random.Generator
) -> tuple[tuple[Samples, ...], tuple[Samples, ...]]:
    """Angles (2, n) and pressures (lines, n) as recorded; the pressures' device has a clock of its own."""
    span, reach = float(time[-1]), STATED["pressure_range_Pa"]
    assert isinstance(reach, float)
    gap = rng.uniform(0.3, 0.8) * span
    seen_angles, seen_pressures = [], []
    for side, angle in enumerate(angles):
        instants, stamps = _stamps(span, dirt.angle_Hz, side * dirt.stagger_s, dirt, rng)
        value = np.interp(instants, time, angle) + rng.normal(0.0, dirt.angle_noise, instants.size)
        seen_angles.append(_without(stamps, np.round(value / dirt.angle_step) * dirt.angle_step, gap, dirt.gap_s))
    wander = np.cumsum(rng.normal(0.0, 0.02, time.size))
    phases = rng.uniform(0.0, 2.0 * np.pi, len(pressure))
    quantum = reach / 2**dirt.pressure_bits
    for line, phase in zip(pressure, phases, strict=True):
        instants, stamps = _stamps(span, dirt.pressure_Hz, 0.0, dirt, rng)
        value = _lagging(np.interp(instants, time, line), dirt.hysteresis_share * reach)
        value += reach * dirt.white_share * rng.normal(size=instants.size)
        value += reach * dirt.coloured_share * _coloured(instants.size, dirt.colour_s, dirt.pressure_Hz, rng)
        swing = np.sin(2.0 * np.pi * dirt.ripple_Hz * instants + np.interp(instants, time, wander) + phase)
        value += reach * dirt.ripple_share * swing * (0.3 + np.interp(instants, time, line) / 1e7)
        value += reach * dirt.settling_share * rng.choice([-1.0, 1.0]) * np.exp(-instants / 30.0)
        stamps = (stamps + dirt.skew_s) * (1.0 + dirt.drift)
        seen_pressures.append(_without(stamps, np.round(value / quantum) * quantum, gap, dirt.gap_s))
    return tuple(seen_angles), tuple(seen_pressures)


def _without(stamps: Array, value: Array, start_s: float, length_s: float) -> Samples:
    """The samples outside a gap in which the logger slept."""
    kept = (stamps < start_s) | (stamps >= start_s + length_s)
    return Samples(stamps[kept], value[kept])
