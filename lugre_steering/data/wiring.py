# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Wrong wiring, found by comparing the recording with the nominal model: signs, units, exchanged channels.

Each suspicion is a hypothesis: the recording as it would be with one fault undone, or two where one does not suffice. It is
reported when the nominal model then agrees very much better and well, which no physics of the catalogue brings about;
hypotheses that agree equally well are named together, and none may leave the angles of a mirrored vehicle.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from scipy.optimize import lsq_linear

from lugre_steering.data.dataset import Run, prepare
from lugre_steering.data.nominal import GAIN, GOOD, nominal_torques, topics_of
from lugre_steering.data.offsets import SKEW_RANGE_S, clock_skew, zero_drifts
from lugre_steering.errors import DataError
from lugre_steering.recording import Array, Finding, Kind, Mask, Recording, Signal
from lugre_steering.units import words
from lugre_steering.vehicle import Vehicle
from lugre_steering.vehicle.cylinders import gauge_offset, line_gains
from lugre_steering.vehicle.model import Model, build_model

BLOCKING = frozenset({
    "sign_flipped", "unit_suspect", "swapped_lines", "swapped_angles", "clock_skew", "wiring_suspect", "dead_sensor",
    "copied_sensor", "noisy_sensor", "angle_zero",
})  # fmt: skip

RELAXED, FORGOTTEN = 0.2, 3.0
"""Share of the largest nominal torque up to which a recording begins with the relaxed bristles of the model, not in mid-sweep, and
presliding lengths after which little is left of others."""
UNTOLD = 0.3
"""Variation of the nominal torque over its level below which it has no shape to compare: part of one sweep."""
MISTYPED = 13.0
"""By which factor loads and friction of a wrong vehicle file may be off; units are further."""
BETTER = 0.5
"""A hypothesis must halve the relative error of the nominal model, and leave one that is ``GOOD``."""
ORDINARY = 0.1
"""Relative error of the nominal model that friction of another form makes as well, and that accuses nobody but a unit."""
WEAK_BETTER = 0.8
"""The same for the unit of a line that hardly works, whose magnitude speaks too."""
TIE, SHOWN = 1.15, 3
"""Error over the least at which hypotheses are as good, and how many others of them are told."""
OPPOSED = -0.5
"""Correlation of measured and nominal torque, with negative work, that is a flipped sign however poor the model."""
ABSURD_SHARE = 0.05
"""So many angles beyond half a turn are not glitches but another unit."""
GEOMETRY_RAD, GEOMETRY_RATIO = float(np.radians(0.5)), 3.0
"""Root mean square by which the worse steering geometry must miss, and by which factor more than the other."""
TURNED_RAD = np.pi / 2.0
"""No steered track turns this far."""
UNLIKE = 0.4
"""Correlation of measured and nominal torque below which something is wrong, whatever it is; with hidden physics it is 0.9."""
PARTS, CALM = 16, 0.75
"""Parts of a recording in each of which a joint or axis may bear another load, and the share of them in which that stays."""
POOR = 0.25
"""Relative error left by a hypothesis that cannot be all; a friction level off by GAIN leaves less."""
MIRROR = (
    "More than one wiring fault is possible: of exchanged angle sensors, all angle signs flipped and the lines of every circuit "
    "exchanged, any one looks like the other two together."
)
TINY = 1e-2
"""A line whose highest pressure is this share of the others', or a torque this share of the nominal one, has another unit."""
PRESSURE_UNITS = {"kPa": 1e3, "psi": 6894.757, "bar": 1e5, "MPa": 1e6}


@dataclass(frozen=True)
class _Fault:
    finding: str
    topics: tuple[str, ...]
    statement: str


@dataclass(frozen=True)
class _Hypothesis:
    """Faults undone: the relative error that the nominal model then leaves, and by which factor it must fall."""

    faults: tuple[_Fault, ...]
    error: float
    better: float = BETTER

    @property
    def statement(self) -> str:
        return " and ".join(fault.statement for fault in self.faults)

    @property
    def of_units(self) -> bool:
        return any(fault.finding == "unit_suspect" for fault in self.faults)

    @property
    def topics(self) -> int:
        return sum(len(fault.topics) for fault in self.faults)


Faults = tuple[_Fault, ...]


def inspect_wiring(pieces: Sequence[Recording], vehicle: Vehicle) -> tuple[Finding, ...]:
    """Findings about signs, units, exchanged channels, clocks and zeros; ``pieces`` of one recording, without bad samples."""
    wrong: list[Finding] = []
    skewed: list[Finding] = []
    runs: list[Run] = []
    for piece in pieces:
        whole = span(piece)
        found = _angle_unit(piece, vehicle)
        run = None if found else _telling(piece, vehicle)
        if run is not None and not (found := _wrong(piece, vehicle, run)):
            runs.append(run)
            skewed += (replace(finding, intervals_s=whole) for finding in clock_skew(vehicle, run))
        wrong += (Finding(fault.finding, ", ".join(fault.topics), fault.statement, whole) for fault in found)
    if wrong:
        return tuple(wrong)
    every = tuple(interval for piece in pieces for interval in span(piece))
    return (*skewed, *(replace(finding, intervals_s=every) for finding in zero_drifts(vehicle, runs)))


def _telling(piece: Recording, vehicle: Vehicle) -> Run | None:
    """What the nominal model can be compared with; None where nothing moves, or the nominal torque has no shape."""
    try:
        run = prepare(piece, vehicle)
    except DataError:
        return None
    if float(np.ptp(run.theta, axis=1).max()) < 40.0 * vehicle.sensors.angle_sigma or run.valid.sum() < 20:
        return None
    model = build_model(vehicle)
    nominal = nominal_torques(model, run).sum(axis=0)
    if abs(run.measured[0]) > RELAXED * float(np.abs(nominal).max()):
        run = replace(run, valid=run.valid & _forgotten(run, model))
    total = nominal[run.valid]
    return None if total.size < 20 or float(np.std(total)) < UNTOLD * float(np.sqrt(np.mean(total**2))) else run


def _forgotten(run: Run, model: Model) -> Mask:
    """Where (n,) little is left of the bristles with which the recording began."""
    record = model.parameters[0][0]
    turned = np.abs(run.omega).max(axis=0).cumsum() * float(run.time[1] - run.time[0])
    return np.asarray(turned > FORGOTTEN * float(record["coulomb_torque"] / record["sigma_0"]))


def span(recording: Recording) -> tuple[tuple[float, float], ...]:
    """Start and end [s] of all that was measured, as the intervals of a finding."""
    signals = [*recording.angle.values(), *recording.pressure.values()]
    signals += [recording.measured_torque] if recording.measured_torque is not None else []
    ends = [(float(s.time_s[0]), float(s.time_s[-1])) for s in signals if s.time_s.size]
    return ((min(start for start, _ in ends), max(end for _, end in ends)),) if ends else ()


def _foreign_unit(vehicle: Vehicle) -> tuple[str, float]:
    """The unit that an angle (or a linear coordinate) would most likely be given in by mistake, and its factor to SI."""
    return ("degrees", float(np.pi / 180.0)) if vehicle.coordinate.unit == "rad" else ("mm", 1e-3)


def _angle_unit(recording: Recording, vehicle: Vehicle) -> Faults:
    """Angles by their magnitude alone."""
    unit, factor = _foreign_unit(vehicle)
    wrong = []
    for side, topic in topics_of(vehicle, Kind.ANGLE).items():
        signal = recording.angle.get(side)
        count = 0 if signal is None else signal.time_s.size
        absurd = recording.rejected.get(topic, {}).get("absurd", 0)
        turned = 0.0 if signal is None or not count else float(np.abs(signal.value).max())
        if absurd > ABSURD_SHARE * (count + absurd) or (vehicle.track is not None and turned > TURNED_RAD):
            wrong.append(topic)
    wrong = list(dict.fromkeys(wrong))
    if not wrong:
        return ()
    far = words(vehicle, "far beyond any steering angle" if vehicle.contact is None else "beyond what the vehicle file allows")
    statement = f"{' and '.join(wrong)}: {far}; probably in {unit} (multiply by {factor:.6g})"
    if vehicle.contact is not None:
        statement += f", unless it goes beyond {vehicle.farthest:.4g} {vehicle.coordinate.unit}: then say so (coordinate.farthest)"
    return (_Fault("unit_suspect", tuple(wrong), statement),)


def _error(run: Run, measured: Array, expected: Array, most: float = GAIN) -> float:
    """Relative error of the expected torque, both about their means, with a gain of at most ``most``, or its reciprocal at least."""
    a, b = measured[run.valid] - measured[run.valid].mean(), expected[run.valid] - expected[run.valid].mean()
    # Plain sums: threads of a linear algebra library cost more than they save here.
    aa, ab, bb = float(np.sum(a * a)), float(np.sum(a * b)), float(np.sum(b * b))
    gain = float(np.clip(ab / max(bb, 1e-30), 1.0 / most, most))
    return float(np.sqrt(max(aa - 2.0 * gain * ab + gain**2 * bb, 0.0) / max(aa, gain**2 * bb, 1e-30)))


def _wrong(recording: Recording, vehicle: Vehicle, run: Run) -> Faults:
    """The faults of the simplest hypothesis among the best, if it is convincing."""
    model = build_model(vehicle)
    total = nominal_torques(model, run).sum(axis=0)
    as_is, mistyped = _error(run, run.measured, total), _error(run, run.measured, total, MISTYPED)
    correlation = float(np.corrcoef(run.measured[run.valid], total[run.valid])[0, 1])
    mirrored = _mirrored(vehicle, run)
    if mirrored and as_is <= GOOD:
        return _noted(vehicle, _exchanged_angles(vehicle), ".")
    undone = list(_hypotheses(vehicle, run, model, 1))
    single = [*undone, *(_angle_units(recording, vehicle, run, model) if as_is > GOOD else ())]
    convincing = [h for h in single if h.error < min(GOOD, h.better * as_is) and (as_is > ORDINARY or h.of_units)]
    if as_is > GOOD:
        needed = BETTER * min([as_is, mistyped, *(h.error for h in single)])
        convincing = [h for h in _hypotheses(vehicle, run, model, 2) if h.error < min(GOOD, needed)] or convincing
    if not convincing and mirrored and correlation > 0.0:
        return _noted(vehicle, _exchanged_angles(vehicle), ".")
    tiny = float(np.std(run.measured)) < TINY * float(np.std(total))
    if not convincing:
        work = float(np.sum((run.measured * run.omega.mean(axis=0))[run.valid]))
        opposed = correlation < OPPOSED and work < 0.0
        poor = "sign_flipped" if opposed else "unit_suspect" if tiny else ""
        convincing = [h for h in undone if h.faults[0].finding == poor and h.error < as_is]
        if abs(correlation) < UNLIKE:  # which channel it is, an error that stays poor does not tell
            convincing = [h for h in convincing if h.topics == max(other.topics for other in convincing)]
    if not convincing:
        if tiny:
            return _no_torque(vehicle)
        return _unlike(vehicle, correlation) if correlation < UNLIKE and not _lacks_terms(vehicle, run, total) else ()
    best = min(h.error for h in convincing)
    if mistyped < min(GOOD, best) or mistyped <= min(POOR, TIE * best + 0.01):
        return ()  # a level of the vehicle file may be wrong as well; all its entries are compared later
    tied = [h for h in convincing if h.error <= TIE * best + 0.01]
    first = min(tied, key=lambda h: h.topics)
    rivals = as_well([(h.error, h.statement) for h in tied if h is not first])
    agrees = f" (relative error of the nominal model {as_is:.2f} as recorded, {first.error:.2f} with that undone)"
    if first.error > POOR:
        rivals += f" That is still poor: more than one wiring fault is possible, or clocks more than {SKEW_RANGE_S:g} s apart."
    return _noted(vehicle, first.faults, f"{agrees}.{rivals}")


def _lacks_terms(vehicle: Vehicle, run: Run, expected: Array) -> bool:
    """Whether inertia, viscous friction, offset, gravity (of an axis, a spring) and loads that are picked up, which the sheet of a single
    joint or axis may lack and diagnosis finds, explain with its friction what that alone does not."""
    if vehicle.contact is None or vehicle.rubber is not None or len(vehicle.sides) > 1:
        return False
    theta, omega, alpha = run.theta[0], run.omega[0], run.alpha[0]
    angle = [np.cos(theta), np.sin(theta)] if vehicle.coordinate.unit == "rad" else [theta]
    columns = np.column_stack([expected, alpha, omega, np.ones_like(theta), *angle])[run.valid]
    measured = run.measured[run.valid]
    if (alike := _explain(columns, measured)) or measured.size < PARTS:
        return alike
    pairs = zip(np.array_split(columns, PARTS), np.array_split(measured, PARTS), strict=True)
    parts = [(column - column.mean(axis=0), torque - torque.mean()) for column, torque in pairs]
    size = np.linalg.lstsq(np.concatenate([each for each, _ in parts]), np.concatenate([each for _, each in parts]), rcond=1e-10)[0]
    calm = sorted(parts, key=lambda part: float(np.linalg.norm(part[1] - part[0] @ size)))[: int(CALM * PARTS)]
    return _explain(np.concatenate([each for each, _ in calm]), np.concatenate([each for _, each in calm]))


def _explain(columns: Array, measured: Array) -> bool:
    """Whether friction, inertia and viscous friction, the first three of the columns (n, k), explain with the others a torque (n,)."""
    columns = columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    free = measured - columns @ np.linalg.lstsq(columns, measured, rcond=1e-10)[0]
    # Friction wins no work and inertia weighs: where these explain far more with the other sign, a sign is flipped.
    least = np.where(np.arange(columns.shape[1]) < 3, 0.0, -np.inf)
    own = measured - columns @ lsq_linear(columns, measured, (least, np.inf)).x
    explained = 1.0 - float(np.var(own)) / max(float(np.var(measured)), 1e-300)
    return explained > GOOD and float(np.std(free)) > BETTER * float(np.std(own))


def as_well(others: Sequence[tuple[float, str]]) -> str:
    """What else explains the data as well, in sentences; ``others``: error and statement of each."""
    told = "".join(f" The same data would come from this: {statement}." for _, statement in sorted(others)[:SHOWN])
    if len(others) > SHOWN:
        told += f" {len(others) - SHOWN} more would show the same: where so many do, check arms and bores in the vehicle file first."
    return told


def _noted(vehicle: Vehicle, faults: Faults, note: str) -> Faults:
    """Faults with a note, and with what a vehicle that is alike on both sides cannot tell."""
    whole = {_exchanged_angles(vehicle)[0].topics, tuple(topics_of(vehicle, Kind.PRESSURE).values())}
    if len(faults) == 1 and faults[0].finding != "unit_suspect" and faults[0].topics in whole and _both_tracks(vehicle):
        note += " " + MIRROR
    together = {fault: [other.statement for other in faults if other is not fault] for fault in faults}
    return tuple(
        replace(
            fault, statement=fault.statement + "".join(f"; together with another fault: {o}" for o in others) + note
        )
        for fault, others in together.items()
    )


def _no_torque(vehicle: Vehicle) -> Faults:
    """Next to no torque, in whatever unit. Blocking: no physics of the catalogue takes it all away."""
    kind = Kind.PRESSURE if vehicle.hydraulics is not None else Kind.TORQUE
    topics = tuple(topics_of(vehicle, kind).values())
    statement = (
        f"{', '.join(topics)}: the measured torque is less than {100 * TINY:g} % of that of the nominal model, and no common unit explains "
        "it; check that the sensors are connected, that the hydraulics were on, and the units"
    )
    return (_Fault("unit_suspect", topics, words(vehicle, statement)),)


def _unlike(vehicle: Vehicle, correlation: float) -> Faults:
    """Nothing fits, and yet the recording is nothing like the model. Not blocking: it may be a model without what matters."""
    topics = tuple(dict.fromkeys(c.topic for c in vehicle.channels if c.kind is not Kind.AIR_TEMPERATURE))
    statement = (
        f"{', '.join(topics)}: the measured torque is nothing like that of the nominal model (correlation {correlation:.2f}), and no "
        "single wiring fault or pair of them explains it; more than one wiring fault is possible, clocks more than "
        f"{SKEW_RANGE_S:g} s apart, or a vehicle file that lacks what matters most; check signs, units, plugs and clocks before believing "
        "any physics named here"
    )
    return (_Fault("wiring_suspect", topics, words(vehicle, statement)),)


def _hypotheses(vehicle: Vehicle, run: Run, model: Model, count: int) -> Iterator[_Hypothesis]:
    """Every combination of ``count`` faults of angles and of pressures (or torque)."""
    for of_angles, moved in _angles_undone(vehicle, run):
        if len(of_angles) > count or _mirrored(vehicle, moved) or _breaks_geometry(vehicle, run, moved):
            continue
        # The chain is not quite odd (gravity), so undone motion runs through it again.
        expected = nominal_torques(model, moved).sum(axis=0)
        gains = run.gains if vehicle.hydraulics is None else line_gains(vehicle, moved.theta)
        for of_signals, pressure, better in _signals_undone(vehicle, run, count - len(of_angles)):
            if len(of_angles) + len(of_signals) == count:
                measured = np.einsum("slt,lt->t", gains, pressure)
                yield _Hypothesis((*of_angles, *of_signals), _error(run, measured, expected), better)


def _exchanged_angles(vehicle: Vehicle) -> Faults:
    topics = tuple(topics_of(vehicle, Kind.ANGLE).values())
    statement = f"{' and '.join(topics)} are exchanged: the outer track would turn further than the inner one"
    return (_Fault("swapped_angles", topics, statement),)


def _angles_undone(vehicle: Vehicle, run: Run) -> Iterator[tuple[Faults, Run]]:
    """Motion with nothing undone, with one or all signs flipped, and with the sides exchanged (and flipped) too."""
    topics = topics_of(vehicle, Kind.ANGLE)
    sensors = tuple(dict.fromkeys(topics.values()))
    flips = [(), *((topic,) for topic in sensors), *([sensors] if len(sensors) > 1 else [])]
    towards = "" if vehicle.track is None else " (positive turns the track to the left)"
    for exchanged in (False, True) if _both_tracks(vehicle) else (False,):
        for flipped in flips:
            # Signs belong to the channels as they are wired, before they are exchanged.
            sign = np.where([topics[side] in flipped for side in vehicle.sides], -1.0, 1.0)[:, None]
            rows = (sign * values for values in (run.theta, run.omega, run.alpha))
            theta, omega, alpha = (values[::-1] if exchanged else values for values in rows)
            faults = _exchanged_angles(vehicle) if exchanged else ()
            if flipped:
                statement = f"{' and '.join(flipped)}: the sign is flipped{towards}"
                faults = (_Fault("sign_flipped", flipped, statement), *faults)
            yield faults, replace(run, theta=theta, omega=omega, alpha=alpha)


def _signals_undone(vehicle: Vehicle, run: Run, count: int) -> Iterator[tuple[Faults, Array, float]]:
    """Pressures (lines, n), or the torque of a sensor, with up to ``count`` faults undone, and by which factor the error must
    fall: one or all units, and exchanged lines; sign and unit of a torque sensor."""
    for of_units, pressure, better in _units_undone(vehicle, run):
        if len(of_units) > count:
            continue
        yield of_units, pressure, better
        for faults, order, sign in _plugs(vehicle) if len(of_units) < count else ():
            yield (*of_units, *faults), sign * pressure[list(order)], BETTER


def _plugs(vehicle: Vehicle) -> Iterator[tuple[Faults, tuple[int, ...], float]]:
    """Orders and signs in which the signals may be connected."""
    if vehicle.hydraulics is None:
        (topic,) = topics_of(vehicle, Kind.TORQUE).values()
        yield (_Fault("sign_flipped", (topic,), f"{topic}: the sign is flipped"),), (0,), -1.0
        return
    topics = list(topics_of(vehicle, Kind.PRESSURE).values())
    for i, j in combinations(range(len(topics)), 2):
        order = list(range(len(topics)))
        order[i], order[j] = j, i
        statement = f"{topics[i]} and {topics[j]} are exchanged; check the plugs of the two sensors"
        yield (_Fault("swapped_lines", (topics[i], topics[j]), statement),), tuple(order), 1.0
    circuits = {frozenset((c.cap, c.rod)) for c in vehicle.hydraulics.cylinders.values()}
    lines = vehicle.hydraulics.lines
    partner = {line: next(iter(c - {line}), line) for c in circuits for line in c}
    if len(circuits) > 1 and all(partner.get(line, line) in lines for line in lines):
        statement = f"{', '.join(topics)}: the two lines of every circuit are exchanged"
        order = [lines.index(partner.get(line, line)) for line in lines]
        yield (_Fault("swapped_lines", tuple(topics), statement),), tuple(order), 1.0


def _units_undone(vehicle: Vehicle, run: Run) -> Iterator[tuple[Faults, Array, float]]:
    yield (), run.pressure, BETTER
    if vehicle.hydraulics is None:
        (topic,) = topics_of(vehicle, Kind.TORQUE).values()
        statement = f"{topic}: probably in k{vehicle.coordinate.force_unit} (multiply by 1000)"
        yield (_Fault("unit_suspect", (topic,), statement),), 1e3 * run.pressure, BETTER
        return
    topics = list(topics_of(vehicle, Kind.PRESSURE).values())
    shown = run.pressure + gauge_offset(vehicle)
    highest = np.abs(shown).max(axis=1)
    for unit, factor in PRESSURE_UNITS.items():
        statement = f"probably in {unit} (multiply by {factor:g})"
        every = _Fault("unit_suspect", tuple(topics), f"{', '.join(topics)}: {statement}")
        if _plausible(vehicle, factor * float(highest.max())):
            yield (every,), factor * shown - gauge_offset(vehicle), BETTER
        for i, (topic, high) in enumerate(zip(topics, highest, strict=True)):
            if _plausible(vehicle, factor * float(high)):
                pressure = run.pressure.copy()
                pressure[i] = factor * shown[i] - gauge_offset(vehicle)
                # A line that hardly works in this recording changes less, but its magnitude speaks too.
                better = WEAK_BETTER if high < TINY * np.median(highest) else BETTER
                yield (_Fault("unit_suspect", (topic,), f"{topic}: {statement}"),), pressure, better


def _plausible(vehicle: Vehicle, highest_Pa: float) -> bool:
    """Whether this may be the highest pressure of a recording: one that the sensor can show, and not next to nothing."""
    return 0.01 < highest_Pa / vehicle.sensors.pressure_range_Pa < 1.1


def _angle_units(recording: Recording, vehicle: Vehicle, as_is: Run, model: Model) -> Iterator[_Hypothesis]:
    """Angles in another unit, too small to see it by magnitude: smoothed again, since their noise scales with them.

    None that would break a steering geometry which the angles obey as they are.
    """
    unit, factor = _foreign_unit(vehicle)
    topics = topics_of(vehicle, Kind.ANGLE)
    sensors = tuple(dict.fromkeys(topics.values()))
    for named in (sensors, *((sensor,) for sensor in sensors if len(sensors) > 1)):
        scaled = {
            side: Signal(s.time_s, s.value * factor) if topics[side] in named else s
            for side, s in recording.angle.items()
        }
        run = prepare(replace(recording, angle=scaled), vehicle)
        if _breaks_geometry(vehicle, as_is, run):
            continue
        statement = f"{' and '.join(named)}: probably in {unit} (multiply by {factor:.6g})"
        error = _error(run, run.measured, nominal_torques(model, run).sum(axis=0))
        yield _Hypothesis((_Fault("unit_suspect", named, statement),), error)


def _both_tracks(vehicle: Vehicle) -> bool:
    """Whether both tracks have an angle sensor of their own."""
    return set(vehicle.sides) == {"left", "right"} and vehicle.sensors.angle_from is None


def _mirrored(vehicle: Vehicle, run: Run) -> bool | None:
    """Whether the angles obey the steering geometry of the mirrored vehicle rather than its own; None if it does not tell.

    The inner track turns further, cot(left) - cot(right) = -b / L; with the sides exchanged, or with both signs flipped, the
    outer one would. Primary source: Ackermann condition, e.g. Gillespie 1992, chapter 8.
    """
    if vehicle.axle is None or not _both_tracks(vehicle):
        return None
    own, other = _off_geometry(vehicle, run), _off_geometry(vehicle, run, -1.0)
    if max(own, other) < GEOMETRY_RAD or GEOMETRY_RATIO * min(own, other) > max(own, other):
        return None
    return other < own


def _breaks_geometry(vehicle: Vehicle, as_is: Run, undone: Run) -> bool:
    """Whether angles that obey the steering geometry as they are would no longer do so."""
    return _off_geometry(vehicle, as_is) < GEOMETRY_RAD < _off_geometry(vehicle, undone)


def _off_geometry(vehicle: Vehicle, run: Run, sense: float = 1.0) -> float:
    """Root mean square [rad] by which the angles miss the steering geometry (``sense`` -1: of the mirrored vehicle); zero
    where there is none to obey."""
    if vehicle.axle is None or not _both_tracks(vehicle):
        return 0.0
    left, right = (run.theta[vehicle.sides.index(side)][run.valid] for side in ("left", "right"))
    t, ratio = np.tan(left), sense * vehicle.axle.kingpin_distance_m / vehicle.axle.wheelbase_m
    return float(np.sqrt(np.mean((right - np.arctan2(t, 1.0 + ratio * t)) ** 2)))
