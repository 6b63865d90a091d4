# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""From effects to records and one readable, compiled step.

The signature of a law is its wiring: each argument names a memory or a parameter of the effect, a quantity of the step or
a baseline parameter, looked for in that order. A law returns its part, then every memory that it named (lists, which it
changes in place, are not returned). What the parts make together is fixed by the hook.
"""

from __future__ import annotations

import hashlib
import inspect
import linecache
import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from lugre_steering.chain import baseline, bristle, heat
from lugre_steering.chain.compiled import law
from lugre_steering.chain.layout import BASELINE_FIELDS, STATE_FIELDS
from lugre_steering.chain.template import BESIDE, SENSED, STEP, WIND_UP
from lugre_steering.errors import EffectError

LawFunction = Callable[..., Any]


class Parametric(Protocol):
    """A parameter as the composer sees it."""

    @property
    def name(self) -> str: ...


class Physics(Protocol):
    """An effect as the composer sees it; see ``effects.entry.Effect``."""

    @property
    def id(self) -> str: ...
    @property
    def parameters(self) -> Sequence[Parametric]: ...
    @property
    def memory(self) -> Mapping[str, float | str | tuple[float, ...]]: ...
    @property
    def hooks(self) -> Mapping[str, LawFunction]: ...
    @property
    def tables(self) -> Mapping[str, int]: ...
    @property
    def amplitudes(self) -> Sequence[str]: ...
    @property
    def per_line(self) -> bool: ...
    @property
    def sha256(self) -> str: ...


@dataclass(frozen=True)
class Hook:
    """A place in the chain: what is done there with the ``part`` of a law, and what the laws there may read.

    ``given`` maps quantities to expressions of the step; those of earlier hooks of the step are known as well.
    """

    put: str
    does: str
    given: Mapping[str, str]


_ALWAYS = {
    "theta": "theta", "omega": "omega", "alpha": "alpha", "dt": "dt", "time": "s.time", "temperature": "s.temperature",
    "z": "s.z", "z_max": "s.z_max", "direction": "s.direction", "last_torque": "s.torque", "last_load": "s.load",
}  # fmt: skip

HOOKS = {
    "angle": Hook("theta = {part}", "true angle [rad] for the measured one, ``theta``", {"theta": "theta"}),
    "friction_temperature": Hook("hotter += {part}", "what friction feels above the rubber temperature [K]", _ALWAYS),
    "wind_up": Hook("angle, slope = angle + {part}[0], slope + {part}[1]",
                    "angle lost between sensor and track [rad] under ``torque``, and its slope [rad/(N m)]", {"torque": "torque"}),
    "tangent": Hook("faster += {part}", "relative change of the presliding stiffness",
                    {"d_theta": "d_theta", "turned": "turned", "sign": "sign", "resting": "resting", "dwell": "s.dwell",
                     "stiffness": "stiffness", "length": "length", "friction_ratio": "friction_ratio"}),
    "level": Hook("factor *= {part}", "factor on the friction level", {}),
    "ageing": Hook("aged += {part}", "what is added to the friction level, as a share of Coulomb friction", {}),
    "contact": Hook("elastic, z_next, work = {part}", "in place of the bristle: elastic torque [N m], its deflection [rad] and what "
                    "sliding dissipates [J] while it is drawn by ``drawn`` [rad]", {"g": "g", "drawn": "drawn"}),
    "viscous": Hook("viscous += {part}", "torque of the contact that heats the rubber [N m]", {"elastic": "elastic", "damping": "damping"}),
    "elastic": Hook("elastic *= {part}", "factor on the elastic torque", {"viscous": "viscous"}),
    "heat_in": Hook("energy *= {part}", "factor on the friction heat that enters the rubber", {"energy": "energy"}),
    "air": Hook("air += {part}", "what is added to the air temperature [K]", {}),
    "heat_out": Hook("s.temperature = {part}", "rubber temperature [degC] after this law", {"air": "air"}),
    "torque": Hook("parallel += {part}", "torque beside the contact [N m]", {"z": "z_next"}),
    "loss": Hook("lost += {part}", "torque lost in cylinders and lines [N m]", {"load": "load"}),
    "limit": Hook("torque = {part}", "torque that the hydraulics can hold [N m]", {"torque": "torque"}),
    "arm": Hook("factor *= {part}", "true moment arm over that of the drawing", {"theta": "theta"}),
    "line": Hook("error += {part}", "what the sensor of one line reads too much [Pa], ``elapsed`` [s] after the start",
                 {"elapsed": "elapsed"}),
    "delay": Hook("", "by how much pressures are stamped late [s]", {}),
    "lag": Hook("", "time constant of the pressure sensors [s]", {}),
}  # fmt: skip
"""Every place where an effect may act, in the order of the step; the last five belong to the sensors."""

QUANTITIES = {
    "theta": "steering angle, the true one where laws of `angle` have acted [rad]", "omega": "its rate [rad/s]",
    "alpha": "its acceleration [rad/s2]", "dt": "time since the last sample [s]", "time": "time since the start of the recording [s]",
    "temperature": "tread rubber [degC]", "z": "bristle deflection; from the hook `torque` on that of this sample [rad]",
    "z_max": "largest magnitude of it so far [rad]", "direction": "sign of the last motion of the contact",
    "last_torque": "total torque of the last sample [N m]", "last_load": "the same without losses in cylinders and lines [N m]",
    "torque": "of `wind_up`: what winds up; of `limit`: the total so far [N m]", "d_theta": "angle by which the contact turns now [rad]",
    "turned": "angle turned since the last sample [rad]", "sign": "that of `d_theta`, 0 where it is zero",
    "resting": "whether the machine stands still", "dwell": "how long it has [s]", "stiffness": "presliding stiffness now [N m/rad]",
    "length": "presliding length, sliding friction over stiffness [rad]",
    "friction_ratio": "friction of the rubber at its temperature over that at the reference temperature",
    "g": "friction torque that the contact would slide at [N m]", "drawn": "angle by which the bristle is drawn now [rad]",
    "elastic": "torque of the bristle [N m]", "damping": "presliding damping torque [N m]",
    "viscous": "torque that laws of `viscous` add [N m]", "energy": "friction heat of this sample [J]", "air": "air temperature now [degC]",
    "load": "total torque without losses in cylinders and lines [N m]", "elapsed": "time since the start of the recording [s]",
}  # fmt: skip
"""What laws may read of the step, see ``Hook.given``."""

_BITS = {name: 1 << i for i, name in enumerate(HOOKS)}
_STEPWISE = tuple(name for name in HOOKS if name not in ("angle", "wind_up", "arm", "line", "delay", "lag"))
SENSOR_HOOKS = ("angle", "arm", "line", "delay", "lag")
ADDS, ADDS_WARMTH, FEELS = 1, 2, 3
_ADDED, _OTHERS_ADD = ("torque", "viscous"), ("viscous", "load", "last_load", "last_torque")
"""Hooks that add to the torque, and quantities of the step in which others find it."""


@dataclass(frozen=True)
class Composition:
    """Records and compiled functions of a set of effects; ``text`` is the step module, ``name`` tells it from all others."""

    name: str
    text: str
    parameters: np.dtype[np.void]
    state: np.dtype[np.void]
    lines: np.dtype[np.void]
    bits: NDArray[np.int64]
    """The hooks of the step where the effect acts whose amplitude a number of the parameter record is (0: none), one bit each."""
    adds: NDArray[np.int64]
    """Whether a number of the parameter record belongs to an effect that only adds to the torque of the contact (ADDS, or ADDS_WARMTH where
    it heats the rubber as well), is the amplitude of one that FEELS what others add, or neither (0)."""
    starts: Mapping[str, float | str]
    """Memory that does not begin at zero: its field of the state, and a number or the baseline parameter that it begins with."""
    step: LawFunction
    arm_factor: LawFunction
    line_error: LawFunction
    beside: LawFunction


_made: dict[str, Composition] = {}
_asked: dict[tuple[tuple[str, int], ...], Composition] = {}


def composition_of(name: str) -> Composition:
    """The composition of that name, made earlier in this process."""
    return _made[name]


def name_of(fields: Sequence[str]) -> str:
    """The name of the composition whose records have these fields: it stands last."""
    return fields[-1]


def compose(effects: Sequence[Physics]) -> Composition:
    """The step of the baseline with the given effects in place, in their order."""
    asked = tuple((effect.id, id(effect)) for effect in effects)
    if asked not in _asked:
        _asked[asked] = _compose(effects)
        _kept.extend(effects)
    return _asked[asked]


_kept: list[Physics] = []
"""What ``_asked`` knows by its identity, which stays its own as long as it lives."""


def _compose(effects: Sequence[Physics]) -> Composition:
    laws = {f"{effect.id}__{hook}": function for effect in effects for hook, function in effect.hooks.items()}
    text = _text(effects)
    # A law may use what its own text does not show, as constants and helpers of its file.
    sources = [text, *(_source(function) for function in laws.values()), *(effect.sha256 for effect in effects)]
    name = f"composed_{hashlib.sha256(chr(0).join(sources).encode()).hexdigest()[:12]}"
    if name in _made:
        return _made[name]
    scope: dict[str, Any] = {
        "math": math, "ratios": baseline.ratios, "aligning": baseline.aligning, "REST_RATE_RAD_S": baseline.REST_RATE_RAD_S,
        "stribeck": bristle.stribeck, "bristle": bristle.bristle, "bristle_work": bristle.bristle_work, "heat": heat.heat,
        "LEAST_LEVEL": 0.05, "WIND_UP_ITERATIONS": 12, "law": law, **laws,
    }  # fmt: skip
    file = f"<{name}>"
    parameters = np.dtype([
        *((field, np.float64) for field in (*BASELINE_FIELDS, *_parameter_fields(effects, per_line=False))),
        *((f"{effect.id}_{table}", np.float64, (size,)) for effect in effects for table, size in effect.tables.items()),
        (name, np.float64),
    ])
    linecache.cache[file] = (len(text), None, text.splitlines(keepends=True), file)  # so that tracebacks and tools can show it
    exec(compile(text, file, "exec"), scope)
    _made[name] = Composition(
        name,
        text,
        parameters,
        np.dtype([*((field, np.float64) for field in STATE_FIELDS), *_memory_fields(effects)]),
        np.dtype([(field, np.float64) for field in (*_parameter_fields(effects, per_line=True), name)]),
        _bits(effects, parameters),
        _adds(effects, parameters),
        _starts(effects),
        scope["step"],
        scope["arm_factor"],
        scope["line_error"],
        scope["beside"],
    )
    return _made[name]


def check(effect: Physics, others: Sequence[Physics] = ()) -> None:
    """Refuse an effect whose wiring leads nowhere: unknown hooks and names, parameters and memory that no law reads, and fields of its
    records (``<id>_<name>``) that are those of the baseline or of ``others``."""
    read = set()
    for hook, function in effect.hooks.items():
        if hook not in HOOKS:
            raise EffectError(f"effect '{effect.id}': hooks: got '{hook}', expected one of {', '.join(HOOKS)}")
        for name in _arguments(function):
            _wire(effect, hook, name)
            read.add(name)
    own = _names(effect)
    if doubled := sorted({name for name in own if own.count(name) > 1}):
        raise EffectError(f"effect '{effect.id}': {', '.join(doubled)}: expected each name once among parameters, memory and tables")
    if effect.hooks and (idle := [name for name in own if name not in read]):
        raise EffectError(f"effect '{effect.id}': {', '.join(idle)}: no law reads it; expected an argument of that name")
    taken = {*BASELINE_FIELDS, *STATE_FIELDS, *(f"{other.id}_{name}" for other in others for name in _names(other))}
    if double := [name for name in own if f"{effect.id}_{name}" in taken]:
        raise EffectError(
            f"effect '{effect.id}': {', '.join(double)}: got a name that makes '{effect.id}_{double[0]}', which there is already; "
            "expected another id or name"
        )


def _names(effect: Physics) -> list[str]:
    """Its parameters, memory and tables."""
    return [p.name for p in effect.parameters] + list(effect.memory) + list(effect.tables)


def _arguments(function: LawFunction) -> tuple[str, ...]:
    return tuple(inspect.signature(getattr(function, "py_func", function)).parameters)


def _source(function: LawFunction) -> str:
    plain = getattr(function, "py_func", function)
    if written := getattr(plain, "__source__", None):
        return str(written)
    try:
        return inspect.getsource(plain)
    except OSError:
        return repr(plain.__code__.co_code) + repr(plain.__code__.co_consts)


def quantities_of(hook: str) -> dict[str, str]:
    """What laws of a hook may read beside their own, with its expression in the step: quantities and, but for sensors, parameters of
    the baseline."""
    known: dict[str, str] = {}
    for name in _STEPWISE[: _STEPWISE.index(hook) + 1] if hook in _STEPWISE else (hook,):
        known |= HOOKS[name].given
    return known if hook in SENSOR_HOOKS else known | {name: f"p.{name}" for name in BASELINE_FIELDS}


def _wire(effect: Physics, hook: str, name: str) -> str:
    """The expression of the step that an argument of a law stands for."""
    known = quantities_of(hook)
    # Laws of sensors are asked for whole recordings at once, apart from the step: they have its parameters and nothing that lasts.
    own = [p.name for p in effect.parameters] if hook in SENSOR_HOOKS else _names(effect)
    if name in own and name in effect.memory:
        return f"s.{effect.id}_{name}"
    if name in own:
        return f"{'q' if effect.per_line else 'p'}.{effect.id}_{name}"
    if name in known:
        return known[name]
    kinds = "parameters" if hook in SENSOR_HOOKS else "parameters, memory and tables"
    raise EffectError(
        f"effect '{effect.id}': law '{hook}': got the argument '{name}', expected one of its own {kinds} ({', '.join(own) or 'none'}) "
        f"or what is known there ({', '.join(known) or 'nothing'})"
    )


def _guard(effect: Physics) -> str:
    """Whether an effect acts: any of its amplitudes differs from zero."""
    record = "q" if effect.per_line else "p"
    return " or ".join(f"{record}.{effect.id}_{name} != 0.0" for name in effect.amplitudes)


def _call(effect: Physics, hook: str) -> list[str]:
    """Lines that call the law of an effect and put its part, and its memory, where they belong."""
    arguments = _arguments(effect.hooks[hook])
    call = f"{effect.id}__{hook}({', '.join(_wire(effect, hook, name) for name in arguments)})"
    kept = [f"s.{effect.id}_{name}" for name in arguments if name in effect.memory and not isinstance(effect.memory[name], tuple)]
    put = HOOKS[hook].put
    if not kept and put.count("{part}") == 1:
        return [put.format(part=call)]
    return [f"{', '.join(['part', *kept])} = {call}", put.format(part="part")]


def _acting(effects: Sequence[Physics], hook: str) -> list[Physics]:
    return [effect for effect in effects if hook in effect.hooks]


def _slot(effects: Sequence[Physics], hook: str) -> Iterator[str]:
    """Lines for the slot of a hook in the step."""
    acting = _acting(effects, hook)
    if acting and hook != "angle" and hook not in _STEPWISE:
        yield from _guarded(acting, hook)
    elif acting:
        yield f"if effects & {_BITS[hook]}:"
        yield from (f"    {line}" for line in _guarded(acting, hook))


def _guarded(acting: Sequence[Physics], hook: str) -> Iterator[str]:
    """Lines that put what each effect does at a hook where it acts."""
    for effect in acting:
        yield f"if {_guard(effect)}:"
        yield from (f"    {line}" for line in _call(effect, hook))


def _instead(effects: Sequence[Physics], hook: str) -> list[str]:
    """Branches in place of a block of the step, each with its condition."""
    if hook == "wind_up":
        if not _acting(effects, hook):
            return []
        solved = ["d_theta = wound_increment(p, s, theta, stiffness, length)", "s.contact_angle += d_theta"]
        return [f"if effects & {_BITS[hook]}:", *(f"    {line}" for line in solved)]
    lines = []
    for i, effect in enumerate(_acting(effects, hook)):
        lines.append(f"{'elif' if i else 'if'} effects & {_BITS[hook]} and ({_guard(effect)}):")
        work = "work = (work + 0.5 * stiffness * (z_next * z_next - z * z)) / faster"
        lines += [f"    {line}" for line in (*_call(effect, hook), work)]
    return lines


def _text(effects: Sequence[Physics]) -> str:
    """The step module."""
    memory = [f"s.{name} = " + (f"p.{start}" if isinstance(start, str) else repr(start)) for name, start in _starts(effects).items()]
    winding = _filled(WIND_UP, {"wind_up": list(_slot(effects, "wind_up"))}) if _acting(effects, "wind_up") else ""
    slots = {hook: list(_slot(effects, hook)) for hook in HOOKS if hook not in ("wind_up", "contact", "delay", "lag")}
    slots |= {hook: _instead(effects, hook) for hook in ("wind_up", "contact")}
    slots |= {"memory": memory, "wind_up_laws": [*winding.splitlines(), "", ""] if winding else []}
    slots |= {"beside": [line for hook in _ADDED for line in _guarded([e for e in _acting(effects, hook) if _only_adds(e)], hook)]}
    text = "\n\n".join(_filled(part, slots) for part in (STEP, SENSED, BESIDE))
    header = '"""One step of one track, composed of: ' + (", ".join(effect.id for effect in effects) or "the baseline alone") + '."""\n\n'
    return header + re.sub(r"^def (?!step\(|arm_factor\(|line_error\(|beside\()", "@law\ndef ", text, flags=re.MULTILINE)


def _bits(effects: Sequence[Physics], parameters: np.dtype[np.void]) -> NDArray[np.int64]:
    """See ``Composition.bits``: (numbers of the parameter record,)."""
    assert parameters.fields is not None
    bits = np.zeros(parameters.itemsize // 8, np.int64)
    for effect in effects:
        for name in () if effect.per_line else effect.amplitudes:
            bits[parameters.fields[f"{effect.id}_{name}"][1] // 8] |= sum(_BITS[hook] for hook in effect.hooks)
    return bits


def _adds(effects: Sequence[Physics], parameters: np.dtype[np.void]) -> NDArray[np.int64]:
    """See ``Composition.adds``: (numbers of the parameter record,)."""
    assert parameters.fields is not None
    adds = np.zeros(parameters.itemsize // 8, np.int64)
    for effect in effects:
        if _only_adds(effect):
            names, role = [*(p.name for p in effect.parameters), *effect.tables], ADDS_WARMTH if "viscous" in effect.hooks else ADDS
        else:
            names, role = [*effect.amplitudes] if not effect.per_line and _feels(effect) else [], FEELS
        for name in names:
            kind, offset = parameters.fields[f"{effect.id}_{name}"][:2]
            adds[offset // 8 : (offset + kind.itemsize) // 8] = role
    return adds


def _only_adds(effect: Physics) -> bool:
    """Whether an effect but adds to the torque what follows from angle, rate and acceleration."""
    own = {*(p.name for p in effect.parameters), *effect.tables, "theta", "omega", "alpha", *BASELINE_FIELDS}
    laws = effect.hooks
    return bool(laws) and laws.keys() <= {*_ADDED} and not effect.memory and all(own.issuperset(_arguments(law)) for law in laws.values())


def _feels(effect: Physics) -> bool:
    """Whether an effect does otherwise where another adds to the torque, or changes what that reads."""
    own = {p.name for p in effect.parameters}
    reads = {name for function in effect.hooks.values() for name in _arguments(function)} - own
    return not effect.hooks.keys().isdisjoint(("angle", "wind_up", "loss", "limit")) or not reads.isdisjoint(_OTHERS_ADD)


def _starts(effects: Sequence[Physics]) -> dict[str, float | str]:
    return {
        f"{effect.id}_{name}": start
        for effect in effects
        for name, start in effect.memory.items()
        if not isinstance(start, tuple) and start != 0.0
    }


def _filled(template: str, slots: Mapping[str, Sequence[str]]) -> str:
    """The template with lines in the places of its slots; a block behind an empty ``<name> else:`` stands alone."""
    out: list[str] = []
    dedent = 0
    for line in template.splitlines():
        indent = len(line) - len(line.lstrip())
        if line.strip() and indent < dedent:
            dedent = 0
        slot = re.fullmatch(r"\s*<(\w+)>( else:)?", line)
        if slot is None:
            out.append(line[4:] if dedent else line)
            continue
        lines = slots.get(slot.group(1), [])
        out += [" " * indent + item if item else "" for item in lines]
        if slot.group(2):
            if lines:
                out.append(" " * indent + "else:")
            else:
                dedent = indent + 4
    return "\n".join(out).rstrip() + "\n"


def _parameter_fields(effects: Sequence[Physics], per_line: bool) -> list[str]:
    return [f"{effect.id}_{p.name}" for effect in effects if effect.per_line == per_line for p in effect.parameters]


def _memory_fields(effects: Sequence[Physics]) -> list[tuple[Any, ...]]:
    return [
        (f"{effect.id}_{name}", np.float64, (len(start),)) if isinstance(start, tuple) else (f"{effect.id}_{name}", np.float64)
        for effect in effects
        for name, start in effect.memory.items()
    ]
