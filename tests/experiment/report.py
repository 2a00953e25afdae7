"""Makes a report of a run of grasp-experiment: figures and tables of chapter 5 beside the thesis', and its statements
against the run.

    report.py RUN REPORT

RUN is the folder of the run. README.md and pictures go to the folder REPORT. Figures and statements of sets that are not in the
run are left out.
"""

import re
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import pandas as pd
from PIL import Image

from claims import AGREES, DIFFERS, IN_PART, claims
from pictures import PICTURES
from run_data import (
    COLUMNS,
    COLUMN_SETS,
    DIGITS,
    FAILURES,
    FINGERS,
    HOLDOUTS,
    LADDER,
    MEASURES,
    RATIOS,
    REPEATS,
    Run,
    STEPS,
    THESIS_BY_HOLDOUT,
    THESIS_LADDER,
    THESIS_LOST,
    THESIS_MOST_CONTACTS,
    THESIS_SUFFICIENT,
    margin,
    mean_of_means,
    number,
    object_of,
    share_by_draw,
    share_in_range,
)

# Colours of a picture's file: more look the same in charts.
PALETTE = 64


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
