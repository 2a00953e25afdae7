"""The pictures of chapter 5, drawn from a run."""

import math

import matplotlib
import matplotlib.pyplot as plt

from run_data import (
    BIN,
    COLUMNS,
    COLUMN_SETS,
    DIGITS,
    FAILURES,
    FORWARD,
    HERE_COLOUR,
    MAX_DOTS,
    MEASURES,
    OTHERS_COLOUR,
    PALM_COM_PALM,
    PALM_DISTANCE,
    RACED_COLOUR,
    RATIO_COLOURS,
    STEPS,
    STEP_COLOURS,
    THESIS_COLOUR,
    THESIS_LADDER,
    THESIS_LOST,
    TYPES,
    TYPE_COLOURS,
    UPWARD,
    WRIST_DISTANCE,
    number,
    shares_of_types,
)

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
    """The first placements of each holdout, at most MAX_DOTS in all."""
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
