# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The catalogue of physics that the baseline leaves out: every module of this folder that holds an ``EFFECT``, what installed
packages offer (entry points ``lugre_steering.effects``), and what users add from files."""

from __future__ import annotations

import dataclasses
import difflib
import hashlib
import importlib
import importlib.util
import os
import pkgutil
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from lugre_steering.chain.compose import SENSOR_HOOKS, Composition, check, compose
from lugre_steering.chain.layout import OUTPUT
from lugre_steering.chain.step import new_parameters, run_side
from lugre_steering.effects import own
from lugre_steering.effects.declared import check_declared
from lugre_steering.effects.entry import STAGES, Effect
from lugre_steering.effects.laws import slot
from lugre_steering.errors import EffectError
from lugre_steering.given_several import paths
from lugre_steering.provenance import Provenance, Source, provenance
from lugre_steering.recording import Array

GROUP = "lugre_steering.effects"
VARIABLE = "LUGRE_STEERING_EFFECTS"
"""Environment variable that names files of effects (separated like a PATH), for processes started by this one."""


@dataclass(frozen=True)
class Origin:
    """Where foreign physics comes from: what to give or install, and the SHA-256 of what it is; ``of_file``: of the whole file, which
    vehicle files have that were written before entries of YAML had theirs."""

    source: str
    sha256: str
    of_file: str = field(default="", compare=False)


def _shipped() -> Iterator[Effect]:
    package = importlib.import_module(__name__.rpartition(".")[0])
    for module in pkgutil.iter_modules(package.__path__):
        if f"{package.__name__}.{module.name}" == __name__:
            continue
        found = getattr(importlib.import_module(f"{package.__name__}.{module.name}"), "EFFECT", None)
        if found is not None:
            yield found


def _sort() -> None:
    """The order of the chain; what is foreign comes last of its stage and tier."""
    ordered = sorted(CATALOGUE.values(), key=lambda e: (STAGES.index(e.stage), e.tier, e.id in ORIGINS, e.id))
    CATALOGUE.clear()
    CATALOGUE.update({effect.id: effect for effect in ordered})


CATALOGUE: dict[str, Effect] = {effect.id: effect for effect in _shipped()}
"""All known effects by id, in the order of the chain."""
ORIGINS: dict[str, Origin] = {}
"""Where the effects come from that this package does not ship."""
_LEFT_OUT: set[str] = set()


def effect(effect_id: str) -> Effect:
    """The entry of that name, or an error that offers the nearest one."""
    if effect_id not in CATALOGUE:
        near = difflib.get_close_matches(effect_id, CATALOGUE, n=1)
        hint = f"did you mean '{near[0]}'?" if near else f"known: {', '.join(CATALOGUE)}"
        raise EffectError(f"effect '{effect_id}': not in the catalogue; {hint}")
    return CATALOGUE[effect_id]


def sought(effect: Effect) -> bool:
    """Whether diagnoses consider it as a name."""
    return effect.id not in _LEFT_OUT


@contextmanager
def leaving_out(ids: Sequence[str]) -> Iterator[None]:
    """Diagnoses of this process do not consider these names, as if nobody had listed them; what a vehicle file has still acts."""
    added = {effect(name).id for name in ids} - _LEFT_OUT
    _LEFT_OUT.update(added)
    try:
        yield
    finally:
        _LEFT_OUT.difference_update(added)


def rivals(effect: Effect) -> list[str]:
    """The entries that an effect is easily taken for, whichever of the two says so."""
    return [other.id for other in CATALOGUE.values() if other.id in effect.rivals or effect.id in other.rivals]


def composed(ids: Iterable[str] | None = None, laws: int = 0) -> Composition:
    """The step with the effects of these ids in place (default: all that is known), and so many laws of the vehicle file."""
    chosen = set(CATALOGUE if ids is None else ids)
    return compose([*(effect for effect in CATALOGUE.values() if effect.id in chosen), *map(slot, range(laws))])


def add_files(files: str | Path | Sequence[str | Path]) -> None:
    """Add users' physics (one file or several) to the catalogue, here and in processes that are started from here."""
    added = paths("effects", files)
    for file in added:
        effects, sha256 = own.read_effects(file)
        _add([(new, Origin(file.name, new.sha256, sha256)) for new in effects], str(file))
    if added:
        known = os.environ.get(VARIABLE, "").split(os.pathsep)
        os.environ[VARIABLE] = os.pathsep.join(dict.fromkeys([*filter(None, known), *(str(path.resolve()) for path in added)]))


def _add(effects: Sequence[tuple[Effect, Origin]], where: str) -> None:
    ids = [new.id for new, _ in effects]
    for new, origin in effects:
        if ids.count(new.id) > 1:
            raise EffectError(f"{where}: effect '{new.id}': there are {ids.count(new.id)} of this id; expected one")
        if ORIGINS.get(new.id) == origin:
            continue
        if new.id in CATALOGUE:
            known = ORIGINS[new.id].source if new.id in ORIGINS else "lugre_steering itself"
            raise EffectError(f"{where}: effect '{new.id}': there is one of this name in {known}; expected another id")
        foreign = dataclasses.replace(new, sha256=origin.sha256)
        try:
            check_declared(foreign, {*CATALOGUE, *ids})
            check(foreign, [*CATALOGUE.values()])
            _try(foreign)
        except EffectError as error:
            raise EffectError(f"{where}: {error}") from error
        CATALOGUE[new.id], ORIGINS[new.id] = foreign, origin
    _sort()


def made(command: str, options: Mapping[str, Any], vehicle: Path | Source | None, bags: Sequence[Path] = ()) -> Provenance:
    """How a result of these files came about, foreign physics included."""
    foreign = {effect_id: f"{origin.source} sha256 {origin.sha256}" for effect_id, origin in ORIGINS.items()}
    return provenance(command, {**options, **({"effects": foreign} if foreign else {})}, vehicle, bags)


def _try(new: Effect) -> None:
    """Compile an effect and run it over a short motion at its typical size: what fails is told now, not in mid-work."""
    time = np.asarray(np.arange(200) * 0.01, np.float64)
    phase = 3.0 * time
    theta, omega, alpha = (np.asarray(part, np.float64) for part in (0.3 * np.sin(phase), 0.9 * np.cos(phase), -2.7 * np.sin(phase)))
    typical = {parameter.name: parameter.typical for parameter in new.parameters}
    try:
        p = new_parameters(compose([new]))
        for field, value in (("static_torque", 1.1), ("coulomb_torque", 1.0), ("sigma_0", 50.0), ("stribeck_speed", 0.05),
                             ("stribeck_exponent", 2.0), ("heat_capacity", 1e4), ("sides", 1.0), ("table_step", 1.0)):  # fmt: skip
            p[field] = value
        for field, number in new.fields({} if new.per_line else typical).items():
            p[field] = number
        out = run_side(p, np.ones((2, 2)), time, theta, omega, alpha)
        given: list[Array | float] = [out[name] for name in OUTPUT.names or ()]
        with np.errstate(all="ignore"):
            for hook in sorted(new.hooks.keys() & SENSOR_HOOKS):  # over whole recordings, and compiled for one number at a time
                given.append(new.law(hook, typical, theta=theta, elapsed=time))
                given.append(float(new.hooks[hook](*(typical.get(name, 0.1) for name in new.reads(hook)))))
        finite = all(np.isfinite(part).all() for part in given)
    except Exception as error:  # Numba's errors are many and long
        owed = "; a law returns its part, then every memory that it names" if new.memory else ""
        raise EffectError(f"effect '{new.id}': its laws cannot be compiled: {_reason(error)}{owed}") from error
    if not finite:
        raise EffectError(f"effect '{new.id}': got torques or readings that are no numbers at its typical size, expected finite ones")


def _reason(error: Exception) -> str:
    """What Numba stumbled over: it stands behind the last of the lines that say where in its own works that was."""
    text = re.sub(r"\x1b\[[0-9;]*m", "", str(error))
    lines = [line.strip() for line in text.rpartition("Failed in nopython mode pipeline")[2].splitlines() if line.strip()]
    telling = [line for line in lines if not line.startswith("(step:")]
    return telling[0] if telling else type(error).__name__


def _content(module: str) -> str:
    """SHA-256 of all Python files of the package (or single file) that a loaded module belongs to."""
    spec = importlib.util.find_spec(module.partition(".")[0])
    assert spec is not None
    files = sorted(file for folder in spec.submodule_search_locations or () for file in Path(folder).rglob("*.py"))
    if not files and spec.origin is not None:
        files = [Path(spec.origin)]
    return hashlib.sha256(b"".join(hashlib.sha256(file.read_bytes()).digest() for file in files)).hexdigest()


def _add_installed() -> None:
    for entry in metadata.entry_points(group=GROUP):
        where = f"package '{entry.dist.name}'" if entry.dist is not None else f"entry point '{entry.name}'"
        try:
            found = entry.load()
        except (Exception, SystemExit) as error:  # whatever a foreign package raises
            raise EffectError(f"{where}: entry point '{entry.name}' cannot be loaded: {type(error).__name__}: {error}") from error
        origin = Origin(where, _content(entry.module))
        _add([(new, origin) for new in own.of_objects(found, f"{where}: entry point '{entry.name}'")], where)


for _effect in CATALOGUE.values():
    check_declared(_effect, CATALOGUE)
    check(_effect)
_sort()
_add_installed()
add_files([Path(name) for name in os.environ.get(VARIABLE, "").split(os.pathsep) if name])
