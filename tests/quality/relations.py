"""Correlations: survival with epsilon, comfort E with the verdict; and the distribution of grasp types."""

import collections
import csv
import re

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from scipy.stats import rankdata, spearmanr

# Bounds of the classes of epsilon, which has no unit (presses of one newton, torque over half the span of the contacts).
EPSILONS = [0.0, 0.005, 0.01, 0.02, 0.03, 0.04, 0.06, 0.08, np.inf]


def survival_by_epsilon(found):
    """Markdown table of the grasps that survive, by class of the judge's epsilon."""
    lines = ["| epsilon | grasps | survives gravity | single pushes | all six |", "|---|--:|--:|--:|--:|"]
    for low, high in zip(EPSILONS, EPSILONS[1:]):
        here = [row for row in found if low <= row["epsilon"] < high]
        if here:
            named = f"{low:g} to {high:g}" if np.isfinite(high) else f"{low:g} and more"
            lines.append(f"| {named} | {len(here)} | {' | '.join(survival_cells(here))} |")
    lines.append(f"| all | {len(found)} | {' | '.join(survival_cells(found))} |")
    lines += ["", f"Rank correlation of epsilon with the runs survived: {correlation(found, 'epsilon', runs_survived)}."]
    return "\n".join(lines)


def survival_cells(rows):
    """The shares that survive gravity, single pushes (six per grasp), and everything."""
    n = len(rows)
    gravity, pushes, every = (sum(row[f"survives_{name}"] for row in rows) for name in ("gravity", "pushes", "all"))
    return [f"{100 * gravity / n:.0f} % ({gravity})", f"{100 * pushes / (6 * n):.0f} %", f"{100 * every / n:.0f} % ({every})"]


def runs_survived(row):
    """How many of the seven runs a grasp survived."""
    return int(row["survives_gravity"]) + row["survives_pushes"]


def correlation(rows, name, verdict):
    """Spearman's rank correlation as text; none if either is the same for all rows."""
    pairs = np.array([(row[name], verdict(row)) for row in rows if np.isfinite(row[name])], float).reshape(-1, 2)
    if len(pairs) < 3 or (np.ptp(pairs, axis=0) == 0).any():
        return "none (all alike)"
    result = spearmanr(pairs[:, 0], pairs[:, 1])
    return f"{result.statistic:+.2f} (p = {result.pvalue:.2g}, n = {len(pairs)})"


def ranked_before(rows, good):
    """The chance that a good grasp has a smaller E than a bad one, counting ties as half; None without both kinds.

    This is Mann and Whitney's U over the number of pairs: 0.5 if E has no predictive value.
    """
    rows = [row for row in rows if np.isfinite(row["comfort"])]
    is_good = np.array([bool(good(row)) for row in rows])
    if is_good.all() or not is_good.any():
        return None
    ranks = rankdata([-row["comfort"] for row in rows])
    n = is_good.sum()
    return float((ranks[is_good].sum() - n * (n + 1) / 2) / (n * (len(rows) - n)))


def comfort_and_verdict(found, acceptable, faults):
    """Markdown table of how well E predicts bad grasps: rank correlations and chances to rank a good one first."""
    verdicts = [
        ("any fault", lambda row: not acceptable(row), acceptable),
        ("number of faults", lambda row: len(faults(row)), None),
    ]
    if "survives_gravity" in found[0]:
        verdicts += [
            ("dropped under gravity", lambda row: not row["survives_gravity"], lambda row: row["survives_gravity"]),
            ("lost in any run", lambda row: not row["survives_all"], lambda row: row["survives_all"]),
            ("runs lost, of seven", lambda row: 7 - runs_survived(row), None),
        ]
    lines = [
        "E is a cost. If it predicted the verdict, bad grasps would have the larger E (a correlation above 0), and good"
        " ones would rank before bad ones in more than half of the pairs.",
        "",
        "| verdict | bad | rank correlation with E | good before bad |",
        "|---|--:|--:|--:|",
    ]
    for name, bad, good in verdicts:
        chance = ranked_before(found, good) if good else None
        count = sum(bad(row) > 0 for row in found)
        shown = "" if chance is None else f"{100 * chance:.0f} %"
        lines.append(f"| {name} | {count} of {len(found)} | {correlation(found, 'comfort', bad)} | {shown} |")
    return "\n".join(lines)


def scatter(file, found, acceptable):
    """Plots E against epsilon for every grasp, coloured by its fate."""
    classes = [("a fault", "#c03030", lambda row: not acceptable(row)), ("no fault", "#4878a8", lambda _: True)]
    if "survives_gravity" in found[0]:
        classes = [
            ("dropped under gravity", "#c03030", lambda row: not row["survives_gravity"]),
            ("lost in a push", "#e0a030", lambda row: not row["survives_all"]),
            ("held in all runs", "#308050", lambda _: True),
        ]
    left = [row for row in found if np.isfinite(row["comfort"])]
    figure, axis = plt.subplots(figsize=(7, 4.5), layout="constrained")
    for label, colour, belongs in classes:
        chosen = [row for row in left if belongs(row)]
        left = [row for row in left if not belongs(row)]
        for marker, sound in [("o", True), ("x", False)]:
            of_kind = [row for row in chosen if acceptable(row) == sound]
            if of_kind:
                points = [[row[name] for row in of_kind] for name in ("comfort", "epsilon")]
                note = f"{label}, {'no' if sound else 'a'} fault ({len(of_kind)})"
                axis.scatter(*points, c=colour, marker=marker, s=22, alpha=0.8, label=note)
    axis.set_xlabel("comfort E (0 is best)")
    axis.set_ylabel("soft-finger epsilon")
    axis.legend(fontsize=7)
    figure.savefig(file)
    plt.close(figure)


def types(found):
    """Markdown table of the grasp types in the replies: how often, and with which confidence."""
    typed = [row for row in found if "type" in row]
    counts = collections.Counter(row["type"] for row in typed)
    lines = ["| type | grasps | share | mean confidence |", "|---|--:|--:|--:|"]
    for name, count in sorted(counts.items(), key=lambda pair: (-pair[1], pair[0])):
        mean = np.mean([row["type_confidence"] for row in typed if row["type"] == name])
        shown = name.replace("_", " ") or "*unclassifiable*"
        lines.append(f"| {shown} | {count} | {100 * count / len(typed):.0f} % | {mean:.2f} |")
    return "\n".join(lines)


FILE = "figures.csv"


def save(folder, lines):
    """Saves the table of targets of a report."""
    with open(folder / FILE, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["measure", "target", "figure"])
        writer.writerows([line.measure, line.wanted, line.figure] for line in lines)


def load(folder):
    """The figures of a report by measure."""
    with open(folder / FILE, newline="", encoding="utf-8") as file:
        return {row["measure"]: row["figure"] for row in csv.DictReader(file)}


def difference(here, there):
    """The difference of the first numbers of two figures as text; empty if either has none."""
    numbers = [re.search(r"-?\d+(\.\d+)?", figure) for figure in (here, there)]
    if not all(numbers):
        return ""
    return f"{float(numbers[0].group()) - float(numbers[1].group()):+.4g}"


def table(lines, folder):
    """Markdown table of these figures, those of the report in a folder, and their differences."""
    others = load(folder)
    text = [f"| | here | {folder.name} | difference |", "|---|---|---|--:|"]
    for line in lines:
        if line.measure in others:
            there = others[line.measure]
            text.append(f"| {line.measure} | {line.figure} | {there} | {difference(line.figure, there)} |")
    return "\n".join(text)
