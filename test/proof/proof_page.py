# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The lines that the guide must show of the kept scoreboard."""

from __future__ import annotations

from lugre_steering.proof.campaign import DISGUISES, RATIOS
from lugre_steering.proof.table import Row, details, median, share, told


def page_lines(board: Row) -> list[str]:
    """What docs/proof.md shows, so that its numbers come from the kept scoreboard, simulator by simulator."""
    lines: list[str] = []
    for number, part in board["simulators"].items():
        lines += [f"| simulator {number} | reached | target |", "|---|---|---|"]
        for target in part["targets"]:
            limit = f"{'at most' if target['most'] else 'at least'} {target['target']:g}"
            lines.append(f"| {target['what']} | {told(target['score'])} | {limit}: {target['status']} |")
        lines += [f"| {what} | {told(score)} | |" for what, score in details(part).items()]
        lines += [*_page_peers(part["peers"]), *_page_effects(part["effects"])]
    return lines


def _page_peers(peers: Row) -> list[str]:
    rows = [
        f"| {name} | {median(peer['removed'])} | {share(peer['false_alarms'])} | {share(peer['named'])} | {median(peer['seconds'])} |"
        for name, peer in peers.items()
    ]
    head = ["", "| method | held-out error removed | false alarms on nulls | right name | seconds |", "|---|---|---|---|---|"]
    return head + rows if rows else []


def _page_effects(effects: Row) -> list[str]:
    """Effects that fell short anywhere but at the lowest ratio."""
    cells = [*(f"{ratio:g}" for ratio in RATIOS), *DISGUISES]
    short = {
        effect: entry for effect, entry in effects.items()
        if any(right < of for cell, (right, of) in entry["right"].items() if cell != cells[0])
    }  # fmt: skip
    lines = ["", f"| right of all | {' | '.join(cells)} | taken for |", "|---" * (len(cells) + 2) + "|"] if short else []
    for effect, entry in short.items():
        counts = [f"{right}/{of}" if of else "" for right, of in (entry["right"][cell] for cell in cells)]
        taken = ", ".join(f"{name} {count}" for name, count in entry["taken_for"].items())
        lines.append(f"| {effect} | {' | '.join(counts)} | {taken} |")
    return lines
