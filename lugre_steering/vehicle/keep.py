# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""``lugre_steering.keep_law``: from a law in a vehicle file to an entry of one's own catalogue."""

from __future__ import annotations

from pathlib import Path

from lugre_steering.effects.own import add_law
from lugre_steering.effects.registry import CATALOGUE
from lugre_steering.errors import EffectError
from lugre_steering.vehicle.file import to_mapping, vehicle_of
from lugre_steering.vehicle.sections import Vehicle

OWN_FILE = Path("own_physics.yaml")
"""Where laws are kept, in the present folder, if nothing else is said."""


def keep_law(vehicle: Vehicle | str | Path, name: str, file: str | Path = OWN_FILE, *, law: int = 1, title: str = "") -> Path:
    """Keep a law that ``diagnose`` found as an effect of one's own, so that later diagnoses know it by name; the path of ``file``.

    ``vehicle``: in which it stands (``diagnosis.augmented.vehicle``), or the path of its file; ``name``: id of the effect; ``file``: YAML
    file of effects for ``add_effects``, made if there is none (what stands there stays); ``law``: which of the vehicle's laws, from 1;
    ``title``: of the effect, by default what the law says of itself. ``EffectError`` if the law or the name cannot be kept.
    """
    if not isinstance(file, (str, Path)):
        raise EffectError(f"file: got {file!r}, expected its path")
    holder = vehicle_of(vehicle)
    where = holder.name if isinstance(vehicle, Vehicle) else str(vehicle)
    if law not in range(1, len(holder.laws) + 1):
        have = f"1 to {len(holder.laws)}" if holder.laws else "a vehicle file with the key 'laws', as diagnose writes it"
        raise EffectError(f"{where}: laws: got the number {law!r}, expected {have}")
    if name in tuple(CATALOGUE):
        raise EffectError(f"{where}: effect '{name}': there is one of this name in the catalogue; expected another id")
    bags = holder.provenance.get("bags")
    source = f"found in {', '.join(map(str, bags))}" if isinstance(bags, list) and bags else f"found in {Path(where).name}"
    found = to_mapping(holder)["laws"][int(law) - 1]
    add_law(Path(file), name, title or found.get("title", name), source, found)
    return Path(file)
