# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""A motion for measuring, and what an engineer would read off it for each effect: no parameter of anybody's law.

Every measure takes the torque with an effect and without it on the same motion, whoever computed them. Both tracks turn alike.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

STEP_S = 1e-3
DEG = float(np.pi / 180.0)
LEGS: tuple[tuple[float, float, float], ...] = (
    (1.12, 5.0, 20.0), (-1.12, 5.0, 2.0), (0.0, 5.0, 0.5), (0.12, 5.0, 0.0), (-0.7, 2.0, 0.0), (0.7, 9.0, 0.0), (-0.7, 9.0, 0.0),
    (0.7, 2.0, 0.0), (-0.7, 2.0, 1.0),
)  # fmt: skip
"""Target in units of the steering limit, rate [deg/s], rest [s] after it: beyond both limits, a long dwell, reversals, two rates."""
LEVEL_SHARE = 0.02
"""Level at which a stop is felt, as a share of the sliding torque: 1 kN m on the reference vehicle."""
FAST, SLOW = (5, 6), (7, 8)


@dataclass(frozen=True)
class Trip:
    """The probe (n,): time [s], angle of both tracks [rad], its derivatives, and the number of the leg; ``limit`` [rad]."""

    time: Array
    angle: Array
    rate: Array
    acceleration: Array
    leg: NDArray[np.int64]
    limit: float


@dataclass(frozen=True)
class Seen:
    """Torque of the probe (n,) [N m] with an effect and without it; ``scale``: sliding torque [N m]."""

    motion: Trip
    torque: Array
    without: Array
    scale: float

    @property
    def extra(self) -> Array:
        return self.torque - self.without

    @property
    def way(self) -> Array:
        return np.sign(self.motion.rate)

    def middle(self, legs: tuple[int, ...]) -> NDArray[np.bool_]:
        """Samples near the middle angle in some legs, well in motion."""
        m = self.motion
        return np.isin(m.leg, legs) & (np.abs(m.angle) < 0.3 * m.limit) & (np.abs(m.rate) > 0.5 * DEG)


def motion(limit: float) -> Trip:
    """The probe for a vehicle that steers to ``limit`` [rad]; rates fade in and out over half a second."""
    rates, legs = [np.zeros(round(1.0 / STEP_S))], [np.full(round(1.0 / STEP_S), -1)]
    at = 0.0
    for number, (share, rate, rest) in enumerate(LEGS):
        span = share * limit - at
        ramp = min(0.5, 0.5 * abs(span) / (rate * DEG))
        t = np.arange(0.0, abs(span) / (rate * DEG) + ramp, STEP_S)
        profile = np.sin(0.5 * np.pi * np.clip(np.minimum(t, t[-1] - t) / ramp, 0.0, 1.0)) ** 2
        rates += [profile * span / (profile.sum() * STEP_S), np.zeros(round(rest / STEP_S))]
        legs += [np.full(profile.size, number), np.full(round(rest / STEP_S), number)]
        at = share * limit
    rate_series = np.concatenate(rates)
    angle = np.concatenate([[0.0], np.cumsum(rate_series[:-1]) * STEP_S])
    time = np.arange(angle.size, dtype=np.float64) * np.float64(STEP_S)
    return Trip(time, angle, np.gradient(angle, STEP_S), np.gradient(np.gradient(angle, STEP_S), STEP_S), np.concatenate(legs), limit)


def sliding_torque(seen_without: Array) -> float:
    """Size of the friction torque [N m]: the upper quartile of its magnitude on the probe."""
    return float(np.percentile(np.abs(seen_without), 75.0))


# --- measures: None where the probe does not show it ---------------------------------------------------------------------

Measure = Callable[[Seen], float | None]


def _crossing(angle: Array, value: Array, level: float) -> float | None:
    """Angle at which a series first reaches a level."""
    over = np.flatnonzero(value >= level)
    if over.size == 0 or over[0] == 0:
        return None
    k = over[0]
    share = (level - value[k - 1]) / (value[k] - value[k - 1])
    return float(angle[k - 1] + share * (angle[k] - angle[k - 1]))


def stop_angle(seen: Seen) -> float | None:
    """Mean of the angles [rad] of both ends at which the stop's torque reaches LEVEL_SHARE of the sliding torque."""
    m, found = seen.motion, []
    for leg, side in ((0, 1.0), (1, -1.0)):
        part = (m.leg == leg) & (side * m.angle > 0.0) & (side * m.rate > 0.0)
        found.append(_crossing(side * m.angle[part], side * seen.extra[part], LEVEL_SHARE * seen.scale))
    reached = [angle for angle in found if angle is not None]
    return float(np.mean(reached)) if reached else None


def reversal_step(seen: Seen) -> float:
    """Half the step of the extra torque [N m] at a quick reversal."""
    m = seen.motion
    before = seen.extra[np.flatnonzero((m.leg == 5) & (np.abs(m.rate) > 2.0 * DEG))[-1]]
    after = seen.extra[np.flatnonzero((m.leg == 6) & (np.abs(m.rate) > 2.0 * DEG))[0]]
    return float(0.5 * (before - after))


def rate_torque(seen: Seen) -> float:
    """Extra torque against the motion [N m] at 9 deg/s less that at 2 deg/s."""
    against = seen.extra * seen.way
    return float(against[seen.middle(FAST)].mean() - against[seen.middle(SLOW)].mean())


def lost_angle(seen: Seen) -> float | None:
    """Angle [rad] by which the torque comes later after a reversal, where it is half the sliding torque of the other sign."""
    part = (seen.motion.leg == 6) & (seen.motion.rate < 0.0)
    at = [_crossing(-seen.motion.angle[part], -torque[part], 0.5 * seen.scale) for torque in (seen.torque, seen.without)]
    return None if at[0] is None or at[1] is None else float(at[0] - at[1])


def held_loss(seen: Seen) -> float:
    """Share of the torque that is lost during the long dwell, beyond what is lost without the effect."""
    m = seen.motion
    held = np.flatnonzero((m.leg == 0) & (np.abs(m.rate) < 1e-6) & (m.angle > m.limit))
    return float(-(seen.extra[held[-1]] - seen.extra[held[0]]) / seen.torque[held[0]])


def peak_after_dwell(seen: Seen) -> float:
    """Largest extra torque against the motion in the sweep after the dwell, as a share of the sliding torque."""
    part = (seen.motion.leg == 1) & (seen.motion.rate < -1.0 * DEG)
    return float((seen.extra * seen.way)[part].max() / seen.scale)


def patch_change(seen: Seen) -> float | None:
    """Relative change of the torque where the patch is felt by more than half its largest effect."""
    size = np.abs(seen.extra)
    part = (size > 0.5 * size.max()) & (np.abs(seen.without) > 0.3 * seen.scale) & (np.abs(seen.motion.rate) > 0.5 * DEG)
    return float(np.median(seen.extra[part] / seen.without[part])) if part.any() else None


def level_at_end(seen: Seen) -> float:
    """Relative change of the sliding torque in the last legs."""
    part = seen.middle(SLOW)
    return float((seen.extra * seen.way)[part].mean() / seen.scale)


def asymmetry(seen: Seen) -> float:
    """Half the relative difference of the sliding torque between both directions."""
    against, part = seen.extra * seen.way / seen.scale, seen.middle((*FAST, *SLOW))
    return float(0.5 * (against[part & (seen.way > 0.0)].mean() - against[part & (seen.way < 0.0)].mean()))


def torque_2_deg_in(seen: Seen) -> float:
    """Extra torque 2 deg after a reversal, as a share of the sliding torque."""
    part = np.flatnonzero(seen.motion.leg == 6)
    at = part[np.argmin(np.abs(seen.motion.angle[part] - (seen.motion.angle[part[0]] - 2.0 * DEG)))]
    return float(-seen.extra[at] / seen.scale)


def per_acceleration(seen: Seen) -> float:
    """Extra torque per acceleration [kg m2]."""
    a = seen.motion.acceleration
    return float(np.sum(seen.extra * a) / np.sum(a * a))


def slope(seen: Seen) -> float:
    """Slope of the extra torque about the middle [N m/rad]."""
    part = seen.middle((*FAST, *SLOW))
    return float(np.polyfit(seen.motion.angle[part], seen.extra[part], 1)[0])


def bias(seen: Seen) -> float:
    """Mean extra torque [N m] near the middle, both directions alike."""
    part = seen.middle((*FAST, *SLOW))
    return float(0.5 * (seen.extra[part & (seen.way > 0.0)].mean() + seen.extra[part & (seen.way < 0.0)].mean()))


def drift(seen: Seen) -> float:
    """Change of the extra torque in time near the middle [N m/s]."""
    part = seen.middle((0, 1, 2, *FAST, *SLOW))
    return float(np.polyfit(seen.motion.time[part], seen.extra[part], 1)[0])


def time_shift(seen: Seen) -> float:
    """Time [s] by which the torque comes late."""
    change = -np.gradient(seen.without, seen.motion.time)
    return float(np.sum(seen.extra * change) / np.sum(change * change))


def gain_at_ends(seen: Seen) -> float:
    """Mean relative extra torque at both ends of the last legs."""
    m = seen.motion
    part = np.isin(m.leg, (*FAST, *SLOW)) & (np.abs(m.angle) > 0.6 * m.limit) & (np.abs(seen.without) > 0.5 * seen.scale)
    return float(np.mean(seen.extra[part] / seen.without[part]))


MEASURES: dict[str, tuple[str, str, Measure]] = {
    "end_stop": ("angle at 2 % of the sliding torque", "rad", stop_angle),
    "cylinder_friction": ("half the step at reversal", "N m", reversal_step),
    "back_pressure": ("half the step at reversal", "N m", reversal_step),
    "line_loss_linear": ("torque at 9 less 2 deg/s", "N m", rate_torque),
    "line_loss_quadratic": ("torque at 9 less 2 deg/s", "N m", rate_torque),
    "viscous_friction": ("torque at 9 less 2 deg/s", "N m", rate_torque),
    "backlash": ("angle lost after reversal", "rad", lost_angle), "linkage_compliance": ("angle lost after reversal", "rad", lost_angle),
    "stress_relaxation": ("share lost in 20 s", "1", held_loss), "trapped_pressure": ("share lost in 20 s", "1", held_loss),
    "static_ageing": ("peak after 20 s at rest", "1", peak_after_dwell), "surface_patch": ("relative change of level", "1", patch_change),
    "wear_polishing": ("level at the end", "1", level_at_end), "heat_partition": ("level at the end", "1", level_at_end),
    "carcass_heat_sink": ("level at the end", "1", level_at_end), "flash_temperature": ("level at the end", "1", level_at_end),
    "ambient_drift": ("level at the end", "1", level_at_end), "direction_asymmetry": ("half the difference of directions", "1", asymmetry),
    "distributed_contact": ("torque 2 deg after reversal", "1", torque_2_deg_in),
    "payne_softening": ("torque 2 deg after reversal", "1", torque_2_deg_in),
    "yaw_inertia": ("torque per acceleration", "kg m2", per_acceleration), "kingpin_jacking": ("slope about the middle", "N m/rad", slope),
    "slope_bias": ("mean torque", "N m", bias), "pressure_offset": ("mean torque", "N m", bias),
    "pressure_drift": ("change of torque", "N m/s", drift), "time_delay": ("time shift", "s", time_shift),
    "pressure_lag": ("time shift", "s", time_shift), "moment_arm_error": ("relative torque at the ends", "1", gain_at_ends),
}  # fmt: skip
"""What is measured, its unit and how. Left out: what the probe does not show apart from the calibration, or only by chance."""
