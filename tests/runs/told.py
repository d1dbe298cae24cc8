"""Reads what `ddenv why` says of a run, word by word, and holds it against the run file's own rows, read without our code.

python -m tests.runs.told RUN ...
"""

from __future__ import annotations

import json
import math
import re
import sqlite3
import struct
import sys
from pathlib import Path
from statistics import median
from typing import Any

from scipy.special import beta

from ddenv.runfile.fold import fold
from ddenv.runfile.store import RunFile
from ddenv.runs.reasons import parting_sentence, reasons, sentence

KINDS = {
    "gets stuck": "stuck",
    "tips over": "tipped over",
    "falls": "fell",
    "is lost": "lost",
    "runs out of time": "out of time",
}
KIND = re.compile(r"(.+) ([\d.]+) m from f's end")
WITHOUT = re.compile(r"Without (.+?)(?: and what rests on it \(\d+ models?\))? the robot (.+)\.$")
MOST = re.compile(r" \((\d+) of (\d+) fresh runs?, [<>]?(\d+) % to [<>]?(\d+) %\)")
PLACE = r"\((-?[\d.]+), (-?[\d.]+)\) m"
ENDS = re.compile(rf"(near|at most ([\d.]+) m from) {PLACE}$")
PART = re.compile(
    r"With seed (\d+) the two runs (?:differ from the start|differ after ([\d.]+) s|are(?: equal until ([\d.]+) s, and)? never)"
    rf"(?:, and are)? 0\.1 m apart(?: after ([\d.]+) s, at {PLACE})?\."
    r"(?: With (?:it|one of them) there, the robot (touches|senses) (?:it|one of them) after ([\d.]+) s\.)?$"
)


class Rows:
    """The fresh runs of a run file's last certificate: for each, what was left out, how it ended, and where the robot was."""

    def __init__(self, path: Path) -> None:
        self._database = sqlite3.connect(f"file:{path}?mode=ro", uri=True)
        events = [(kind, json.loads(data)) for kind, data in self._database.execute("SELECT kind, data FROM event")]
        self.names = next(data["elements"] for kind, data in events if kind == "created")
        baseline = next(data for kind, data in events if kind == "baseline_finished")
        self.height = baseline["position"][2]
        first = [data["run"] for kind, data in events if kind == "certificate_started"][-1]
        begun = {data["test"]: data for kind, data in events if kind == "test_started"}
        ended = [begun[data["test"]] | data for kind, data in events if kind == "test_finished"]
        fresh = [one for one in ended if one["phase"] == "certify" and one["run"] >= first and one["end_pose"]]
        models = {data["environment"]: int(data["models"], 16) for kind, data in events if kind == "environment_named"}
        models[0] = 2 ** len(self.names) - 1
        claims = [data["claims"] for kind, data in events if kind == "certificate_finished"][-1]
        left = claims[0]["environment"]
        self.all = [
            one
            for one in fresh
            if one["outcome"] in ("similar", "other", "pass")
            and (
                one["environment"] == left
                or (models[one["environment"]] | models[left] == models[left] and "without" in one)
            )
        ]

    def without(self, name: str | None) -> list[dict[str, Any]]:
        number = None if name is None else self.names.index(name)
        return [one for one in self.all if one.get("without") == number]

    def way(self, test: int) -> list[tuple[float, ...]] | None:
        """The robot's rows; None where the file does not have them."""
        row = self._database.execute("SELECT samples FROM motion WHERE test = ? AND model = ''", (test,)).fetchone()
        if row is not None and isinstance(row[0], int):
            return self.way(row[0])
        return None if row is None else list(struct.iter_unpack("<8d", row[0]))


def untrue(path: Path) -> tuple[int, list[str]]:
    """How many sentences there are, and what is wrong in them."""
    rows, wrong, number = Rows(path), [], 0
    with RunFile(path) as file:
        told = [(each.without, sentence(each), parting_sentence(each)) for each in reasons(file, fold(file.events()))]
    for name, ends, parting in told:
        number += 1 + bool(parting)
        wrong += [f"{name}: {why}: {ends}" for why in _ends(rows, name, ends)]
        if parting and not parting.startswith("Where the ways part is not known"):
            wrong += [f"{name}: {why}: {parting}" for why in _parting(rows, name, parting)]
    return number, wrong


def _wealth(shown: int, runs: int, rate: float) -> float:
    return float(beta(shown + 0.5, runs - shown + 0.5) / beta(0.5, 0.5) / (rate**shown * (1 - rate) ** (runs - shown)))


def _ends(rows: Rows, name: str, words: str) -> list[str]:
    said, mine = WITHOUT.fullmatch(words), rows.without(name)
    if said is None or said[1] != name:
        return ["not understood"]
    most = MOST.search(said[2])
    if most is None:
        return ["no rate"]
    shown, runs, low, high = map(int, most.groups())
    wrong = [] if runs == len(mine) else [f"{len(mine)} runs"]
    # From its definition: outside, a bet that mixes all rates has won 20 times its stake against the rate; inside, it has not.
    for told, sign in ((low, -1), (high, 1)):
        inside, outside = ((told - sign) / 100, (told + sign) / 100)
        if _wealth(shown, runs, inside) >= 20 or (0 < outside < 1 and _wealth(shown, runs, outside) < 20):
            wrong.append(f"{told} %")
    clauses = [(MOST.sub("", said[2].split(";")[0]), shown)]
    for part in said[2].split(";")[1:]:
        does, _, count = part.strip().removeprefix("it ").rpartition(" in ")
        clauses.append((does, int(count)))
    counts = [count for _, count in clauses]
    if sum(counts) != len(mine) or counts != sorted(counts, reverse=True):
        wrong.append(f"{counts} do not add up, or are in no order")
    return wrong + [why for does, count in clauses for why in _clause(rows, mine, does, count)]


def _clause(rows: Rows, mine: list[dict[str, Any]], does: str, count: int) -> list[str]:
    if does == "still fails as in f":
        return [] if count == sum(one["outcome"] == "similar" for one in mine) else [f"not {count} as in f"]
    if reached := re.fullmatch(r"reaches its goal after (\d+) s", does):
        seconds = [one["simulated_seconds"] for one in mine if one["outcome"] == "pass"]
        right = len(seconds) == count and abs(median(seconds) - int(reached[1])) <= 0.5
        return [] if right else [f"the goal after {sorted(seconds)}"]
    kind, _, where = does.partition(", ")
    failed = KIND.fullmatch(kind)
    word = KINDS.get(failed[1]) if failed else None
    others = [one for one in mine if one["outcome"] == "other" and one["failure"] == word]
    ends = [one["end_pose"] for one in others]
    place = ENDS.fullmatch(where)
    if len(ends) != count or place is None or failed is None:
        return [f"{len(ends)} of '{does}'"]
    reach, x, y = float(place[2] or 0.5), float(place[3]), float(place[4])
    wrong = [f"ended at {end[:3]}" for end in ends if math.dist(end[:2], (x, y)) > reach + 0.01]
    away = median(one["distance"] for one in others)
    wrong += [f"{away:.2f} m from f's end"] if abs(away - float(failed[2])) > 0.06 else []
    return wrong


def _parting(rows: Rows, name: str, words: str) -> list[str]:
    said = PART.fullmatch(words)
    if said is None:
        return ["not understood"]
    seed, equal, never = int(said[1]), float(said[2] or said[3] or 0), said[4] is None
    one = next((each for each in rows.without(None) if each["seed"] == seed and each["outcome"] == "similar"), None)
    other = next((each for each in rows.without(name) if each["seed"] == seed and each["outcome"] != "similar"), None)
    if one is None or other is None:
        return ["no such pair of runs"]
    first, second = rows.way(one["test"]), rows.way(other["test"])
    if first is None or second is None:
        return ["a way is not there"]
    wrong = []
    both = list(zip(first, second, strict=False))
    for (t, *a), (_, *b) in both:
        if t <= equal + 0.01 and a != b and t > 0:
            wrong.append(f"they differ at {t:.1f} s")
    after = next((t for (t, *a), (_, *b) in both if a != b), None)
    if not (never if after is None else equal <= after <= equal + 0.11):
        wrong.append(f"they differ from {after} s")
    at = next(((t, b[0], b[1]) for (t, *a), (_, *b) in both if math.dist(a[:2], b[:2]) >= 0.1), None)
    told = None if never else (float(said[4]), float(said[5]), float(said[6]))
    if (at is None) != (told is None) or (
        at and told and max(abs(x - y) for x, y in zip(at, told, strict=True)) > 0.051
    ):
        wrong.append(f"they are apart at {at}")
    if said[7]:
        met = dict(one.get("first_touched" if said[7] == "touches" else "first_sensed", ()))
        at_once = met.get(rows.names.index(name))
        if at_once is None or abs(at_once - float(said[8])) > 0.051:
            wrong.append(f"{said[7]} it after {at_once} s")
    return wrong[:5]


if __name__ == "__main__":
    for word in sys.argv[1:]:
        number, wrong = untrue(Path(word))
        print(f"{word}: {number} sentences, {len(wrong)} wrong", *wrong, sep="\n  ")
