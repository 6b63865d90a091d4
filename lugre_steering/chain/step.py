# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""One compiled ``step`` shared by the live node, replay, simulation and diagnosis, and runs over whole records.

Parameter records know the composition that they belong to (by the name of their last field); what is compiled here takes
the step of that composition.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numba import njit
from numba.extending import overload

from lugre_steering.chain.compiled import IN_PLACE, LAW_OPTIONS
from lugre_steering.chain.compose import ADDS, ADDS_WARMTH, FEELS, Composition, compose, composition_of, name_of
from lugre_steering.chain.layout import BASELINE_FIELDS, OUTPUT
from lugre_steering.recording import Array, IntArray

Records = np.ndarray[Any, np.dtype[np.void]]


def step(p, s, rubber, out, dt, theta_measured, omega, alpha, effects):
    """One sample of one track, for compiled code: see ``template.STEP``."""
    composition_of(name_of(p.dtype.names)).step(p, s, rubber, out, dt, theta_measured, omega, alpha, effects)


def arm_factor(p, theta):
    """True moment arm over that of the drawing at an angle [rad], for compiled code."""
    return composition_of(name_of(p.dtype.names)).arm_factor(p, theta)


def line_error(q, elapsed):
    """What the sensor of a line reads too much [Pa], for compiled code."""
    return composition_of(name_of(q.dtype.names)).line_error(q, elapsed)


@overload(step, jit_options=IN_PLACE)
def _step(p, s, rubber, out, dt, theta_measured, omega, alpha, effects):  # noqa: ARG001
    return composition_of(name_of(list(p.fields))).step


@overload(arm_factor, jit_options=LAW_OPTIONS)
def _arm_factor(p, theta):  # noqa: ARG001
    return composition_of(name_of(list(p.fields))).arm_factor


@overload(line_error, jit_options=LAW_OPTIONS)
def _line_error(q, elapsed):  # noqa: ARG001
    return composition_of(name_of(list(q.fields))).line_error


def beside(p, theta, omega, alpha):
    """Torque [N m] of those effects that only add to that of the contact, for compiled code: see ``template.BESIDE``."""
    return composition_of(name_of(p.dtype.names)).beside(p, theta, omega, alpha)


@overload(beside, jit_options=LAW_OPTIONS)
def _beside(p, theta, omega, alpha):  # noqa: ARG001
    return composition_of(name_of(list(p.fields))).beside


@njit(nogil=True, cache=True)
def _added(p, theta, omega, alpha, torque):
    for track in range(theta.shape[0]):
        for i in range(theta.shape[1]):
            torque[i] += beside(p[0], theta[track, i], omega[track, i], alpha[track, i])


@njit(nogil=True, cache=True)
def _run(p, s, rubber, time, theta, omega, alpha, out, previous, effects):
    for i in range(time.size):
        step(p[0], s[0], rubber, out[i], time[i] - previous, theta[i], omega[i], alpha[i], effects)
        previous = time[i]


@njit(nogil=True, cache=True)
def _torques(p, states, rubber, scratch, time, theta, omega, alpha, torques, first, last, effects):
    # Sample by sample: tracks do not wait for each other, so the processor works on both at once.
    previous = time[max(first - 1, 0)]
    for i in range(first, last):
        for track in range(theta.shape[0]):
            here = states[track], rubber, scratch[track]
            step(p[0], *here, time[i] - previous, theta[track, i], omega[track, i], alpha[track, i], effects)
            torques[track, i] = scratch[track].torque
        previous = time[i]


def new_parameters(composition: Composition) -> Records:
    """A parameter record (shape (1,)) with every effect neutral; the other baseline fields are still to be set."""
    record = np.zeros(1, composition.parameters)
    record["torque_unit"] = record["angle_unit"] = record["acceleration_unit"] = 1.0
    return record


def new_state(p: Records, tracks: int = 1) -> Records:
    """State records (tracks,) before the first sample, for tracks with parameters ``p``."""
    assert p.dtype.names is not None
    return _empty(composition_of(name_of(p.dtype.names)).state, tracks)


def _empty(kind: np.dtype[np.void], count: int = 1) -> Records:
    """Records (count,) of numbers that are all zero; NumPy itself would zero each field by itself."""
    return records_of(np.zeros(count * kind.itemsize // 8), kind)


def records_of(numbers: Array, kind: np.dtype[np.void]) -> Records:
    """Numbers as records, in the same memory; a ``view`` would ask of each field whether that is allowed."""
    return np.ndarray(numbers.nbytes // kind.itemsize, kind, numbers)


def acting(p: Records) -> int:
    """Hooks of the step where an effect of a record (1,) acts, one bit each; see ``Composition.bits``."""
    assert p.dtype.names is not None
    bits = composition_of(name_of(p.dtype.names)).bits
    return int(np.bitwise_or.reduce(bits[p.view(np.float64) != 0.0]))


def _bare(p: Records) -> Records:
    """The record of a track without effects, for the step of the baseline alone: three tenths faster than with all stages in place."""
    kind = compose(()).parameters
    numbers = np.zeros(kind.itemsize // 8)
    numbers[: len(BASELINE_FIELDS)] = p.view(np.float64)[: len(BASELINE_FIELDS)]
    return records_of(numbers, kind)


def run_side(
    p: Records,
    rubber: Array,
    time: Array,
    theta: Array,
    omega: Array,
    alpha: Array,
    state: Records | None = None,
    previous_time: float | None = None,
) -> Records:
    """Whole record of one track -> OUTPUT records (n,); ``time`` [s] increases.

    A given ``state`` is advanced in place; ``previous_time`` is the stamp of the sample it stands at, if it has one.
    """
    out = np.zeros(time.size, OUTPUT)
    previous = float(time[0]) if previous_time is None else previous_time
    time, theta, omega, alpha = (np.ascontiguousarray(values) for values in (time, theta, omega, alpha))  # one compiled form
    _run(p, new_state(p) if state is None else state, rubber, time, theta, omega, alpha, out, previous, acting(p))
    return out


def torque_side(p: Records, rubber: Array, time: Array, theta: Array, omega: Array, alpha: Array) -> Array:
    """Whole record of one track -> torque [N m] only (n,); the fast path of fits. Same arithmetic as ``run_side``."""
    return torque_in_phases([(-np.inf, p)], rubber, time, theta, omega, alpha)


def _read_otherwise(p: Records, states: Records, rubber: Array, scratch: Records, time: Array, *motion: Array) -> None:
    """Turn the angles at which tracks stand to what parameters ``p`` read of the last sample, without turning any contact."""
    read, (theta, omega, alpha) = states.copy(), motion
    _torques(p, read, rubber, scratch, time, theta, omega, alpha, np.empty(theta.shape), 0, 1, acting(p))
    turned = read["theta"] - states["theta"]
    states["theta"] += turned
    states["contact_angle"] += turned


def apart(phases: Sequence[Array], kind: np.dtype[np.void], warms: bool) -> Array | None:
    """Numbers of those effects that only add to the torque of a contact and do so alike in all ``phases``, which lose them; None if there
    are none, or others feel what they add. ``phases``: the numbers of parameter records of a ``kind``; ``warms``: whether rubber is heated
    by what the contact does.
    """
    assert kind.names is not None
    adding, others, feeling = _roles(name_of(kind.names), warms)
    shares = phases[0][adding]
    if not shares.any() or any(numbers[feeling].any() or (numbers[adding] != shares).any() for numbers in phases):
        return None
    beside = phases[0].copy()
    beside[others] = 0.0
    for numbers in phases:
        numbers[adding] = 0.0
    return beside


@lru_cache(maxsize=64)
def _roles(name: str, warms: bool) -> tuple[IntArray, IntArray, IntArray]:
    """Numbers of the parameter record of a composition: of effects that only add, of all others that have a role, amplitudes of those that
    feel it; see ``Composition.adds``."""
    roles = composition_of(name).adds
    adding = (roles == ADDS) | ((roles == ADDS_WARMTH) & (not warms))
    return np.flatnonzero(adding), np.flatnonzero((roles != 0) & ~adding), np.flatnonzero(roles == FEELS)


def added(p: Records, theta: Array, omega: Array, alpha: Array) -> Array:
    """What effects with parameters ``p`` add to the torque of contacts (n,) [N m], of motions (tracks, n); see ``apart``."""
    theta, omega, alpha = (np.ascontiguousarray(values) for values in (theta, omega, alpha))  # one compiled form
    torque = np.zeros(theta.shape[1])
    _added(p, theta, omega, alpha, torque)
    return torque


def torque_in_phases(
    phases: Sequence[tuple[float, Records]], rubber: Array, time: Array, theta: Array, omega: Array, alpha: Array
) -> Array:
    """Like ``torque_side``, with other parameters from given times [s] on, in ascending order; the state is carried over.

    Motions of several tracks (tracks, n) give the sum of their torques. The memory of an effect begins when the effect does; the
    air takes its new temperature at once. An angle that is read otherwise from then on turns no contact.
    """
    effects = [acting(p) for _, p in phases]
    if not any(effects):
        phases = [(start, _bare(p)) for start, p in phases]
    before = phases[0][1]
    if theta.ndim == 1:
        theta, omega, alpha = np.atleast_2d(theta, omega, alpha)
    time, theta, omega, alpha = map(np.ascontiguousarray, (time, theta, omega, alpha))  # one compiled form
    torques, states, scratch = np.empty(theta.shape), new_state(before, len(theta)), _empty(OUTPUT, len(theta))
    alone = len(phases) == 1 and phases[0][0] == -np.inf
    edges = [0, time.size] if alone else [*np.searchsorted(time, [start for start, _ in phases]), time.size]
    for (_, p), acts, first, last in zip(phases, effects, edges, edges[1:], strict=False):
        if first == last:
            continue
        if first > 0:
            states["air_temperature"] += p["air_temperature"] - before["air_temperature"]
            if acts:
                motion = (np.ascontiguousarray(values[..., first - 1 : first]) for values in (time, theta, omega, alpha))
                _read_otherwise(p, states, rubber, scratch, *motion)
        before = p
        _torques(p, states, rubber, scratch, time, theta, omega, alpha, torques, first, last, acts)
    return np.asarray(np.add.reduce(torques))
