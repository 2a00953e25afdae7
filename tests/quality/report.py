"""Targets and figures: a table for the terminal, a CSV, and a Markdown report with plots and a contact sheet."""

import csv
from dataclasses import dataclass

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import choice
import holdouts
import mannequin
import measures
import relations
import stance
import taxonomy

# Confidence from which a type counts; targets for the percentage of grasps that have one, and for the number of types.
CONFIDENT, CLASSIFIED, TYPES = 0.5, 95, 15


@dataclass
class Target:
    """One line of the table; `met` is None if there is no target."""

    measure: str
    wanted: str
    figure: str
    met: bool | None


def targets(rows):
    """The targets, with the figures of these rows."""
    found = [row for row in rows if row["found"]]
    n = len(found)
    lines = []

    def column(name):
        return np.array([float(row[name]) for row in found])

    def none_of(measure, wrong, detail=""):
        count = int(wrong.sum())
        lines.append(Target(measure, "0", f"{count} of {n} ({100 * count / n:.0f} %){detail}", count == 0))

    by_one = [row for row in found if not row.get("both")]
    if by_one or not found:
        lines += answered(by_one, sum(not row["found"] and not row.get("both") for row in rows))
    lines += within_reach(rows)
    if n == 0:
        return lines
    depth = 1000 * column("penetration")
    lines.append(Target("penetration, median", "≤ 1 mm", f"{np.median(depth):.1f} mm", bool(np.median(depth) <= 1)))
    within = f"{depth.max():.1f} mm ({100 * (depth <= 3).mean():.0f} % within 3 mm)"
    lines.append(Target("penetration, worst", "≤ 3 mm", within, bool(depth.max() <= 3)))
    none_of("forces outside their cones", column("force_outside_cone") > 0)
    imbalance = column("imbalance")
    detail = f"; median {100 * np.median(imbalance):.1f} %"
    none_of("gravity not balanced within 2 %", imbalance > 0.02, detail)
    figure = f"median {np.median(column('epsilon')):.4f}, {100 * (column('epsilon') > 0.02).mean():.0f} % above 0.02"
    lines.append(Target("closure: soft-finger epsilon", "reported", figure, None))
    strongest = column("largest_force")
    none_of("a force above 27 N", strongest > measures.STRONGEST + 0.01, f"; largest {strongest.max():.1f} N")
    idle, all_fingers = int(column("stretched_idle").sum()), 4 * n
    share = 100 * idle / all_fingers
    figure = f"{share:.1f} % of fingers (in {100 * (column('stretched_idle') > 0).mean():.0f} % of grasps)"
    lines.append(Target("idle fingers left stretched", "≤ 5 %", figure, share <= 5))
    none_of("wrong chirality", column("wrong_chirality") > 0)
    none_of("a normal faces away from its phalanx", column("faces_away") > 0)
    none_of("a normal is not the mesh's", column("normal_wrong") > 0)
    off = 1000 * column("off_mesh")
    none_of("a contact off the mesh (> 0.5 mm)", off > 1000 * measures.OFF_MESH, f"; worst {off.max():.2f} mm")
    off = 1000 * column("off_skin")
    none_of("a contact off the skin (> 2 mm)", off > 1000 * measures.OFF_SKIN, f"; worst {off.max():.1f} mm")
    none_of("giver's hand touched", column("giver_hand") < 0, f"; closest {1000 * column('giver_hand').min():.1f} mm")
    none_of("giver's forearm touched", column("giver_forearm") < 0)
    none_of("own forearm touches object or giver", column("own_forearm") < 0)
    none_of("joint limits broken", column("limits_broken") > 0, f"; worst {column('beyond_limits').max():.1f}°")
    none_of("fingers through fingers or palm", column("self_collision") > 0)
    none_of("forbidden surface within 2 mm", column("forbidden_distance") < measures.FORBIDDEN)
    lines += held(found) + classified(found)
    lines += [Target(*line) for line in taxonomy.targets(found)]
    lines += overstated(found)
    lines += [Target(*line) for line in stance.lines(found) + choice.lines(found)]
    figure = f"median {np.nanmedian(column('comfort')):.4f}, reply off by {np.median(column('comfort_error')):.4f}"
    lines.append(Target("comfort E", "reported", figure, None))
    figure = f"{column('digits_touching').mean():.1f} digits, {column('contacts').mean():.1f} contacts"
    lines.append(Target("touching, mean", "reported", figure, None))
    figure = f"{100 * sound_share(rows):.0f} % of grasps"
    lines.append(Target("without any of these faults", "reported", figure, None))
    return lines


def answered(found, without):
    """How many of the requests that one hand answers are answered in time; `without` more have no answer."""
    n = len(found)
    in_time = sum(row["in_time"] for row in found)
    share = 100 * in_time / n if n else 0.0
    figure = f"{share:.1f} % ({in_time} of {n}; {without} more have none)"
    lines = [Target("answered within 50 ms (search), where there is any", "≥ 99.5 %", figure, share >= 99.5)]
    if n:
        in_time = sum(row["round_trip_in_time"] for row in found)
        median = np.median([row["round_trip_ms"] for row in found])
        figure = f"{100 * in_time / n:.1f} % ({in_time} of {n}); median {median:.1f} ms"
        lines.append(Target("the same by round trip", "≥ 99.5 %", figure, in_time >= 0.995 * n))
    return lines


def within_reach(rows):
    """How many requests on objects for one hand are answered in time; nothing without everyday objects."""
    lines = []
    kinds = [("alone", holdouts.ALONE), ("with a giver who leaves room", holdouts.GIVEN)]
    for (kind, least), (asked, in_time) in zip(kinds, holdouts.shares(rows)):
        if asked:
            share = 100 * in_time / asked
            figure = f"{share:.1f} % ({in_time} of {asked})"
            lines.append(Target(f"everyday objects, {kind}, within 50 ms", f"≥ {least} %", figure, share >= least))
    return lines + held_by_both(rows)


def held_by_both(rows):
    """How many of the requests for both hands are answered with hands that keep hold; nothing without a simulation."""
    asked = [row for row in rows if row.get("both")]
    if not any("survives_gravity" in row for row in asked):
        return []
    held = sum(row.get("survives_gravity", False) for row in asked)
    share, least = 100 * held / len(asked), holdouts.BOTH
    figure = f"{share:.0f} % ({held} of {len(asked)})"
    return [Target("beyond one hand: by both, kept against gravity", f"≥ {least} %", figure, share >= least)]


def sound_share(rows):
    """The share of the found grasps that have no fault."""
    found = [row for row in rows if row["found"]]
    return sum(acceptable(row) for row in found) / len(found)


def held(found):
    """How many grasps survive in the physics engine; nothing without a simulation."""
    found = [row for row in found if "survives_gravity" in row and not row.get("both")]
    if not found:
        return []
    lines = []
    # A hook bears the weight; it need not resist a push from below.
    closed = [row for row in found if not row.get("hangs")]
    for name, measure, least in [
        ("survives_gravity", "survives gravity in simulation", 95),
        ("survives_all", "survives all six pushes, too", 75),
    ]:
        asked = found if name == "survives_gravity" else closed
        if asked:
            count = sum(row[name] for row in asked)
            share = 100 * count / len(asked)
            lines.append(Target(measure, f"≥ {least} %", f"{share:.0f} % ({count} of {len(asked)})", share >= least))
    return lines


def classified(found):
    """How many grasps have a type of the taxonomy, and how many types there are; nothing if no reply has a type."""
    # Types of the taxonomy are those of one hand.
    typed = [row for row in found if "type" in row and not row.get("both")]
    if not typed:
        return []
    named = [row["type"] for row in typed if row["type"] and row["type_confidence"] >= CONFIDENT]
    share, types = 100 * len(named) / len(typed), len(set(named))
    figure = f"{share:.0f} % ({len(named)} of {len(typed)})"
    return [
        Target("classified, confidence at least 0.5", f"≥ {CLASSIFIED} %", figure, share >= CLASSIFIED),
        Target("types seen", f"≥ {TYPES}", str(types), types >= TYPES),
    ]


def overstated(found):
    """How many replies report better margins than the judge measures."""
    lines = []
    for margin, measured, sign, slack in [
        ("epsilon", "epsilon", 1, 0.002),
        ("penetration", "penetration", -1, 0.0005),
        ("giver_clearance", "giver_hand", 1, 0.0005),
    ]:
        reported = f"reported_{margin}"
        both = [(row[reported], row[measured]) for row in found if row.get(reported) is not None]
        if both:
            better = [sign * (a - b) for a, b in both]
            count = sum(value > slack for value in better)
            figure = f"{count} of {len(both)}; by at most {1000 * max(better):.1f} thousandths"
            lines.append(Target(f"{margin} in the reply is too good", "0", figure, count == 0))
    return lines


def acceptable(row):
    """Whether a grasp has no fault: it keeps every bound that applies to single grasps."""
    return bool(
        row["penetration"] <= 0.003
        and not row["force_outside_cone"]
        and row["imbalance"] <= 0.02
        and row["largest_force"] <= measures.STRONGEST + 0.01
        and row["stretched_idle"] == 0
        and not row["wrong_chirality"]
        and row["faces_away"] == row["normal_wrong"] == 0
        and row["off_mesh"] <= measures.OFF_MESH
        and row["off_skin"] <= measures.OFF_SKIN
        and not row["giver_touched"]
        and not row["limits_broken"]
        and not row["self_collision"]
        and row["forbidden_distance"] >= measures.FORBIDDEN
    )


def table(lines):
    """The table, for a terminal."""
    rows = [("", "target", "figure", "met")]
    rows += [(t.measure, t.wanted, t.figure, {True: "yes", False: "NO", None: ""}[t.met]) for t in lines]
    widths = [max(len(row[i]) for row in rows) for i in range(4)]
    return "\n".join("  ".join(cell.ljust(width) for cell, width in zip(row, widths)).rstrip() for row in rows)


def markdown(lines):
    """The table, as Markdown."""
    rows = ["| | target | figure | met |", "|---|---|---|---|"]
    for t in lines:
        rows.append(f"| {t.measure} | {t.wanted} | {t.figure} | {({True: 'yes', False: 'no', None: ''})[t.met]} |")
    return "\n".join(rows)


def write(folder, rows, lines, options, everyday_table="", comparison=""):
    """Writes the report of a run: CSV, Markdown, plots and contact sheet."""
    columns = list(dict.fromkeys(key for row in rows for key in row))
    with open(folder / "grasps.csv", "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, columns)
        writer.writeheader()
        writer.writerows(rows)
    relations.save(folder, lines)
    found = [row for row in rows if row["found"]]
    text = ["# Quality of grasps", ""]
    given = ", ".join(f"{key} {value}" for key, value in options.items() if key not in ("out", "strict") and value)
    text += [f"{len(rows)} holdouts, {len(found)} grasps judged; {given}. Every grasp: [grasps.csv](grasps.csv).", ""]
    text += [markdown(lines), ""]
    if comparison:
        text += ["## Compared", "", comparison, ""]
    if everyday_table:
        text += ["## Everyday objects", "", everyday_table, ""]
    if found:
        text += ["## By object", "", by_object(rows), ""]
        # Sheets of no thickness are not simulated.
        rated = [row for row in found if "survives_gravity" in row] or found
        if "survives_gravity" in rated[0]:
            text += ["## Survival by epsilon", "", relations.survival_by_epsilon(rated), ""]
        text += ["## Who takes it how", "", choice.table(found), ""]
        text += ["## Comfort E against the verdict", "", relations.comfort_and_verdict(rated, acceptable, faults), ""]
        relations.scatter(folder / "comfort.svg", rated, acceptable)
        text += ["![E against epsilon, by verdict](comfort.svg)", ""]
        if any("type" in row for row in found):
            text += ["## Types", "", relations.types(found), ""]
        if judged := taxonomy.tables(found):
            text += [judged, ""]
        plots(folder, found)
        text += ["![Distributions](distributions.svg)", ""]
        if mannequin.sheet(folder, found):
            text += ["## Who stands where", "", mannequin.LEGEND, "", "![Giver and receiver](stance.png)", ""]
        if sheet(folder, found):
            text += ["## Contact sheet", ""]
            text += ["Green: no fault, gravity survived. Red: the faults. On the right: hand and object alone.", ""]
            text += ["![Grasps](sheet.png)", ""]
    (folder / "README.md").write_text("\n".join(text), encoding="utf-8")


def by_object(rows):
    """Markdown table of the main figures by object."""
    simulated = any("survives_gravity" in row for row in rows)
    heads = ["object", "grasps", "within 50 ms", "penetration median / worst, mm", "balanced", "giver clear", "no fault"]
    if simulated:
        heads += ["survives gravity", "single pushes", "all six"]
    lines = [f"| {' | '.join(heads)} |", "|---|" + "--:|" * (len(heads) - 1)]
    for name in dict.fromkeys(row["object"] for row in rows):
        here = [row for row in rows if row["object"] == name]
        found = [row for row in here if row["found"]]
        if not found:
            lines.append(f"| {name} | 0 of {len(here)} |" + " |" * (len(heads) - 2))
            continue
        depth = [1000 * row["penetration"] for row in found]

        def share(test, found=found):
            return f"{100 * sum(map(test, found)) / len(found):.0f} %"

        cells = [name, f"{len(found)} of {len(here)}", share(lambda row: row["in_time"])]
        cells.append(f"{np.median(depth):.1f} / {max(depth):.1f}")
        cells.append(share(lambda row: row["imbalance"] <= 0.02 and not row["force_outside_cone"]))
        cells += [share(lambda row: not row["giver_touched"]), share(acceptable)]
        if "survives_gravity" in found[0]:
            cells.append(share(lambda row: row["survives_gravity"]))
            cells.append(f"{100 * np.mean([row['survives_pushes'] for row in found]) / 6:.0f} %")
            cells.append(share(lambda row: row["survives_all"]))
        cells += [""] * (len(heads) - len(cells))
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def plots(folder, found):
    """Plots the distributions of the main measures, each with its bound."""
    chosen = [
        ("penetration", 1000, "penetration, mm", 3),
        ("imbalance", 100, "weight not balanced, %", 2),
        ("off_skin", 1000, "worst contact off the skin, mm", 2),
        ("giver_hand", 1000, "clearance to the giver's hand, mm", 0),
        ("self_clearance", 1000, "clearance among digits, mm", -1000 * measures.FLESH),
        ("comfort", 1, "comfort E", None),
    ]
    figure, axes = plt.subplots(2, 3, figsize=(11, 5.5), layout="constrained")
    for axis, (name, scale, label, bound) in zip(axes.flat, chosen):
        values = scale * np.array([row[name] for row in found], float)
        values = values[np.isfinite(values)]
        if len(values):
            axis.hist(np.clip(values, *np.percentile(values, [1, 99])), bins=30, color="#4878a8")
        if bound is not None:
            axis.axvline(bound, color="#c03030")
        axis.set_xlabel(label)
        axis.set_ylabel("grasps")
    figure.savefig(folder / "distributions.svg")
    plt.close(figure)


def faults(row):
    """The faults of a grasp, each in a few words."""
    named = [
        (row["penetration"] > 0.003, f"{1000 * row['penetration']:.0f} mm deep"),
        (row["force_outside_cone"], "cone"),
        (row["imbalance"] > 0.02, f"{100 * row['imbalance']:.0f} % unbalanced"),
        (row["stretched_idle"] > 0, f"{row['stretched_idle']} stretched"),
        (row["wrong_chirality"], "chirality"),
        (row["faces_away"] + row["normal_wrong"] > 0, "normal"),
        (row["off_mesh"] > measures.OFF_MESH or row["off_skin"] > measures.OFF_SKIN, "contact off"),
        (row["giver_touched"], "giver or forearm"),
        (row["limits_broken"], "limits"),
        (row["self_collision"], "self"),
        (row["forbidden_distance"] < measures.FORBIDDEN, "forbidden"),
    ]
    return [name for wrong, name in named if wrong]


def fate(row):
    """The fate of a grasp in the physics engine, in a few words; nothing without a simulation."""
    if "survives_gravity" not in row:
        return []
    if not row["survives_gravity"]:
        return [f"{row['fate gravity']} under gravity"]
    return [f"holds {row['survives_pushes']} of 6 pushes"]


def sheet(folder, found, across=3):
    """Puts all pictures of a run on one sheet; false if there are none.

    Each grasp has two views: one with the giver, drawn by the client, and one without, drawn by the judge.
    """
    drawn = [row for row in found if row.get("picture") and (folder / "pictures" / row["picture"]).exists()]
    if not drawn:
        return False
    down = -(-len(drawn) // across)
    figure, axes = plt.subplots(down, across, figsize=(4.6 * across, 2.5 * down), layout="constrained", squeeze=False)
    for axis in axes.flat:
        axis.axis("off")
    for axis, row in zip(axes.flat, drawn):
        file = folder / "pictures" / row["picture"]
        views = [plt.imread(path)[..., :3] for path in (file, file.with_name(f"{file.stem}-alone.png"))]
        height = min(len(view) for view in views)
        axis.imshow(np.concatenate([view[:height] for view in views], axis=1))
        wrong = faults(row)
        dropped = not row.get("survives_gravity", True)
        title = f"{row['object']} {row['holdout']}\n{', '.join((wrong or ['no fault']) + fate(row))}"
        axis.set_title(title, fontsize=7, color="#b02020" if wrong or dropped else "#207020")
    figure.savefig(folder / "sheet.png", dpi=100)
    plt.close(figure)
    return True
