# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""From a law in a vehicle file to an entry of one's own catalogue."""

from __future__ import annotations

from pathlib import Path

from lugre_steering.effects.own import add_law
from lugre_steering.effects.registry import CATALOGUE
from lugre_steering.errors import EffectError
from lugre_steering.vehicle.file import load, to_mapping


def keep_law(vehicle_file: Path, number: int, identity: str, title: str, catalogue: Path) -> None:
    """Keep the law of that number (from 1) in a vehicle file under a name, in a YAML file of effects."""
    vehicle = load(vehicle_file)
    if not 1 <= number <= len(vehicle.laws):
        have = f"1 to {len(vehicle.laws)}" if vehicle.laws else "a vehicle file with the key 'laws', as diagnose writes it"
        raise EffectError(f"{vehicle_file}: laws: got the number {number}, expected {have}")
    if identity in CATALOGUE:
        raise EffectError(f"{vehicle_file}: effect '{identity}': there is one of this name in the catalogue; expected another id")
    bags = vehicle.provenance.get("bags")
    source = f"found in {', '.join(map(str, bags))}" if isinstance(bags, list) and bags else f"found in {vehicle_file.name}"
    law = to_mapping(vehicle)["laws"][number - 1]
    add_law(catalogue, identity, title or law.get("title", identity), source, law)
