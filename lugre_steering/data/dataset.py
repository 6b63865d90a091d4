# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Recordings on the time base of diagnosis: smoothed motion, measured torque, and what its noise is."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.ndimage import gaussian_filter1d, minimum_filter1d

from lugre_steering.data.sensing import SensorNoise, louder, sensed
from lugre_steering.data.smoother import smooth_angle
from lugre_steering.data.stamps import evened
from lugre_steering.errors import DataError
from lugre_steering.recording import Array, Kind, Mask, Recording, Signal
from lugre_steering.vehicle import Vehicle
from lugre_steering.vehicle.actuation import line_pressures, total_gains
from lugre_steering.vehicle.cylinders import gauge_offset, line_gains
from lugre_steering.vehicle.size import angle_unit

MAX_RATE_HZ = 125.0
TORQUE = "measured_torque"
"""The channel of a torque sensor."""
GAP_S = 0.25
TURNED_RAD = 1e-4
"""Step of the derivative of arms by the angle."""
BRIDGED_S = 0.05
"""Longest step between samples over which the torque still counts as measured, unless the channel is slower than that."""
AIR_S, AIR_STEP_K = 10.0, 0.25
"""Seconds over which the air is averaged (rubber takes minutes to follow), and the change that counts."""
REACH, LONG = 3.0, 0.9
"""Standard deviations over which an average reaches; share of the time between two samples of the longer of two steps."""
BRIDGED = 1.5
"""Times the usual time between messages from which one is missing."""
MEAN = (0.75, 0.125)
"""Shares of the middle sample, and of each beside it, in the mean over a step of what is straight between them."""
CLOCK_S = 1e-3
"""What is left of an offset between clocks [s] after it was measured: they wander."""


@dataclass(frozen=True)
class Run:
    """One bag, resampled on a uniform clock of n samples; sides first, lines second, time last.

    ``side_torque`` (sides, n) is each side's share of the measured torque and ``side_slope`` its derivative by the angle at
    constant pressures [N m/rad], ``gains`` (sides, lines, n) torque per pressure,
    ``sigma`` (n,) standard deviation of the measured torque from the sheet's pressure noise, ``valid`` (n,) false in gaps.
    """

    name: str
    time: Array
    theta: Array
    omega: Array
    alpha: Array
    gains: Array
    pressure: Array
    side_torque: Array
    side_slope: Array
    measured: Array
    sigma: Array
    valid: Mask
    air: tuple[tuple[float, float], ...] = ()
    """Instants [s] from which the recorded air has another temperature [degC]; before the first, that of the vehicle file."""
    angle_unit: float = 1.0
    """Size of the machine's travel, in which the rate is given below which it counts as standing."""
    first_air: float | None = None
    """Recorded air temperature [degC] at the start; None where none was recorded."""
    angle: SensorNoise = field(default_factory=lambda: SensorNoise(0.0, 0.0))
    """The worst angle sensor as one sample of this clock shows it [rad]."""
    rounding: Array = field(default_factory=lambda: np.zeros(0))
    """Step of each pressure sensor [Pa] (lines,) that its noise does not dither; 0 elsewhere, empty if none has one."""
    on_receipt: bool = False
    """Whether stamps were late by chance: given on receipt, they do not know when the devices measured."""
    clock_s: float = CLOCK_S
    """Standard deviation [s] of what torque and angles may still be apart once their clocks are set."""
    raw: Array = field(default_factory=lambda: np.zeros((0, 0)))
    """Angles (sides, n) [rad] before smoothing."""
    bridged: Mask = field(default_factory=lambda: np.zeros(0, bool))
    """Where a sample of a channel is missing (n,), so that a line is in its place."""
    sharp: Array | None = None
    """Plain second difference of the angles (sides, n) [rad/s2], which an inertia has in place of the smooth ``alpha``: its noise is white,
    and no law but one in proportion to it may have it."""
    average_s: float = 0.0
    """Standard deviation [s] of the Gaussian average through which ``measured`` is seen, as predictions must be; see ``in_parallel``."""
    mean_of: float | None = None
    """Where each sample of ``measured`` is the mean over its step, as predictions must be: of how many independent ones, by its noise."""
    midway: bool = False
    """Whether the friction level follows the rate midway between samples, to second order, and not that at their end: of joints, whose
    friction may turn within one."""

    @cached_property
    def steps(self) -> tuple[Array, Array, Array, Array]:
        """Time, angle, rate and acceleration (sides, m) as the chain takes them, the first of which is a sample.

        Midway it takes two steps per sample: one nearly as long, at the rate of its middle, and a short one to the sample's own rate.
        """
        if not self.midway:
            return self.time, self.theta, self.omega, self.alpha
        span = np.diff(self.time)

        def joined(values: Array, between: Array) -> Array:
            both = np.stack([between, values[..., 1:]], axis=-1)
            return np.concatenate([values[..., :1], both.reshape(*values.shape[:-1], -1)], axis=-1)

        def at(share: float, values: Array) -> Array:
            return (1.0 - share) * values[..., :-1] + share * values[..., 1:]

        turned = np.diff(self.theta, axis=1)
        bend = (1.0 - LONG) * (span * self.omega[:, :-1] - turned) - LONG * (span * self.omega[:, 1:] - turned)
        theta = joined(self.theta, at(LONG, self.theta) + LONG * (1.0 - LONG) * bend)  # cubic between samples
        omega = joined(self.omega, at(0.5 * LONG, self.omega))
        return joined(self.time, at(LONG, self.time)), theta, omega, joined(self.alpha, at(LONG, self.alpha))

    @property
    def torque_per_line(self) -> Array:
        """Vehicle torque per pressure of each line [N m/Pa] (lines, n)."""
        summed: Array = self.gains.sum(axis=0)
        return summed


def motion(time: Array, theta: Array) -> tuple[Array, Array]:
    """Rate and acceleration (sides, n) of smoothed angles by central differences.

    The acceleration is the second difference over neighbours: the rate differentiated once more would span twice as many
    samples and flatten short transients (an inertia came out 3 % too large at 125 Hz).
    """
    step = float(time[1] - time[0])
    return np.gradient(theta, step, axis=1), acceleration(time, theta)


def acceleration(time: Array, theta: Array) -> Array:
    """Second difference (sides, n) of angles."""
    step = float(time[1] - time[0])
    return np.pad(np.diff(theta, 2, axis=1) / step**2, ((0, 0), (1, 1)), mode="edge")


def averaged(run: Run, torque: Array) -> Array:
    """A torque (n,) [N m] through the average of a run."""
    if run.mean_of is not None:
        middle, sides = MEAN
        wide = np.concatenate([torque[:1], torque, torque[-1:]])
        torque = middle * torque + sides * (wide[:-2] + wide[2:])
    if not run.average_s:
        return torque
    return np.asarray(gaussian_filter1d(torque, run.average_s / float(run.time[1] - run.time[0]), truncate=REACH))


def impulse(size: int) -> Array:
    """One in the middle of zeros (size,)."""
    return np.asarray(np.arange(size) == size // 2, float)


def in_parallel(run: Run, average_s: float) -> Run:
    """The run with the plain second difference of its angles beside their smooth acceleration, and its torque averaged; predictions are
    averaged alike (parallel filtering, as M. Gautier, ICRA 1997, 2278, for robots).

    Smoothed angles have an acceleration of steps, and errors in a regressor make its coefficient smaller. An average that acts on both
    sides of an equation takes nothing from one that it leaves on the other.
    """
    averaging = replace(run, average_s=average_s)
    response = averaged(averaging, impulse(run.time.size))
    reach = 2 * int(np.ceil(REACH * average_s / float(run.time[1] - run.time[0]))) + 3
    return replace(
        averaging, sharp=acceleration(run.time, run.raw), measured=averaged(averaging, run.measured),
        sigma=run.sigma * float(np.linalg.norm(response)),
        valid=minimum_filter1d((run.valid & ~run.bridged).astype(np.uint8), reach, mode="constant") > 0,
    )  # fmt: skip


def as_recorded(run: Run) -> Run:
    """The run with its torque as it was measured."""
    return replace(run, measured=run.side_torque.sum(axis=0), sharp=None, average_s=0.0)


def prepare(recording: Recording, vehicle: Vehicle) -> Run:
    """Common clock, smoothed angles, measured torque. Raises DataError when a needed channel is missing or too short."""
    signals = {f"angle/{side}": recording.angle.get(side) for side in vehicle.sides}
    lines = vehicle.hydraulics.lines if vehicle.hydraulics is not None else ()
    signals |= {f"pressure/{line}": recording.pressure.get(line) for line in lines}
    if vehicle.torque_sensor is not None:
        signals[TORQUE] = recording.measured_torque
    topics = [channel.topic for channel in vehicle.channels if channel.kind is not Kind.AIR_TEMPERATURE]
    for topic, (name, signal) in zip(topics, signals.items(), strict=True):
        if signal is None or signal.time_s.size < 20:
            found = "nothing" if signal is None else f"{signal.time_s.size} samples that can be used"
            raise DataError(f"{recording.name}: {name} (topic '{topic}'): got {found}, expected at least 20 samples")
    present = {name: signal for name, signal in signals.items() if signal is not None}
    present = {name: evened(signal)[0] for name, signal in present.items()}
    time, valid = _clock(recording.name, present)
    seen = {name: _on_clock(time, signal, sensed(signal, jumps=name == TORQUE)) for name, signal in present.items()}
    worst = max((seen[f"angle/{side}"] for side in vehicle.sides), key=lambda sensor: sensor.sigma())
    angle = worst if worst.sigma() > vehicle.sensors.angle_sigma else SensorNoise(vehicle.sensors.angle_sigma, 0.0)
    raw = np.array([_at(time, present[f"angle/{side}"]) for side in vehicle.sides])
    theta = np.array([smooth_angle(row, angle.sigma(), inert=vehicle.rubber is None) for row in raw])
    omega, alpha = motion(time, theta)
    rounding = np.zeros(0)
    if vehicle.hydraulics is not None:
        gains = line_gains(vehicle, theta)
        pressure = np.array([_at(time, present[f"pressure/{line}"]) for line in lines]) - gauge_offset(vehicle)
        turned = line_gains(vehicle, theta + TURNED_RAD)
        sensors = [seen[f"pressure/{line}"] for line in lines]
        sheet = vehicle.sensors.pressure_noise_Pa
        usual = np.array([[max(sheet, sensor.sigma())] for sensor in sensors])
        noise = usual * np.array([_louder(time, present[f"pressure/{line}"], sheet) for line in lines])
        sigma = np.sqrt(((gains.sum(axis=0) * noise) ** 2).sum(axis=0))
        if any(sensor.coarse and sensor.sigma() > vehicle.sensors.pressure_noise_Pa for sensor in sensors):
            rounding = np.array([sensor.resolution if sensor.coarse else 0.0 for sensor in sensors])
    else:
        assert vehicle.torque_sensor is not None
        gains = turned = np.full((len(vehicle.sides), 1, time.size), 1.0 / len(vehicle.sides))
        pressure = _at(time, present[TORQUE])[None, :]
        sheet = vehicle.torque_sensor.noise_Nm
        sigma = max(sheet, seen[TORQUE].sigma()) * _louder(time, present[TORQUE], sheet, jumps=True)
    side_torque, side_slope = _of_sides(gains, turned, pressure)
    measured = side_torque.sum(axis=0)
    if float(np.ptp(measured)) <= 1e-9 * float(np.abs(measured).max()):
        raise DataError(
            f"{recording.name}: the measured torque is {measured[0]:g} {vehicle.coordinate.force_unit} all the time, expected one that "
            "varies; look at the sensors and their drivers"
        )
    floor = 1e-3 * float(np.std(measured)) + 1e-12
    return Run(
        name=recording.name, time=time, theta=theta, omega=omega, alpha=alpha, gains=gains, pressure=pressure,
        side_torque=side_torque, side_slope=side_slope, measured=measured, sigma=np.maximum(sigma, floor), valid=valid,
        air=_air(recording.air_temperature, vehicle), first_air=_first_air(recording.air_temperature), angle=angle,
        rounding=rounding, angle_unit=angle_unit(vehicle), raw=raw, bridged=_bridged(time, present),
        midway=vehicle.contact is not None,
    )  # fmt: skip


def _air(recorded: Signal | None, vehicle: Vehicle) -> tuple[tuple[float, float], ...]:
    """Where the recorded air temperature, averaged over a while, leaves the last one that counts."""
    if recorded is None or vehicle.initial is None or not recorded.time_s.size:
        return ()
    steps, now = [], vehicle.initial.air_temperature_degC
    edges = np.searchsorted(recorded.time_s, np.arange(recorded.time_s[0], recorded.time_s[-1], AIR_S))
    for value, time in zip(np.split(recorded.value, edges[1:]), np.split(recorded.time_s, edges[1:]), strict=True):
        if value.size and abs(float(np.mean(value)) - now) > AIR_STEP_K:
            now = float(np.mean(value))
            steps.append((float(time[0]), now))
    return tuple(steps)


def with_hydraulics(run: Run, vehicle: Vehicle) -> Run:
    """The run as the cylinders of another vehicle would show it: same motion, same pressures."""
    gains, turned = line_gains(vehicle, run.theta), line_gains(vehicle, run.theta + TURNED_RAD)
    side_torque, side_slope = _of_sides(gains, turned, run.pressure)
    return replace(run, gains=gains, side_torque=side_torque, side_slope=side_slope, measured=side_torque.sum(axis=0))


def measured_with(run: Run, vehicle: Vehicle) -> Array:
    """The measured torque (n,) alone of such a run."""
    return np.asarray(_sides_torque(line_gains(vehicle, run.theta), run.pressure).sum(axis=0))


def _of_sides(gains: Array, turned: Array, pressure: Array) -> tuple[Array, Array]:
    """Torque of each side (sides, n) [N m] by its gains (sides, lines, n), and its slope [N m/rad] by those of angles turned a little."""
    return _sides_torque(gains, pressure), _sides_torque((turned - gains) / TURNED_RAD, pressure)


def _sides_torque(gains: Array, pressure: Array) -> Array:
    return np.asarray(np.einsum("slt,lt->st", gains, pressure))


def _first_air(recorded: Signal | None) -> float | None:
    """Mean of the first AIR_S of the recorded air [degC]."""
    if recorded is None or not recorded.time_s.size:
        return None
    return float(np.mean(recorded.value[recorded.time_s <= recorded.time_s[0] + AIR_S]))


def ideal_run(vehicle: Vehicle, name: str, time: Array, theta: Array, rates: tuple[Array, Array], torque: Array, sigma: float) -> Run:
    """A run (n samples) whose perfect sensors see ``torque`` at ``theta`` (sides, n); ``rates``: its first two derivatives."""
    if vehicle.hydraulics is not None:
        gains, turned = line_gains(vehicle, theta), line_gains(vehicle, theta + TURNED_RAD)
        pressure = line_pressures(torque, total_gains(vehicle, theta))
    else:
        gains = turned = np.full((len(vehicle.sides), 1, time.size), 1.0 / len(vehicle.sides))
        pressure = torque[None, :]
    omega, alpha = rates
    side_torque, side_slope = _of_sides(gains, turned, pressure)
    return Run(
        name=name, time=time, theta=theta, omega=omega, alpha=alpha, gains=gains, pressure=pressure,
        side_torque=side_torque, side_slope=side_slope,
        measured=torque, sigma=np.full(time.size, sigma), valid=np.ones(time.size, bool),
    )  # fmt: skip


def _clock(name: str, signals: dict[str, Signal]) -> tuple[Array, Mask]:
    """Uniform clock over the span that all channels share, at the slowest channel's rate; false where any has a gap."""
    spacing = {key: float(np.median(np.diff(signal.time_s))) for key, signal in signals.items()}
    step = max(*spacing.values(), 1.0 / MAX_RATE_HZ)
    # A faster signal is averaged over each step: the window must not reach beyond its ends.
    margin = {key: 0.5 * step if round(step / spacing[key]) > 1 else 0.0 for key in signals}
    start = max(signal.time_s[0] + margin[key] for key, signal in signals.items())
    end = min(signal.time_s[-1] - margin[key] for key, signal in signals.items())
    count = int((end - start) / step) + 1 if end > start else 0
    if count < 20:
        raise DataError(
            f"{name}: the channels share {max(end - start, 0.0):.2f} s, expected at least {20 * step:.1f} s"
        )
    time = start + step * np.arange(count)
    valid = np.ones(count, bool)
    for signal in signals.values():
        after = np.clip(np.searchsorted(signal.time_s, time), 1, signal.time_s.size - 1)
        valid &= signal.time_s[after] - signal.time_s[after - 1] <= max(BRIDGED_S, 3.0 * step)
    return time, valid


def _bridged(time: Array, signals: dict[str, Signal]) -> Mask:
    """Where the samples (n,) lie between messages of a channel that are farther apart than usual."""
    bridged = np.zeros(time.size, bool)
    for signal in signals.values():
        spacing = np.diff(signal.time_s)
        after = np.clip(np.searchsorted(signal.time_s, time), 1, signal.time_s.size - 1)
        bridged |= spacing[after - 1] > BRIDGED * float(np.median(spacing))
    return bridged


def _on_clock(time: Array, signal: Signal, sensor: SensorNoise) -> SensorNoise:
    """What a sample of the clock has of a sensor's noise: less where several samples are averaged."""
    averaged = _averaged(time, signal)
    return sensor if sensor.coarse else SensorNoise(sensor.sigma(averaged), 0.0)


def _louder(time: Array, signal: Signal, sheet: float, *, jumps: bool = False) -> Array:
    """How many times its usual noise a channel has, on the clock."""
    return np.interp(time, signal.time_s, louder(signal, sheet, by_level=True, jumps=jumps))


def _averaged(time: Array, signal: Signal) -> int:
    """Samples of a signal per sample of the clock."""
    return max(1, round(float(time[1] - time[0]) / float(np.median(np.diff(signal.time_s)))))


def _at(time: Array, signal: Signal) -> Array:
    """Signal on the clock: linear interpolation; a faster signal is averaged over each step first, so nothing aliases."""
    at, value = signal.time_s, signal.value
    width = _averaged(time, signal)
    if width > 1:
        # Symmetric for even widths too (half weight at both ends): half a sample of delay would look like physics.
        kernel = np.ones(width + 1 - width % 2) / width
        if width % 2 == 0:
            kernel[[0, -1]] *= 0.5
        # The stamps are averaged alike: where messages are lost, the mean lies elsewhere.
        edge = kernel.size // 2
        before, after = at[0] - (at[1] - at[0]) * np.arange(edge, 0, -1), at[-1] + (at[-1] - at[-2]) * np.arange(1, edge + 1)
        at = np.convolve(np.concatenate([before, at, after]), kernel, mode="valid")
        value = np.convolve(np.pad(value, edge, mode="edge"), kernel, mode="valid")
    return np.interp(time, at, value)
