# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The scoreboard: every score with its count and interval, for each simulator on its own, and the targets."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from typing import TypeVar

from lugre_steering.proof.campaign import DISGUISES, RATIOS, WITHOUT
from lugre_steering.proof.result import (
    SCHEMA,
    AtMasked,
    AtRatio,
    BesideForm,
    Dirty,
    Failure,
    HowMade,
    Laws,
    Location,
    Measurable,
    Naming,
    Nulls,
    OfEffect,
    OfSimulator,
    Parameters,
    Peer,
    Power,
    Removed,
    Scoreboard,
    SeveralEffects,
    Share,
    Sheets,
    Unlisted,
    Without,
)
from lugre_steering.proof.scores import (
    CLEAR_RATIO,
    DETECTED,
    OUTCOMES,
    RIGHT,
    Row,
    all_answered,
    answered,
    called_unlisted,
    foretold,
    harmed,
    has_wrong_extra,
    heldout,
    location,
    measured_errors,
    measured_width,
    names_named,
    outcome,
    parameter_errors,
    proportion,
    ratio_of,
    removed,
    removed_without,
    sheet_told,
    summary,
    wrong_sheet,
)  # fmt: skip
from lugre_steering.proof.targets import TARGETS, judged

__all__ = ["OUTCOMES", "SCHEMA", "TARGETS", "board"]

T = TypeVar("T")
TOGETHER = ("pair", "triple")


def board(rows: Sequence[Row], made: HowMade) -> Scoreboard:
    """Simulators are never pooled: each has its own part and its own targets."""
    numbers = sorted({row.get("simulator", 2) for row in rows})
    return Scoreboard(
        schema=SCHEMA, made=made, cases=dict(Counter(row["kind"] for row in rows)),
        failed=tuple(Failure(row["name"], row["seed"], row["error"]) for row in rows if row["error"]),
        simulators={str(number): part([row for row in rows if row.get("simulator", 2) == number]) for number in numbers},
    )  # fmt: skip


def part(rows: Sequence[Row]) -> OfSimulator:
    """The scores of one simulator."""
    singles, unlisted = [row for row in rows if row["kind"] in ("single", "beside")], _of(rows, "unlisted")
    clear = [row for row in singles if row["ratio"] >= CLEAR_RATIO]
    result = OfSimulator(
        cases=dict(Counter(row["kind"] for row in rows)),
        nulls=_nulls(rows), naming=_naming(clear, [row for row in unlisted if row["ratio"] >= CLEAR_RATIO]),
        power=tuple(_power(ratio, [row for row in singles if ratio_of(row) == ratio]) for ratio in RATIOS),
        disguises={
            kind: proportion(outcome(row) in RIGHT for row in _of(rows, kind) if row["ratio"] >= CLEAR_RATIO) for kind in DISGUISES
        },
        masked=tuple(_masked(clear, low, high) for low, high in ((0.0, 0.5), (0.5, 0.9), (0.9, 1.01))),
        effects={
            effect: _effect(effect, [row for row in rows if row["truth"]["effects"] and row["truth"]["effects"][0]["id"] == effect])
            for effect in sorted({row["truth"]["effects"][0]["id"] for row in singles + unlisted})
        },
        location=_location(rows), parameters=_parameters(clear), measurable=_measurable(clear),
        removed=Removed(
            from_0_3=summary(removed(row) for row in clear),
            by_ratio={f"{ratio:g}": summary(removed(row) for row in singles if ratio_of(row) == ratio) for ratio in RATIOS},
        ),
        pairs=_together(_of(rows, "pair")), triples=_together(_of(rows, "triple")),
        unlisted=_unlisted(unlisted), laws=_laws(_of(rows, "law")), dirty=_dirty(_of(rows, "dirty")),
        sheets=_sheets(_of(rows, "sheet")), beside=_beside(_of(rows, "beside")),
        without=_without(_of(rows, WITHOUT)),
        seconds_per_case=summary(row["seconds"]["diagnosis"] for row in rows), peers=_peers(rows),
    )  # fmt: skip
    return replace(result, targets=judged(result))


def _masked(clear: Sequence[Row], low: float, high: float) -> AtMasked:
    score = proportion(outcome(row) in RIGHT for row in clear if low <= row["masked"] < high)
    return AtMasked(**asdict(score), masked=f"{low:g} to {high:g}")


def _nulls(rows: Sequence[Row]) -> Nulls:
    nulls = _of(rows, "null")
    return Nulls(
        silent=proportion(outcome(row) == "silent" for row in nulls),
        by_noise=_grouped(nulls, lambda row: str(row["noise"]), lambda group: proportion(outcome(r) == "silent" for r in group)),
        heldout_over_noise=summary(s[0] / s[2] for row in nulls if (s := heldout(row)) is not None),
        named=_named(nulls),
    )


def _named(rows: Sequence[Row]) -> dict[str, int]:
    return dict(Counter(e["id"] for row in rows if row["diagnosis"] for e in row["diagnosis"]["effects"]))


def _naming(clear: Sequence[Row], unlisted_clear: Sequence[Row]) -> Naming:
    right = [row for row in clear if outcome(row) in RIGHT]
    return Naming(
        from_0_3=proportion(outcome(row) in RIGHT for row in clear),
        extra_names=proportion(outcome(row) == "extra name" for row in clear if outcome(row) in (*RIGHT, "extra name")),
        outcomes_from_0_3=dict(Counter(outcome(row) for row in clear)),
        tie_size=summary(float(len(row["diagnosis"]["effects"][0]["indistinguishable_from"])) for row in right),
        confusion=_confusion([*clear, *unlisted_clear]),
    )


def _location(rows: Sequence[Row]) -> Location:
    places = [(row["kind"], location(row)) for row in rows if row["kind"] not in TOGETHER]
    there = [place for _, place in places if place is not None]
    return Location(
        listed=summary(place for kind, place in places if kind != "unlisted"),
        unlisted=summary(place for kind, place in places if kind == "unlisted"),
        above_0_7=proportion(place > TARGETS["location_iou"].value for place in there),
        values=tuple(round(place, 3) for place in there),
    )


def _parameters(clear: Sequence[Row]) -> Parameters:
    """Coefficients of the catalogue's own laws."""
    errors = [(key, *value) for row in clear for key, value in parameter_errors(row).items()]
    return Parameters(
        all=summary(error for _, error, _ in errors),
        within_10_percent=proportion(error <= TARGETS["parameter_error"].value for _, error, _ in errors),
        interval_covers=proportion(covered for _, _, covered in errors if covered is not None),
        error={key: summary(e for k, e, _ in errors if k == key) for key in sorted({key for key, _, _ in errors})},
    )


def _measurable(clear: Sequence[Row]) -> Measurable:
    """What an engineer would measure (``probe.MEASURES``)."""
    errors = [(key, *value) for row in clear for key, value in measured_errors(row).items()]
    widths = [(key, width) for row in clear for key, width in measured_width(row).items()]
    return Measurable(
        all=summary(error for _, error, _ in errors),
        within_10_percent=proportion(error <= TARGETS["measured_error"].value for _, error, _ in errors),
        interval_covers=proportion(covered for _, _, covered in errors),
        half_width=summary(width for _, width in widths),
        error={key: summary(e for k, e, _ in errors if k == key) for key in sorted({key for key, _, _ in errors})},
        covers={key: proportion(c for k, _, c in errors if k == key) for key in sorted({key for key, _, _ in errors})},
    )


def _together(rows: Sequence[Row]) -> SeveralEffects:
    """Several effects at once."""
    clear = [row for row in rows if row["ratio_beside"] and min(row["ratio_beside"].values()) >= CLEAR_RATIO]
    return SeveralEffects(
        all=proportion(all_answered(row) for row in rows), one_or_more=proportion(answered(row) > 0 for row in rows),
        all_from_0_3=proportion(all_answered(row) for row in clear),
        extra_names=proportion(has_wrong_extra(row) for row in rows if all_answered(row)),
    )  # fmt: skip


def _unlisted(rows: Sequence[Row]) -> Unlisted:
    """The fixed kinds of unlisted physics, three of which are laws of the grammar."""
    at = {ratio: proportion(called_unlisted(row) for row in rows if ratio_of(row) == ratio) for ratio in RATIOS}
    return Unlisted(
        called_unlisted=proportion(called_unlisted(row) for row in rows if row["ratio"] >= CLEAR_RATIO),
        by_ratio=tuple(AtRatio(**asdict(score), ratio=ratio) for ratio, score in at.items()),
    )


def _laws(rows: Sequence[Row]) -> Laws:
    """Unlisted laws from the generator, which nobody wrote for a single cell."""
    clear = [row for row in rows if row["ratio"] >= CLEAR_RATIO]

    def kept(key: str, empty: bool) -> Share:
        return proportion(called_unlisted(row) for row in clear if (row["truth"]["effects"][0]["parameters"][key] in ("", "none")) == empty)

    return Laws(
        called_unlisted=proportion(called_unlisted(row) for row in clear), inside_grammar=kept("outside", empty=True),
        outside_grammar=kept("outside", empty=False), with_memory=kept("memory", empty=False),
        by_channel=_grouped(clear, _channel, lambda group: proportion(called_unlisted(row) for row in group)),
        named=_named(clear), outcomes=dict(Counter(outcome(row) for row in clear)),
        foretold=summary(foretold(row) for row in clear),
        harmed=proportion(worse for row in clear if (worse := harmed(row)) is not None),
    )  # fmt: skip


def _channel(row: Row) -> str:
    return str(row["truth"]["effects"][0]["parameters"]["channel"])


def _dirty(rows: Sequence[Row]) -> Dirty:
    """Nothing is hidden, but the recording is as the field's are. Too little to say anything is right as well as silence."""
    quiet = ("silent", "insufficient data")
    return Dirty(
        silent=proportion(outcome(row) in quiet for row in rows), outcomes=dict(Counter(outcome(row) for row in rows)),
        named=_named(rows), blamed_on_the_sheet=proportion(wrong_sheet(row) is not None for row in rows),
    )  # fmt: skip


def _sheets(rows: Sequence[Row]) -> Sheets:
    """Wrong sheets: told with a right entry among the first suspects and no name; told at all; by what is wrong."""

    def mistake(row: Row) -> str:
        return str(row["mistake"]["what"]).split(" x ")[0]

    return Sheets(
        told=proportion(sheet_told(row) for row in rows), finding=proportion(wrong_sheet(row) is not None for row in rows),
        by_mistake=_grouped(rows, mistake, lambda group: proportion(sheet_told(row) for row in group)),
        named_nothing=proportion(not names_named(row) for row in rows), named=_named(rows),
        other_findings=dict(Counter(
            finding["finding"] for row in rows if row["diagnosis"] and wrong_sheet(row) is None for finding in row["diagnosis"]["findings"]
        )),
    )  # fmt: skip


def _beside(rows: Sequence[Row]) -> BesideForm:
    """Effects beside a friction law of another form."""
    clear = [row for row in rows if row["ratio"] >= CLEAR_RATIO]
    return BesideForm(
        named=proportion(answered(row) == 1 for row in clear), extra_names=proportion(has_wrong_extra(row) for row in clear),
        outcomes=dict(Counter(outcome(row) for row in clear)),
    )  # fmt: skip


def _without(rows: Sequence[Row]) -> Without:
    """What stands in the place of an entry that is taken away: a law, or another name."""
    shares = [(row, share) for row in rows if (share := removed_without(row)) is not None]
    lawful = [share for row, share in shares if row["without"]["laws"]]
    return Without(
        enough=proportion(share >= TARGETS["without"].value for _, share in shares), removed=summary(share for _, share in shares),
        by_laws=summary(lawful), share={row["truth"]["effects"][0]["id"]: round(share, 3) for row, share in shares},
    )  # fmt: skip


def _of(rows: Sequence[Row], kind: str) -> list[Row]:
    return [row for row in rows if row["kind"] == kind]


def _grouped(rows: Sequence[Row], key: Callable[[Row], str], score: Callable[[list[Row]], T]) -> dict[str, T]:
    return {name: score([row for row in rows if key(row) == name]) for name in sorted({key(row) for row in rows})}


def _power(ratio: float, rows: Sequence[Row]) -> Power:
    outcomes = [outcome(row) for row in rows]
    return Power(ratio, detected=proportion(o in DETECTED for o in outcomes), right=proportion(o in RIGHT for o in outcomes))


def _effect(effect: str, rows: Sequence[Row]) -> OfEffect:
    """One row of the table of effects: outcomes by ratio and by disguise, and what it was taken for where it was clear enough."""
    right = ("unlisted",) if any(row["kind"] == "unlisted" for row in rows) else RIGHT
    plain = [row for row in rows if row["kind"] in ("single", "beside", "unlisted")]
    missed = [row for row in rows if row["kind"] not in TOGETHER and row["ratio"] >= CLEAR_RATIO and outcome(row) not in right]
    taken: Counter[str] = Counter()
    for row in missed:
        names = {e["id"] for e in row["diagnosis"]["effects"]} - {effect} if row["diagnosis"] else set()
        taken.update(names or {outcome(row)})
    cells = {f"{ratio:g}": [row for row in plain if ratio_of(row) == ratio] for ratio in RATIOS}
    cells |= {kind: _of(rows, kind) for kind in DISGUISES}
    return OfEffect(
        right={name: (sum(outcome(row) in right for row in cell), len(cell)) for name, cell in cells.items()},
        outcomes=dict(Counter(outcome(row) for row in plain)),
        taken_for=dict(taken),
        masked=summary(row["masked"] for row in plain),
    )


def _confusion(rows: Sequence[Row]) -> dict[str, dict[str, int]]:
    """True effect -> answer -> count. An answer is the name with the largest share, a tie that holds the truth, or a verdict."""
    table: dict[str, Counter[str]] = {}
    for row in rows:
        result = outcome(row)
        if result in ("right name", "extra name", "wrong name"):
            result_name = max(row["diagnosis"]["effects"], key=lambda effect: effect["energy_share"])["id"]
        else:
            result_name = result
        table.setdefault(row["truth"]["effects"][0]["id"], Counter())[result_name] += 1
    return {true: dict(answers) for true, answers in sorted(table.items())}


def _peers(rows: Sequence[Row]) -> dict[str, Peer]:
    """Each peer on the same recordings; our own engine beside them under the same rules."""
    compared = [row for row in rows if row.get("peers")]
    clear = [row for row in compared if row["kind"] == "single" and row["ratio"] >= CLEAR_RATIO]
    found: dict[str, Peer] = {}
    for name in sorted({name for row in compared for name in row["peers"]}):
        have = [row for row in clear if name in row["peers"]]
        named = [row for row in have if row["peers"][name]["names"] is not None]
        found[name] = Peer(
            removed=summary(_removed_by(row, name) for row in have),
            false_alarms=proportion(row["peers"][name]["alarm"] for row in _of(compared, "null") if name in row["peers"]),
            named=proportion(row["truth"]["effects"][0]["id"] in row["peers"][name]["names"] for row in named),
            seconds=summary(row["peers"][name]["seconds"] for row in have),
        )
    if found:
        found["lugre_steering"] = Peer(
            removed=summary(removed(row) for row in clear),
            false_alarms=proportion(outcome(row) != "silent" for row in _of(compared, "null")),
            named=proportion(outcome(row) in RIGHT for row in clear),
            seconds=summary(row["seconds"]["diagnosis"] for row in clear),
        )
    return found


def _removed_by(row: Row, peer: str) -> float | None:
    """``removed`` of a peer."""
    squares, entry = heldout(row), row["peers"][peer]
    if squares is None or entry["before"] <= 1.1 * squares[2]:
        return None
    return float((entry["before"] - entry["after"]) / (entry["before"] - squares[2]))
