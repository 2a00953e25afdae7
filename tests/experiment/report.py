"""Makes a report of a run of grasp-experiment: figures and tables of chapter 5 beside the thesis', and what chapter 5 says
against the run.

    report.py RUN REPORT

RUN is the folder of the run. README.md and pictures go to the folder REPORT. Figures and statements of sets that are not in the
run are left out.
"""

import json
import math
import re
import sys
from dataclasses import dataclass
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
import pandas as pd
from PIL import Image

# Colours of a picture's file: more look the same in charts.
PALETTE = 64

# The thesis' measurements, on one thread of an Intel Core i7-5700HQ in Unity (5.1).

# Attempts and milliseconds per valid grasp by holdout (Figures 5.5a and 5.16a).
HOLDOUTS = [
    f"{name}-{hold}" for name in ["remote", "scalpel", "scissors"] for hold in ["genhold1", "genhold2", "genhold3", "hold1", "hold2"]
]
# fmt: off
THESIS_BY_HOLDOUT = {
    "A": [
        (515_593, 147_335), (2_214_064, 642_242), (139_860, 40_525), (1_971_821, 661_714), (134_359, 48_915),
        (380_771, 95_681), (161_882, 41_362), (5_529, 1_415), (1_206_705, 340_163), (16_541, 6_075),
        (10_649, 3_022), (3_890, 1_095), (20_506, 5_718), (10_453, 3_145), (51_689, 18_660),
    ],
    "D": [
        (11_964, 9_806), (90_882, 77_770), (4_186, 3_605), (71_477, 50_009), (3_986, 2_611),
        (17_350, 11_319), (2_316, 1_538), (118, 90), (24_933, 14_910), (457, 245),
        (250, 148), (133, 106), (464, 327), (194, 140), (2_433, 1_086),
    ],
}
# fmt: on

# The means over the holdouts: the last rows of those figures, and the text for the others (5.3, 5.4; E is column (c) of
# Figure 5.20; F is "one in 15000" and "5s", end of 5.6).
THESIS_LADDER = {
    "A": (456_287, 137_138),
    "B": (30_302, 52_000),
    "C": (15_931, 28_000),
    "D": (15_410, 11_581),
    "E": (14_617, 5_162),
    "F": (15_000, 5_000),
}

# Figure 5.20: set and bend ratios of each column, and its last row: column (a), and the differences of the others from it.
COLUMNS = {
    "(a)": ("D", "all", (18_122, 12_939)),
    "(b)": ("D/all-fingers-without-low", "fingers without 0.7", (-2_071, -4_133)),
    "(c)": ("E", "one random", (-3_505, -7_777)),
    "(d)": ("D/one-random-fingers-without-low", "one random, fingers without 0.7", (-3_223, -7_701)),
    "(e)": ("D/only-one", "only 1.0", (2_292, -5_500)),
    "(f)": ("D/only-high", "only 1.42", (-2_593, -7_028)),
}
COLUMN_SETS = [name for name, _, _ in COLUMNS.values()]

# Figure 5.19: contacts lost when a digit that touched with one ratio (rows) closes with another (columns).
THESIS_LOST = {
    "thumb": ((0, 25, 27), (37, 0, 30), (46, 52, 0)),
    "index": ((0, 0, 6), (45, 0, 31), (49, 30, 0)),
    "middle": ((0, 2, 3), (15, 0, 14), (37, 23, 0)),
    "ring": ((0, 1, 1), (14, 0, 9), (18, 11, 0)),
    "little": ((0, 0, 1), (6, 0, 1), (11, 8, 0)),
}

# "An average of 18 satisfactory force distributions is found in a set of 100 tries" (5.6).
THESIS_SUFFICIENT = 18
# "We have not seen grasps that have more than 6 contacts" (5.5).
THESIS_MOST_CONTACTS = 6

# The measures of wrist placements with their ranges in Table 5.3 and where axes end: wrists are placed within a reach of 22 cm of
# the object's box, which is a little farther from the object, and palms lie up to a palm's length farther out.
MEASURES = {
    "wrist distance, cm": ((0.75, 12), 26),
    "palm distance, cm": ((0, 8), 36),
    "upwards wrist angle, °": ((0, 55), 180),
    "forward wrist angle, °": ((35, 95), 180),
    "wrist angle sum, °": ((90, 115), 360),
    "palm-CoM-palm angle, °": ((90, 180), 180),
}
WRIST_DISTANCE, PALM_DISTANCE, UPWARD, FORWARD, ANGLE_SUM, PALM_COM_PALM = MEASURES

LADDER = "ABCDEF"
DIGITS = list(THESIS_LOST)
FINGERS = DIGITS[1:]
RATIOS = [0.7, 1.0, 1.42]
STEPS = ["Wrist Placement", "Finger Posing", "Collision Validation", "Contact Validation", "Immobility Validation"]
# Table 5.2.
FAILURES = [
    "NoContacts",
    "NoThumb",
    "NoThumbEarlystop",
    "NoFingers",
    "PalmCollision",
    "FingerCollision",
    "UnwantedContact",
    "NotImmobilizing",
]
TYPES = ["Valid", *FAILURES]

# Yaw angles that the index finger may take, in degrees (5.4).
INDEX_YAW = (-5, 5)
# Quantile of the Kolmogorov distribution, for some 35 values or more.
KOLMOGOROV_95 = 1.36
# Half the width of a 95 % interval, in standard errors.
STANDARD_ERRORS = 1.96
# Times that Immobility Validation was repeated for each valid grasp.
REPEATS = 8
# Width of a bin of Figures 5.13 and 5.17, in degrees.
BIN = 10
# Largest number of failed attempts drawn per set, as in the thesis: more would hide each other.
MAX_DOTS = 1500

# Colours that people with protanopia, deuteranopia or tritanopia can distinguish, most from the palette of Okabe and Ito ("Color
# Universal Design", 2008), some from the schemes of Tol ("Colour Schemes", SRON/EPS/TN/09-002, 2021).
TYPE_COLOURS = dict(
    zip(
        TYPES,
        ["#009e73", "#e69f00", "#56b4e9", "#0072b2", "#cc79a7", "#d55e00", "#ddcc77", "#666633", "#882255"],
        strict=True,
    )
)
STEP_COLOURS = dict(zip(STEPS, ["#56b4e9", "#0072b2", "#d55e00", "#f0e442", "#882255"], strict=True))
# Purple, green and blue, as in the thesis (Figure 5.15), apart in lightness too.
RATIO_COLOURS = dict(zip(RATIOS, ["#5d1a75", "#228833", "#56b4e9"], strict=True))
THESIS_COLOUR, HERE_COLOUR, RACED_COLOUR, OTHERS_COLOUR = "#bbbbbb", "#0072b2", "#1c286e", "#1c286e"


class Run:
    """The files of a run."""

    def __init__(self, folder):
        self.about = json.loads((folder / "run.json").read_text())
        self.searches = pd.read_csv(folder / "searches.csv")
        self.searches["ms"] = self.searches.nanoseconds / 1e6
        attempts = pd.read_csv(folder / "attempts.csv").rename(
            columns={
                "wrist_distance_cm": WRIST_DISTANCE,
                "palm_distance_cm": PALM_DISTANCE,
                "upward_wrist_angle_degrees": UPWARD,
                "forward_wrist_angle_degrees": FORWARD,
                "palm_com_palm_angle_degrees": PALM_COM_PALM,
            }
            | {f"{step.lower().replace(' ', '_')}_ns": step for step in STEPS}
        )
        attempts[STEPS] /= 1e3
        contacts = attempts[[f"{digit}_contacts" for digit in DIGITS]]
        derived = {
            ANGLE_SUM: attempts[UPWARD] + attempts[FORWARD],
            "contacts": contacts.sum(axis=1),
            "touching_digits": (contacts > 0).sum(axis=1),
            "no_type": attempts.grasp_type.isna().astype(float),
        }
        self.attempts = attempts.assign(**derived)
        sets = self.searches.set.unique()
        self.sets = [name for name in sets if "/" not in name]
        self.ladder = [name for name in self.sets if name in LADDER]
        self.holdouts = list(self.searches.holdout.unique())
        self.threads = self.searches.threads.max()

    def has(self, *names):
        return all(name in self.searches.set.values for name in names)

    def of(self, name, threads=1):
        """The searches of a set."""
        return self.searches[(self.searches.set == name) & (self.searches.threads == threads)]

    def both(self, name):
        """Positive and negative grasp set together."""
        return self.attempts[self.attempts.set == name]

    def valid(self, name):
        """The positive grasp set."""
        return self.attempts[(self.attempts.set == name) & (self.attempts.output_type == "Valid")]

    def failed(self, name):
        """The negative grasp set."""
        return self.attempts[(self.attempts.set == name) & (self.attempts.output_type != "Valid")]

    def means(self, name, threads=1):
        """Attempts and milliseconds per valid grasp: means over the holdouts."""
        searches = self.of(name, threads)
        return mean_of_means(searches, "attempts"), mean_of_means(searches, "ms")

    def per_holdout(self, name, column):
        return self.of(name).groupby("holdout")[column].mean()

    def failure_shares(self, name):
        return shares_of_types(self.failed(name))

    def touching(self, name, digit):
        """Bend angle and ratio of a digit where it touches, in valid and failed attempts."""
        both = self.both(name)
        both = both[both[f"{digit}_bend_ratio"].notna()]
        return both[f"{digit}_bend_degrees"], both[f"{digit}_bend_ratio"]

    def bend_bins(self, name, digit):
        """Figure 5.17: touching digits by bin of the bend angle and by ratio, without a gap."""
        bend, ratio = self.touching(name, digit)
        if bend.empty:
            return pd.DataFrame(0, index=[0], columns=RATIOS)
        counts = pd.crosstab((bend // BIN * BIN).astype(int), ratio)
        bins = range(counts.index.min(), counts.index.max() + BIN, BIN)
        return counts.reindex(index=bins, columns=RATIOS, fill_value=0)

    def lost(self, name, digit):
        """Figure 5.19: contacts lost by old ratio (rows) and new one (columns), and how many touched with the old one."""
        valid = self.valid(name)
        known = valid[valid[f"{digit}_touches_with"].notna()]
        flags, ratios = known[f"{digit}_touches_with"], known[f"{digit}_bend_ratio"]
        lost = [[int(sum(flags[ratios == old].str[new] == "n")) for new in range(3)] for old in RATIOS]
        return lost, [int(sum(ratios == old)) for old in RATIOS]


# Statistics.


def mean_of_means(frame, column):
    """The mean of the holdouts' means: each holdout counts the same."""
    return frame.groupby("holdout")[column].mean().mean()


def margin(frame, column):
    """Half of the 95 % interval of that mean, with the holdouts as independent groups."""
    groups = frame.groupby("holdout")[column]
    return STANDARD_ERRORS * math.sqrt((groups.var() / groups.count()).sum(skipna=False)) / groups.ngroups


def shares_of_types(failed):
    """Output types of failed attempts, in percent."""
    return 100 * failed.output_type.value_counts(normalize=True).reindex(FAILURES, fill_value=0)


def rank_correlation(xs, ys):
    """Spearman's; NaN for fewer than three pairs, or where one side is constant."""
    if len(xs) < 3 or xs.nunique() == 1 or ys.nunique() == 1:
        return math.nan
    return xs.rank().corr(ys.rank())


def distance_from_uniform(values, low, high):
    """The Kolmogorov-Smirnov distance from an even spread."""
    expected = [min(max((value - low) / (high - low), 0), 1) for value in sorted(values)]
    count = len(expected)
    return max(max(abs(e - i / count), abs(e - (i + 1) / count)) for i, e in enumerate(expected))


def share_by_draw(valid):
    """The share of E's variance that stays when only the force distributions of the same grasp are drawn again: mean variance
    within grasps, over that plus the variance of the grasps' true means (one-way random effects)."""
    drawn = valid[["comfort", *(f"comfort_again_{draw}" for draw in range(REPEATS))]]
    drawn = drawn[drawn.count(axis=1) > 1]
    within = drawn.var(axis=1).mean()
    from_draws = (within / drawn.count(axis=1)).mean()
    between = max(drawn.mean(axis=1).var() - from_draws, 0)
    return within / (within + between) if within + between > 0 else math.nan


def share_in_range(values, measure):
    """Share of the values in the range of Table 5.3, with a slack for rounding."""
    low, high = MEASURES[measure][0]
    return values.between(low - 1e-3, high + 1e-3).mean()


# Tables, as Markdown.


def number(value, decimals=None):
    """With three digits, unless `decimals` says how many; a dash if missing."""
    if isinstance(value, str):
        return value
    if value is None or math.isnan(value):
        return "–"
    if isinstance(value, int):
        return f"{value:,}"
    if decimals is None:
        decimals = 0 if value == 0 else min(max(2 - math.floor(math.log10(abs(value))), 0), 3)
    return f"{value:,.{decimals}f}"


def table(title, header, rows):
    """A table; texts are aligned to the left, numbers to the right. Empty without rows."""
    if not rows:
        return ""
    texts = [[number(value) for value in row] for row in rows]
    is_number = re.compile(r"–|-?[\d.,]+( \([\d.]+\))?").fullmatch
    aligned = ["--:" if all(map(is_number, column)) else "---" for column in zip(*texts, strict=True)]
    lines = [header, aligned, *texts]
    return f"\n**{title}**\n\n" + "".join(f"| {' | '.join(line)} |\n" for line in lines)


def ladder_table(run):
    raced = run.threads > 1
    header = ["set", "grasps", "attempts", "±", "thesis: attempts", "ms", "±", "median ms", "thesis: ms", "µs per attempt", "prunes per attempt"]
    header += [f"ms on {run.threads} threads", "times as fast"] if raced else []
    rows = []
    for name in run.sets:
        own = run.of(name)
        attempts, ms = run.means(name)
        thesis = THESIS_LADDER.get(name, (None, None))
        row = [name, len(own), attempts, margin(own, "attempts"), thesis[0], ms, margin(own, "ms"), own.ms.median(), thesis[1]]
        row += [own.ms.sum() * 1e3 / own.attempts.sum(), own.pruned_placements.sum() / own.attempts.sum()]
        if raced:
            raced_ms = run.means(name, run.threads)[1]
            row += [raced_ms, ms / raced_ms]
        rows.append(row)
    return table("Attempts and time per valid grasp", header, rows)


def holdout_table(run):
    """Sets that the thesis lists by holdout, and the last one."""
    names = [name for name in run.ladder if name in THESIS_BY_HOLDOUT or name == run.ladder[-1]]
    columns = {}
    for name in names:
        columns[f"{name}: attempts"] = run.per_holdout(name, "attempts")
        columns[f"{name}: ms"] = run.per_holdout(name, "ms")
        for index, what in enumerate(["attempts", "ms"] if name in THESIS_BY_HOLDOUT else []):
            columns[f"thesis {name}: {what}"] = pd.Series([float(values[index]) for values in THESIS_BY_HOLDOUT[name]], HOLDOUTS)
    if not columns:
        return ""
    frame = pd.DataFrame(columns).reindex(run.holdouts)
    rows = [[holdout, *values] for holdout, values in zip(frame.index, frame.values.tolist(), strict=True)]
    objects = frame.groupby(frame.index.map(object_of), sort=False).mean()
    rows += [[f"mean of {name}", *values] for name, values in zip(objects.index, objects.values.tolist(), strict=True)]
    rows.append(["mean of all", *frame.mean().tolist()])
    return table("Attempts and time per valid grasp, by holdout", ["holdout", *frame.columns], rows)


def object_of(holdout):
    return holdout.split("-")[0]


def output_type_table(run):
    rows = []
    for name in run.sets:
        failed = run.failed(name)
        if failed.empty:
            continue
        by_holdout = run.of(name).groupby("holdout")[FAILURES].sum()
        of_all = by_holdout.div(by_holdout.sum(axis=1).clip(lower=1), axis=0).mean() * 100
        shares = run.failure_shares(name)
        rows.append([name, len(failed), *(f"{shares[kind]:.1f} ({of_all[kind]:.1f})" for kind in FAILURES)])
    return table("Output types of the negative grasp sets, % (and % of all)", ["set", "attempts", *FAILURES], rows)


def step_table(run):
    rows = []
    for name in run.sets:
        times = run.failed(name)[STEPS].sum()
        if times.sum() > 0:
            shares = [number(100 * time / times.sum(), 1) for time in times]
            rows.append([name, len(run.failed(name)), times.sum() / 1e3, *shares])
    return table("Time of the negative grasp sets by step", ["set", "attempts", "together, ms", *(f"{step}, %" for step in STEPS)], rows)


def measure_table(run):
    rows = []
    for name in filter(run.has, "AB"):
        for measure, ((low, high), _) in MEASURES.items():
            values = run.valid(name)[measure].dropna()
            quantiles = values.quantile([0, 0.05, 0.5, 0.95, 1]).tolist()
            share = number(100 * share_in_range(values, measure), 1)
            rows.append([name, measure, *quantiles, float(low), float(high), share])
    header = ["set", "measure", "smallest", "5 % below", "median", "95 % below", "largest", "Table 5.3: from", "to", "% in there"]
    return table("Measures of the placements of valid grasps", header, rows)


def lost_table(run):
    if not run.has("C"):
        return ""
    rows = []
    totals = {"all digits": [0] * 6, "fingers": [0] * 6}
    for digit in DIGITS:
        lost, touching = run.lost("C", digit)
        for old, ratio in enumerate(RATIOS):
            counts = [*lost[old], *THESIS_LOST[digit][old]]
            rows.append([digit, str(ratio), touching[old], *(None if new % 3 == old else n for new, n in enumerate(counts))])
            for name, total in totals.items():
                if name == "all digits" or digit in FINGERS:
                    total[:] = [a + b for a, b in zip(total, counts, strict=True)]
    rows += [[name, "–", None, *total] for name, total in totals.items()]
    header = ["digit", "old ratio", "touching", *(f"lost on {ratio}" for ratio in RATIOS), *(f"thesis: on {ratio}" for ratio in RATIOS)]
    return table("Contacts lost when the digits of the positive grasp set C close with another bend ratio alone", header, rows)


def column_table(run):
    rows = []
    if not run.has(*COLUMN_SETS):
        return ""
    all_attempts, all_ms = run.means("D")
    for letter, (name, ratios, printed) in COLUMNS.items():
        attempts, ms = run.means(name)
        changes = [attempts / all_attempts - 1, ms / all_ms - 1, *(p / a for p, a in zip(printed, COLUMNS["(a)"][2], strict=True))]
        rows.append([letter, ratios, attempts, ms, *(None if letter == "(a)" else round(100 * change) for change in changes)])
    header = ["column", "bend ratios", "attempts", "ms", "attempts, %", "ms, %", "thesis: attempts, %", "thesis: ms, %"]
    return table("Ways to choose the bend ratios (Figure 5.20), difference from (a) in percent", header, rows)


def grasp_tables(run):
    rows, types = [], []
    for name in run.sets:
        valid = run.valid(name)
        again = valid[[f"comfort_again_{draw}" for draw in range(REPEATS)]].count().sum()
        thesis = (THESIS_MOST_CONTACTS, THESIS_SUFFICIENT) if name in LADDER else (None, None)
        row = [name, len(valid), valid.contacts.mean(), int(valid.contacts.max()), thesis[0], 100 * (valid.touching_digits == 2).mean()]
        row += [valid.sufficient_distributions.mean(), thesis[1], 100 * again / (len(valid) * REPEATS)]
        rows.append([*row, number(valid.comfort.median(), 4), 100 * share_by_draw(valid)])
        common = valid.grasp_type.value_counts(normalize=True).head(3)
        named = ", ".join(f"{kind} {100 * share:.0f} %" for kind, share in common.items())
        share, half = 100 * mean_of_means(valid, "no_type"), 100 * margin(valid, "no_type")
        types.append([name, number(share, 1), number(half, 1), int(valid.grasp_type.nunique()), named or "none"])
    header = ["set", "grasps", "contacts", "most", "thesis: most", "with two digits, %", "of 100 distributions suffice", "thesis"]
    header += ["valid again, %", "E: median", "of its variance by the draw, %"]
    return table("Contacts of valid grasps, force distributions that suffice, and comfort E", header, rows) + table(
        "Valid grasps that are like no type of the taxonomy", ["set", "no type, %", "±", "types that occur", "most frequent of them"], types
    )


# What chapter 5 says.

AGREES, IN_PART, DIFFERS, FIRST_FIGURE = "agrees", "in part", "differs", "a first figure"


@dataclass
class Claim:
    """A statement of the thesis, the run's result, and why they may differ."""

    where: str
    thesis: str
    run: str
    verdict: str
    why: str = ""


def yes_or_no(holds):
    return AGREES if holds else DIFFERS


def graded(agrees, in_part):
    return AGREES if agrees else IN_PART if in_part else DIFFERS


def compared(ours, thesis):
    """A ratio agrees within a factor of 1.5, and in part on the same side of 1."""
    if not (ours > 0 and thesis > 0):
        return DIFFERS
    return graded(max(ours / thesis, thesis / ours) <= 1.5, (ours > 1) == (thesis > 1))


def claims(run):
    """All statements on sets of the run, in the thesis' order."""
    return [claim for on in (naive, placement, posing, bending, immobility, speed, open_questions) for claim in on(run)]


def naive(run):
    """5.2."""
    if not run.has("A") or run.failed("A").empty:
        return
    shares = run.failure_shares("A")
    nothing, unwanted = shares["NoContacts"], shares["UnwantedContact"]
    thesis = "95 % of the naive synthesis' failures are NoContacts"
    yield Claim("5.2, Figure 5.5b", thesis, f"{nothing:.1f} %", yes_or_no(abs(nothing - 95) <= 3))
    rare = shares[["NoFingers", "PalmCollision", "FingerCollision", "NotImmobilizing"]]
    thesis = "very few NoFingers, PalmCollision, FingerCollision and NotImmobilizing, no UnwantedContact"
    ours = "{:.1f}, {:.1f}, {:.1f} and {:.1f} %; UnwantedContact {:.1f} %".format(*rare, unwanted)
    yield Claim("5.2, Figure 5.5b", thesis, ours, yes_or_no(max(rare) < 3 and unwanted < 0.5))
    times = run.failed("A")[STEPS].sum()
    placing, posing = (100 * times[step] / times.sum() for step in STEPS[:2])
    why = (
        "here a digit whose touch segments cannot reach the object costs one bounded closest-point search; the thesis' code asks the "
        "mesh far more often, so placing the wrist weighs less there"
    )
    thesis, ours = "90 % of the time is finger posing, 5 % wrist placement", f"{posing:.0f} % and {placing:.0f} %"
    yield Claim("5.2, Figure 5.7", thesis, ours, graded(posing > 80, posing > placing), why)
    by_holdout = run.per_holdout("A", "attempts")
    objects = by_holdout.groupby(object_of).mean()
    if {"scissors", "scalpel", "remote"} <= set(objects.index):
        easy, hard, harder = objects["scissors"], objects["scalpel"], objects["remote"]
        thesis = "scissors are easy (19,437 attempts), the scalpel is hard (354,286) and the remote harder (995,139)"
        why = (
            "the holdouts are our own: the thesis shows them in pictures only, and how much of an object the giver's hand leaves free "
            "decides how hard it is"
        )
        ours = f"{easy:,.0f}, {hard:,.0f} and {harder:,.0f} attempts"
        yield Claim("5.2, Figure 5.5a", thesis, ours, yes_or_no(easy < hard < harder), why)
    printed = pd.Series([attempts for attempts, _ in THESIS_BY_HOLDOUT["A"]], HOLDOUTS)
    correlation = rank_correlation(printed[by_holdout.index], by_holdout)
    if not math.isnan(correlation):
        thesis = "which holdouts are hard: attempts from 3,890 (Scissors GenHold2) to 2,214,064 (Remote GenHold2)"
        why = "the holdouts were rebuilt after the thesis' pictures and the names of their grasp types"
        ours = f"rank correlation of attempts by holdout {correlation:.2f}"
        yield Claim("Figure 5.5a", thesis, ours, graded(correlation > 0.7, correlation > 0.3), why)


def placement(run):
    """5.3."""
    if run.has("A"):
        shares = {measure: share_in_range(run.valid("A")[measure], measure) for measure in list(MEASURES)[:5]}
        least = min(shares.values())
        thesis = "all valid grasps of set A lie in the ranges of Table 5.3"
        why = (
            "a hand of 22 cm that touches with its fingertips alone has its wrist up to 15 cm from the object; the 12 cm of Table 5.3 "
            "prune those grasps from set B on"
        )
        ours = ", ".join(f"{measure.split(',')[0]} {100 * share:.0f} %" for measure, share in shares.items())
        yield Claim("5.3, Table 5.3", thesis, ours, graded(least > 0.97, least > 0.7), why)
    if run.has("A", "B"):
        (a, a_ms), (b, b_ms) = run.means("A"), run.means("B")
        thesis = "the measures relative to the object divide the attempts by 15 (456,287 to 30,302)"
        yield Claim("5.3", thesis, f"by {a / b:.1f} ({a:,.0f} to {b:,.0f})", compared(a / b, 15.1))
        why = "a failed naive attempt is very cheap here (a fraction of a µs if all digits are out of reach), so fewer save less time"
        ours = f"by {a_ms / b_ms:.1f} ({a_ms:.1f} ms to {b_ms:.1f} ms)"
        yield Claim("5.3", "and the time by 2.6 (137 s to 52 s)", ours, compared(a_ms / b_ms, 137 / 52), why)
    if run.has("B"):
        share = run.failure_shares("B")["NoContacts"]
        why = (
            "the share depends on object and hand sizes and on the box from which placements are drawn; the measures rule out hands that "
            "are too far or turned away in both"
        )
        verdict = AGREES if abs(share - 48) <= 10 else compared(95 / share, 95 / 48)
        yield Claim("5.3, Figure 5.12b", "NoContacts fall from 95 % to 48 % of the failures", f"to {share:.0f} %", verdict, why)
        blunt = (run.valid("B")[PALM_COM_PALM].dropna() > 90).mean()
        thesis = "the two palms make a blunt angle (> 90°) for most valid grasps, a sharp one for a number of them"
        yield Claim("5.3, Figure 5.13", thesis, f"blunt for {100 * blunt:.0f} %", yes_or_no(0.5 < blunt < 1))
    if run.has("B", "C"):
        (b, b_ms), (c, c_ms) = run.means("B"), run.means("C")
        thesis = "the palm-CoM-palm angle divides the attempts by 1.9 (30,302 to 15,931) and the time by 1.9"
        why = (
            "it helps as much as the giver's hand is in the way on its own side; a share of the valid grasps is lost too (those with a "
            "sharp angle, above)"
        )
        yield Claim("5.3", thesis, f"attempts by {b / c:.2f}, time by {b_ms / c_ms:.2f}", compared(b / c, 1.9), why)
        before, after = run.failure_shares("B"), run.failure_shares("C")
        thesis = "which leaves the distribution of failures as it was; 31 % are NoThumb"
        is_same = abs(before["NoContacts"] - after["NoContacts"]) <= 5 and abs(after["NoThumb"] - 31) <= 8
        ours = f"NoContacts {before['NoContacts']:.0f} % to {after['NoContacts']:.0f} %; NoThumb {after['NoThumb']:.0f} %"
        yield Claim("5.3, Figure 5.14b", thesis, ours, graded(is_same, True), "the shares depend on the sizes of hand and objects")


def posing(run):
    """5.4, but for the bend angles and ratios of the digits."""
    if run.has("C", "D"):
        (c, c_ms), (d, d_ms) = run.means("C"), run.means("D")
        thesis = "stopping at a thumb without contact leaves the attempts as they were and divides the time by 2.4"
        why = (
            "posing is a smaller part of an attempt here, beside placing the wrist, and fingers that cannot reach the object were cheap "
            "already"
        )
        yield Claim("5.4, Figure 5.16", thesis, f"attempts by {c / d:.2f}, time by {c_ms / d_ms:.2f}", compared(c_ms / d_ms, 2.4), why)
        shares = run.failure_shares("D")
        ours, are_grouped = f"{shares['NoThumbEarlystop']:.0f} % of the failures", shares["NoContacts"] == shares["NoThumb"] == 0
        yield Claim("5.4, Figure 5.16b", "NoContacts and NoThumb become NoThumbEarlystop", ours, yes_or_no(are_grouped))
    yaws = run.valid("D")
    yaws = yaws[yaws.index_contacts > 0].index_yaw_degrees
    if len(yaws):
        distance, by_chance = 100 * distance_from_uniform(yaws, *INDEX_YAW), 100 * KOLMOGOROV_95 / math.sqrt(len(yaws))
        thesis = "the yaw angles of touching index fingers are spread evenly over their range"
        ours = f"largest distance from an even spread {distance:.1f} %, by chance up to {by_chance:.1f} %"
        why = "with more grasps than the thesis had, a slight lean shows"
        yield Claim("5.4, Figure 5.15", thesis, ours, graded(distance <= by_chance, distance <= 3 * by_chance), why)
    if run.has(*COLUMN_SETS):
        all_ms, *others = [run.means(name)[1] for name in COLUMN_SETS]
        faster = sum(ms < all_ms for ms in others)
        thesis = "every other way to choose bend ratios than trying all is faster: -32, -60, -60, -43, -54 %"
        why = (
            "leaving ratios out saves time only on digits that do not touch with the first one tried, and most that touch do so with the "
            "first here; and it costs the grasps that only the other ratios find"
        )
        ours = ", ".join(f"{100 * (ms / all_ms - 1):+.0f} %" for ms in others)
        yield Claim("5.4, Figure 5.20", thesis, ours, graded(faster == 5, faster > 0), why)
    if run.has("D", "E"):
        (d, d_ms), (e, e_ms) = run.means("D"), run.means("E")
        thesis = "one random bend ratio leaves the attempts as they were and divides the time by 2.2 (11.6 s to 5.2 s)"
        why = (
            "an attempt gets a little cheaper, but fewer succeed, because a digit that does not touch with the drawn ratio is given up; "
            "and placing the wrist, pruned placements included, costs the same as ever"
        )
        yield Claim("5.4, Figure 5.21", thesis, f"attempts times {e / d:.2f}, time by {d_ms / e_ms:.2f}", compared(d_ms / e_ms, 2.2), why)


def bending(run):
    """Figures 5.17 to 5.19."""
    if not run.has("C"):
        return
    bins = {digit: run.bend_bins("C", digit) for digit in DIGITS}
    empty = sum(int((counts.sum(axis=1) == 0).sum()) for counts in bins.values())
    thesis = "digits touch over the whole range of bend angles: no bin of 10° is empty"
    why = "bins at the ends hold few grasps; a small run can leave one empty"
    yield Claim("5.4, Figure 5.17", thesis, f"{empty} empty bins", yes_or_no(empty == 0), why)
    # The share of touching fingers in the upper half of the range that touches.
    sums = {digit: bins[digit].sum(axis=1) for digit in FINGERS}
    upper = {digit: own.iloc[len(own) // 2 :].sum() / max(own.sum(), 1) for digit, own in sums.items()}
    higher = sum(share > 0.5 for share in upper.values())
    why = "a digit stops at the first step that touches; with objects nearer to the palm that is earlier"
    ours = "in the upper half: " + ", ".join(f"{digit} {100 * share:.0f} %" for digit, share in upper.items())
    thesis = "most of the fingers' bend angles are on the higher side"
    yield Claim("5.4, Figure 5.17", thesis, ours, graded(higher == 4, higher > 0), why)
    used = sum(bins[digit].sum() for digit in FINGERS)
    thesis = "the fingers touch less often with ratio 0.7 than with 1 or 1.42, which are equally good"
    why = (
        "the ratio that is tried first is found most often, as the thesis says itself: Algorithm 4 as printed tries 0.7 first and is done "
        "when it touches. Its figure fits a code that begins with another ratio"
    )
    ours = ", ".join(f"{ratio:g}: {100 * used[ratio] / max(used.sum(), 1):.0f} %" for ratio in RATIOS)
    yield Claim("5.4, Figure 5.18", thesis, ours, yes_or_no(used[0.7] < min(used[1.0], used[1.42])), why)
    lost = [run.lost("C", digit) for digit in FINGERS]
    touching = max(sum(sum(counts) for _, counts in lost), 1)
    low, one, high = (sum(old[new] for matrix, _ in lost for old in matrix) for new in range(3))
    thesis = "closing all fingers with 0.7 loses most contacts (195), with 1 fewer (75), with 1.42 fewest (66)"
    why = (
        "most fingers here touched with 0.7, which is tried first, and a ratio loses none of its own contacts; in the thesis most touched "
        "with 1 or 1.42"
    )
    low_text, one_text, high_text = (f"{count} ({100 * count / touching:.0f} %)" for count in (low, one, high))
    ours = f"{low_text}, {one_text} and {high_text} of {touching}"
    yield Claim("5.4, Figure 5.19", thesis, ours, graded(low > one >= high, low > min(one, high)), why)
    on_one, on_high = (sum(matrix[0][new] for matrix, _ in lost) for new in (1, 2))
    percent = [100 * count / touching for count in (on_one, on_high)]
    thesis = "fingers that touched with 0.7 lose barely any contact with 1 (3) or 1.42 (11)"
    ours = f"{on_one} and {on_high}: {percent[0]:.1f} % and {percent[1]:.1f} % of all touching fingers"
    why = "far more fingers touched with 0.7 to begin with, for the reason above"
    yield Claim("5.4, Figure 5.19", thesis, ours, yes_or_no(max(percent) < 5), why)


def immobility(run):
    """5.5 and 5.6."""
    grasps = run.attempts[(run.attempts.output_type == "Valid") & run.attempts.set.isin(run.ladder)]
    if len(grasps):
        most = int(grasps.contacts.max())
        why = (
            "after a first link touches, the outer links go on closing (the prose of 4.4; Algorithm 4 as printed returns at the first "
            "contact), so that a finger can have two or three contacts"
        )
        ours = f"at most {most}, {grasps.contacts.mean():.1f} on average"
        yield Claim("5.5", "no grasp has more than 6 contacts", ours, yes_or_no(most <= THESIS_MOST_CONTACTS), why)
    # The thesis examined Algorithm 9: the sets before F.
    best_of_hundred = grasps[grasps.set != "F"]
    if len(best_of_hundred):
        mean = best_of_hundred.sufficient_distributions.mean()
        why = (
            "the thesis does not say how the four shares of a contact's lines are drawn; here every split is as likely as any other, so "
            "that with lines 70° off the normal the sum points almost anywhere, and the accepted 5° are 0.2 % of all directions: most "
            "valid grasps owe it to the draw. More even shares would suffice more often (not tried)"
        )
        ours = f"{mean:.1f} of 100 drawn again for each valid grasp"
        yield Claim("5.6", "an average of 18 of 100 force distributions suffice", ours, compared(mean, THESIS_SUFFICIENT), why)
    times = run.both("F").groupby("output_type")["Immobility Validation"].mean()
    if "NotImmobilizing" in times.index:
        valid, failed = times["Valid"], times["NotImmobilizing"]
        thesis = "in set F valid grasps spend much less time in Immobility Validation than NotImmobilizing ones"
        verdict = graded(valid < 0.6 * failed, valid < failed)
        yield Claim("5.6, Figure 5.22", thesis, f"{valid:.1f} µs against {failed:.1f} µs", verdict)


def speed(run):
    """The whole ladder (end of 5.6)."""
    if run.has("E", "F"):
        (e, e_ms), (f, f_ms) = run.means("E"), run.means("F")
        thesis = "taking the first sufficient force distribution changes neither attempts nor time visibly"
        ours = f"attempts times {f / e:.2f}, time times {f_ms / e_ms:.2f}"
        yield Claim("5.6", thesis, ours, compared(f_ms / e_ms, 5_000 / 5_162))
    if run.has("A", "F"):
        (a, a_ms), (f, f_ms) = run.means("A"), run.means("F")
        why = "the palm-CoM-palm angle gains less here, and one random bend ratio costs grasps (above)"
        yield Claim("5.6", "from A to F success becomes 30 times as likely", f"{a / f:.1f} times", compared(a / f, 30), why)
        why = (
            "a naive attempt that is out of reach is nearly free here, so A is slow by its number of attempts alone; what the later steps "
            "save in the thesis was never spent"
        )
        verdict = compared(a_ms / f_ms, 137_138 / 5_000)
        yield Claim("5.6", "and F takes 3.6 % of the time of A", f"{100 * f_ms / a_ms:.0f} %", verdict, why)


def open_questions(run):
    """First figures for the open questions of 6.1."""
    if not run.ladder:
        return
    first, last = run.ladder[0], run.ladder[-1]
    if run.threads > 1:
        one, more = run.means(last)[1], run.means(last, run.threads)[1]
        ours = f"set {last}: {one:.1f} ms on one thread, {more:.1f} ms ({one / more:.2f} times as fast) on {run.threads}"
        yield Claim("6.1, open question", "how fast is it on a better computer? (not measured)", ours, FIRST_FIGURE)
    valid = run.valid(last)
    by_draw, correlation = share_by_draw(valid), rank_correlation(valid.comfort, valid.touching_digits)
    if not math.isnan(by_draw + correlation):
        thesis = "does comfort E rank false valid grasps after true ones? (not measured)"
        ours = (
            f"it can hardly: {100 * by_draw:.0f} % of the variance of E in set {last} is the draw of the force distribution and not the "
            f"grasp; rank correlation with the number of touching digits {correlation:.2f}"
        )
        yield Claim("6.1, open question", thesis, ours, FIRST_FIGURE)
    if first != last:
        before, after = (100 * mean_of_means(run.valid(name), "no_type") for name in (first, last))
        half = math.hypot(*(100 * margin(run.valid(name), "no_type") for name in (first, last)))
        change = after - before
        said = "no more than chance would" if abs(change) <= half else f"yes, there are {'more' if change > 0 else 'fewer'}"
        thesis = "did the improvements change the share of false valid grasps? (not measured)"
        ours = (
            f"{said}: of no type of the taxonomy are {before:.1f} % in set {first}, {after:.1f} % in set {last}, a change by "
            f"{change:+.1f} ± {half:.1f} points"
        )
        yield Claim("6.1, open question", thesis, ours, FIRST_FIGURE)


# Pictures.

matplotlib.use("agg")
plt.rcParams |= {
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlesize": 10,
    "axes.axisbelow": True,
    "figure.constrained_layout.use": True,
    "font.size": 9,
    "legend.frameon": False,
    "savefig.dpi": 110,
}


def stacked(axes, rows, series, label):
    """Horizontal bars, the first row on top. `series`: name to colour and a value per row."""
    left = [0] * len(rows)
    for name, (colour, values) in series.items():
        values = list(values)
        axes.barh(rows, values, left=left, color=colour, label=name, edgecolor="white", linewidth=0.5)
        left = [a + b for a, b in zip(left, values, strict=True)]
    axes.invert_yaxis()
    axes.set_xlabel(label)
    axes.grid(axis="x", alpha=0.3)


def grouped(axes, groups, series, title):
    """Vertical bars side by side with their values. `series`: name to colour and a value per group, NaN for none."""
    width = 0.8 / len(series)
    for index, (name, (colour, values)) in enumerate(series.items()):
        places = [group + (index - (len(series) - 1) / 2) * width for group in range(len(groups))]
        bars = axes.bar(places, list(values), width, color=colour, label=name)
        axes.bar_label(bars, ["" if math.isnan(v) else number(float(v)) for v in values], rotation=90, padding=2, fontsize=7)
    axes.set_xticks(range(len(groups)), groups)
    axes.set_title(title)
    axes.legend(loc="upper right")


def below(figure, axes, columns):
    """One legend for all charts, below them."""
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=columns, markerscale=2)


def draw_ladder(run):
    figure, panels = plt.subplots(1, 2, figsize=(10, 4))
    for index, (axes, what) in enumerate(zip(panels, ["Attempts", "Milliseconds"], strict=True)):
        series = {
            "thesis, one thread": (THESIS_COLOUR, [THESIS_LADDER.get(name, (math.nan,) * 2)[index] for name in run.sets]),
            "this run, one thread": (HERE_COLOUR, [run.means(name)[index] for name in run.sets]),
        }
        if index == 1 and run.threads > 1:
            raced = [run.means(name, run.threads)[1] for name in run.sets]
            series[f"this run, {run.threads} threads"] = (RACED_COLOUR, raced)
        grouped(axes, run.sets, series, f"{what} per valid grasp, logarithmic")
        axes.set_yscale("log")
        axes.set_ylim(top=axes.get_ylim()[1] * 8)
    return figure


def draw_shares(run, colours, shares, label):
    """A stacked bar for each negative set; `shares` gives a set's values by the names of the colours."""
    by_set = {name: shares(run.failed(name)) for name in run.sets if len(run.failed(name))}
    if not by_set:
        return None
    figure, axes = plt.subplots(figsize=(9, 1.3 + 0.35 * len(by_set)))
    series = {part: (colour, [own[part] for own in by_set.values()]) for part, colour in colours.items()}
    stacked(axes, list(by_set), series, label)
    below(figure, axes, 4)
    return figure


def draw_output_types(run):
    colours = {kind: TYPE_COLOURS[kind] for kind in FAILURES}
    return draw_shares(run, colours, shares_of_types, "share of the failed attempts, %")


def draw_step_shares(run):
    return draw_shares(run, STEP_COLOURS, lambda failed: 100 * failed[STEPS].sum() / failed[STEPS].sum().sum(), "share of the time, %")


def draw_steps(run):
    names = [name for name in "AF" if run.has(name)]
    figure, panels = plt.subplots(len(names), 1, figsize=(9, 0.6 + 2.6 * len(names)), squeeze=False)
    for name, axes in zip(names, panels.flat, strict=True):
        groups = run.both(name).groupby("output_type")[STEPS]
        means, counts = groups.mean(), groups.size()
        kinds = [kind for kind in TYPES if kind in means.index]
        rows = [f"{kind} ({counts[kind]:,})" for kind in kinds]
        stacked(axes, rows, {step: (STEP_COLOURS[step], means.loc[kinds, step]) for step in STEPS}, "µs per attempt")
        axes.set_title(f"Grasp set {name}")
    below(figure, axes, 3)
    return figure


def drawn_placements(run, name):
    """All placements, or so many per holdout that there are as many failed ones as in the thesis."""
    both = run.both(name)
    return both[both.number < MAX_DOTS // len(run.holdouts)]


def draw_measures(run):
    placements = drawn_placements(run, "A")
    kinds = [kind for kind in TYPES if kind in placements.output_type.values]
    figure, panels = plt.subplots(2, 2, figsize=(10, 6), sharey=True)
    for axes, measure in zip(panels.flat, [WRIST_DISTANCE, PALM_DISTANCE, FORWARD, UPWARD], strict=True):
        for place, kind in enumerate(kinds):
            values = placements[placements.output_type == kind][measure].dropna()
            # Spread over the strip by a sequence without gaps, so that dots hide each other less.
            spread = [place + 0.7 * ((index * 0.618034) % 1 - 0.5) for index in range(len(values))]
            axes.scatter(values, spread, s=5, color=TYPE_COLOURS[kind], linewidths=0, alpha=0.7)
        (low, high), end = MEASURES[measure]
        axes.axvspan(low, high, color="#009e73", alpha=0.1, zorder=0)
        axes.set_xlim(0, end)
        axes.set_yticks(range(len(kinds)), kinds)
        axes.set_xlabel(measure)
    panels[0, 0].invert_yaxis()
    return figure


def draw_pairs(run):
    names = [name for name in "AB" if run.has(name)]
    figure, panels = plt.subplots(len(names), 2, figsize=(10, 4 * len(names)), squeeze=False)
    for name, row in zip(names, panels, strict=True):
        placements = drawn_placements(run, name)
        kinds = placements.output_type
        for axes, measure in zip(row, [WRIST_DISTANCE, FORWARD], strict=True):
            for label, colour, own in [
                ("NoContacts", TYPE_COLOURS["NoContacts"], kinds == "NoContacts"),
                ("other failures", OTHERS_COLOUR, ~kinds.isin(["NoContacts", "Valid"])),
                ("valid", TYPE_COLOURS["Valid"], kinds == "Valid"),
            ]:
                axes.scatter(placements[own][measure], placements[own][UPWARD], s=5, color=colour, label=label, linewidths=0, alpha=0.7)
            axes.set(xlim=(0, MEASURES[measure][1]), ylim=(0, 180), xlabel=measure, ylabel=UPWARD, title=f"Grasp set {name}")
    below(figure, axes, 3)
    return figure


def draw_palm_angles(run):
    figure, axes = plt.subplots(figsize=(7, 3))
    axes.hist(run.valid("B")[PALM_COM_PALM].dropna(), bins=range(0, 180 + BIN, BIN), color=TYPE_COLOURS["Valid"], edgecolor="white")
    axes.set(xlabel=PALM_COM_PALM, ylabel="valid grasps", xticks=range(0, 181, 30))
    return figure


def draw_yaw(run):
    valid = run.valid("D")
    figure, axes = plt.subplots(figsize=(7, 3.5))
    for ratio, colour in RATIO_COLOURS.items():
        own = valid[valid.index_bend_ratio == ratio]
        axes.scatter(own.index_bend_degrees, own.index_yaw_degrees, s=9, color=colour, label=f"ratio {ratio}", linewidths=0)
    axes.set(xlim=(-2, 92), ylim=(-6, 6), xlabel="bend angle of the index finger, °", ylabel="yaw angle, °")
    below(figure, axes, 3)
    return figure


def draw_bend_angles(run):
    figure, panels = plt.subplots(2, 3, figsize=(11, 5.5))
    totals = {}
    for digit, axes in zip(DIGITS, panels.flat, strict=False):
        counts = run.bend_bins("C", digit)
        totals[digit] = counts.sum()
        bottom = 0
        for ratio, colour in RATIO_COLOURS.items():
            axes.bar(counts.index, counts[ratio], BIN, bottom, color=colour, align="edge", edgecolor="white", linewidth=0.5)
            bottom = bottom + counts[ratio]
        axes.set(title=digit, xlabel="bend angle, °", ylabel="touching digits")
    last = panels.flat[-1]
    stacked(last, DIGITS, {f"ratio {r}": (c, [totals[d][r] for d in DIGITS]) for r, c in RATIO_COLOURS.items()}, "touching digits")
    last.set_title("by bend ratio (Figure 5.18)")
    below(figure, last, 3)
    return figure


def draw_lost(run):
    figure, panels = plt.subplots(1, 2, figsize=(10, 3))
    ours = {digit: run.lost("C", digit)[0] for digit in DIGITS}
    titles = [f"This run, {len(run.valid('C')):,} grasps", "The thesis, 375 grasps"]
    for axes, title, lost in zip(panels, titles, [ours, THESIS_LOST], strict=True):
        on_new = {digit: [sum(column) for column in zip(*lost[digit], strict=True)] for digit in DIGITS}
        series = {f"lost on {r}": (c, [on_new[d][i] for d in DIGITS]) for i, (r, c) in enumerate(RATIO_COLOURS.items())}
        stacked(axes, DIGITS, series, "lost contacts")
        axes.set_title(title)
    below(figure, axes, 3)
    return figure


def draw_columns(run):
    figure, panels = plt.subplots(1, 2, figsize=(10, 3.5), sharey=True)
    printed_all = COLUMNS["(a)"][2]
    for index, (axes, what) in enumerate(zip(panels, ["Attempts", "Time"], strict=True)):
        ours = [run.means(name)[index] for name in COLUMN_SETS]
        printed = [100 * (1 + (values[index] / printed_all[index] if letter != "(a)" else 0)) for letter, (*_, values) in COLUMNS.items()]
        series = {"thesis": (THESIS_COLOUR, printed), "this run": (HERE_COLOUR, [100 * value / ours[0] for value in ours])}
        grouped(axes, list(COLUMNS), series, f"{what} per valid grasp, % of (a)")
        axes.set_ylim(0, 215)
    return figure


# Each picture: file, title, the sets that it needs, how it is drawn.
PICTURES = {
    "ladder": ("Attempts and time per valid grasp (Figures 5.5a, 5.12a, 5.14a, 5.16a, 5.21a)", "", draw_ladder),
    "output-types": ("Output types of the negative grasp sets (Figures 5.5b, 5.12b, 5.14b, 5.16b, 5.21b)", "", draw_output_types),
    "figure-5-07": ("Figure 5.7: time of the negative grasp sets by step", "", draw_step_shares),
    "figure-5-06-and-22": ("Figures 5.6 and 5.22: time by step and output type, grasp sets A and F", "AF", draw_steps),
    "figure-5-09": ("Figure 5.9: measures by output type, grasp set A; shaded: Table 5.3", "A", draw_measures),
    "figure-5-10-and-11": ("Figures 5.10 and 5.11: pairs of measures, grasp sets A and B", "AB", draw_pairs),
    "figure-5-13": ("Figure 5.13: palm-CoM-palm angles of the positive grasp set B", "B", draw_palm_angles),
    "figure-5-15": ("Figure 5.15: yaw against bend angle of the index finger, positive grasp set D", "D", draw_yaw),
    "figure-5-17-and-18": ("Figures 5.17 and 5.18: bend angles and ratios of touching digits, grasp set C", "C", draw_bend_angles),
    "figure-5-19": ("Figure 5.19: contacts lost when one bend ratio replaces another, positive grasp set C", "C", draw_lost),
    "figure-5-20": ("Figure 5.20: ways to choose the bend ratios", COLUMN_SETS, draw_columns),
}


# The page.


def sections(run, said):
    """Title, text, pictures and tables of each section."""
    claim_rows = [[c.where, c.thesis, c.run, c.verdict, (c.why if c.verdict in (IN_PART, DIFFERS) else "") or "–"] for c in said]
    return [
        (
            "The ladder",
            "Means over the holdouts, of which each counts the same. An attempt is one accepted placement, as the thesis counts; "
            "placements that the measures pruned before it stand beside it. GUIDED is a server's search for the same grasps, which places "
            "hands where opposed surfaces suggest it. Times are wall-clock times of whole searches. ± is half of a "
            "95 % interval.",
            ["ladder"],
            ladder_table(run) + holdout_table(run),
        ),
        (
            "What chapter 5 says",
            '"In part" means: in the same direction, but not of the same size.',
            [],
            table("What chapter 5 says, and what this run shows", ["where", "the thesis", "this run", "verdict", "why it may differ"], claim_rows),
        ),
        (
            "How attempts end",
            'The negative sets are the first failed attempts of each holdout, as in the thesis. "% of all" is the share in all failed '
            "attempts that the searches made.",
            ["output-types"],
            output_type_table(run),
        ),
        (
            "What the steps take",
            "Each attempt of the positive and negative sets was replayed alone; a step's time is the median of the replays, with one "
            "reading of the clock in it and everything already in the processor's caches. Wrist Placement includes the pruned placements.",
            ["figure-5-07", "figure-5-06-and-22"],
            step_table(run),
        ),
        (
            "Wrist placement",
            "Of failed attempts the pictures show at most as many as the thesis had.",
            ["figure-5-09", "figure-5-10-and-11", "figure-5-13"],
            measure_table(run),
        ),
        (
            "Finger posing",
            "Lost contacts: wrist and yaw of every valid grasp of set C are kept, and each touching digit closes with another bend ratio "
            "alone.",
            ["figure-5-15", "figure-5-17-and-18", "figure-5-19", "figure-5-20"],
            lost_table(run) + column_table(run),
        ),
        (
            "Contacts, forces, comfort and types",
            '"Valid again" is how often Immobility Validation passes when it is repeated for the same contacts. "By the draw" is the '
            "share of E's variance that stays when the grasp is kept and only the random force distributions are drawn anew: E cannot "
            "tell grasps apart by that share. A grasp that is like no type of the taxonomy, by pose and contacts, counts as false valid, "
            "as in the thesis.",
            [],
            grasp_tables(run),
        ),
    ]


def write(run, folder):
    """Writes README.md and the pictures. Returns the claims."""
    folder.mkdir(parents=True, exist_ok=True)
    drawn = {}
    for file, (title, needed, draw) in PICTURES.items():
        if run.has(*needed):
            figure = draw(run)
            if figure is None:
                continue
            figure.savefig(folder / f"{file}.png", metadata={"Software": None})
            plt.close(figure)
            with Image.open(folder / f"{file}.png") as picture:
                reduced = picture.convert("RGB").quantize(PALETTE)
            reduced.save(folder / f"{file}.png", optimize=True)
            drawn[file] = title
    said = claims(run)
    text = (
        "# Chapter 5, made again\n\n"
        f"Made by `{run.about['command']}` and [report.py](../../experiment/report.py): grasp sets {', '.join(run.sets)} over "
        f"{len(run.holdouts)} holdouts. Measured on {run.about['machine']}; reading the clock takes {run.about['clock_nanoseconds']} ns.\n"
    )
    for title, words, pictures, tables in sections(run, said):
        shown = [f"\n![{drawn[file]}]({file}.png)\n" for file in pictures if file in drawn]
        if shown or tables:
            text += f"\n## {title}\n\n{words}\n" + "".join(shown) + tables
    (folder / "README.md").write_text(text)
    return said


def main():
    if len(sys.argv) != 3:
        sys.exit(f"usage: {Path(sys.argv[0]).name} RUN REPORT")
    run, folder = Run(Path(sys.argv[1])), Path(sys.argv[2])
    said = write(run, folder)
    for claim in said:
        if claim.verdict == DIFFERS:
            print(f"differs ({claim.where}): {claim.thesis}; here {claim.run}")
    agree, in_part, differ = (sum(claim.verdict == verdict for claim in said) for verdict in (AGREES, IN_PART, DIFFERS))
    print(f"{agree} statements agree, {in_part} in part, {differ} differ; the report is {folder / 'README.md'}")


if __name__ == "__main__":
    main()
