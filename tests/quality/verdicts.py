"""Targets and tables on types and parts: is the type right, is the handle taken, are blades avoided, is power used."""

import numpy as np

import taxonomy

# Confidence from which a type counts, and the classes of confidence of the calibration table.
CONFIDENT = 0.5
CONFIDENCES = [0.0, 0.5, 0.6, 0.7, 0.8, 1.0]
# Targets in percent: types agreed, with an atlas and on first calls; contacts on handles that the giver leaves;
# contacts on blades and points; heavy things held with the palm or four digits.
AGREED, AGREED_COLD, ON_HANDLE, ON_SHARP, POWER = 85, 75, 80, 2, 90
# Targets in percent for heavy things with handles: kept against gravity, and in all six pushes.
KEPT, KEPT_IN_PUSHES = 95, 75
# Bounds of the classes of mass in kilograms; the first classes of what is heavy, and of what is heavy for a pinch.
MASSES = [0.0, 0.1, 0.5, 1.0, np.inf]
HEAVY, WEIGHTY = 1.0, 0.5


def judged(found):
    """Rows of one hand that have been read."""
    return [row for row in found if "type_agreed" in row]


def is_agreed(row):
    """Whether the reply names an acceptable type, and means it."""
    return bool(row["type_agreed"] and row["type_confidence"] >= CONFIDENT)


def targets(found):
    """The targets with their figures: measure, target, figure, and whether it is met."""
    rows, lines = judged(found), []

    def share(measure, chosen, test, least=None, most=None):
        if chosen:
            count = sum(map(test, chosen))
            percent = 100 * count / len(chosen)
            met = percent >= least if most is None else percent <= most
            wanted = f"≥ {least} %" if most is None else f"≤ {most} %"
            lines.append((measure, wanted, f"{percent:.0f} % ({count} of {len(chosen)})", bool(met)))

    warm, cold = ([row for row in rows if bool(row.get("cold")) == kind] for kind in (False, True))
    share("type agreed, with an atlas", warm, is_agreed, AGREED)
    share("type agreed, without an atlas or on a first call", cold, is_agreed, AGREED_COLD)
    if rows:
        count = sum(row["type_fits_shape"] for row in rows)
        figure = f"{100 * count / len(rows):.0f} % ({count} of {len(rows)})"
        lines.append(("type is shown for parts of that shape", "reported", figure, None))
    share("mostly on the handle, where half of it is free", free_handles(found), takes_handle, ON_HANDLE)
    spared = [row for row in found if row.get("has_sharp") and row["offers_elsewhere"]]
    contacts = sum(row["contacts"] for row in spared)
    if contacts:
        sharp = sum(row["sharp_contacts"] for row in spared)
        figure = f"{100 * sharp / contacts:.1f} % ({sharp} of {contacts} contacts, {len(spared)} grasps)"
        met = sharp <= ON_SHARP / 100 * contacts
        lines.append(("on sharp edges or points, with 6 cm elsewhere", f"≤ {ON_SHARP} %", figure, met))
    heavy = [row for row in found if row.get("mass_kg", 0.0) > HEAVY and "palm_or_four" in row]
    share("above 1 kg: palm or four digits", heavy, lambda row: row["palm_or_four"], POWER)
    handled = [row for row in found if row.get("mass_kg", 0.0) > WEIGHTY and "on_handle" in row]
    handled = [row for row in handled if "survives_gravity" in row]
    share("above 0.5 kg with a handle: kept against gravity", handled, lambda row: row["survives_gravity"], KEPT)
    # Nobody asks a hook to resist a push from below.
    pushed = [row for row in handled if not row.get("hangs")]
    share("above 0.5 kg with a handle: all six pushes", pushed, lambda row: row["survives_all"], KEPT_IN_PUSHES)
    return lines


def free_handles(rows):
    """Rows whose giver leaves more than half of the handle."""
    return [row for row in rows if row.get("handle_free", 0.0) > 0.5]


def takes_handle(row):
    """Whether most of the contacts are on the handle."""
    return row["on_handle"] > 0.5


def tables(found):
    """Markdown of all tables here, each with a heading; empty if nothing has been read."""
    rows = judged(found)
    if not rows:
        return ""
    kinds = [("Types agreed, by confidence", calibration(rows)), ("Types agreed, by type", by_type(rows))]
    kinds += [("Types and handles, by object", by_object(found)), ("Mass and power", mass_and_power(rows))]
    return "\n\n".join(f"## {title}\n\n{text}" for title, text in kinds)


def calibration(rows):
    """Table of the share agreed by the confidence of the reply: of answers given with 0.8, eight in ten should be."""
    lines = ["| confidence | answers | mean confidence | agreed |", "|---|--:|--:|--:|"]
    for low, high in zip(CONFIDENCES, CONFIDENCES[1:]):
        here = [r for r in rows if r["type"] and low <= r["type_confidence"] < high + (high == 1.0)]
        if here:
            mean = np.mean([row["type_confidence"] for row in here])
            agreed = 100 * np.mean([row["type_agreed"] for row in here])
            lines.append(f"| {low:g} to {high:g} | {len(here)} | {mean:.2f} | {agreed:.0f} % |")
    return "\n".join(lines)


def by_type(rows):
    """Table of the types in the replies: how many are agreed, and what the judge says instead."""
    lines = ["| type in the reply | answers | agreed | fits the shape | the judge says, where not agreed |"]
    lines.append("|---|--:|--:|--:|---|")
    for name in sorted({row["type"] for row in rows}, key=lambda name: -sum(row["type"] == name for row in rows)):
        here = [row for row in rows if row["type"] == name]
        others = [row["own_type"] or "none" for row in here if not row["type_agreed"]]
        counted = sorted({(others.count(other), other) for other in others}, reverse=True)[:3]
        said = ", ".join(f"{other.replace('_', ' ')} ({count})" for count, other in counted)
        agreed, fits = (sum(row[key] for row in here) for key in ("type_agreed", "type_fits_shape"))
        shown = name.replace("_", " ") or "*none*"
        lines.append(f"| {shown} | {len(here)} | {agreed} | {fits} | {said} |")
    return "\n".join(lines)


def by_object(found):
    """Table by object: types agreed, handles taken where half of them is free, and contacts on blades and points."""
    lines = ["| object | types agreed | on the handle, where free | contacts on blades and points |"]
    lines.append("|---|--:|--:|--:|")
    for name in dict.fromkeys(row["object"] for row in found):
        here = [row for row in found if row["object"] == name and "palm_or_four" in row]
        rows, free = judged(here), free_handles(here)
        cells = [f"{sum(map(is_agreed, rows))} of {len(rows)}"]
        cells.append(f"{sum(map(takes_handle, free))} of {len(free)}" if free else "")
        blades = [row for row in here if row["has_sharp"]]
        sharp, contacts = (sum(row[key] for row in blades) for key in ("sharp_contacts", "contacts"))
        cells.append(f"{sharp} of {contacts}" if blades else "")
        if rows:
            lines.append(f"| {name} | {' | '.join(cells)} |")
    return "\n".join(lines)


def mass_and_power(rows):
    """Table of the kinds of types, as the judge reads them, by the object's mass."""
    kinds = ["power", "intermediate", "precision"]
    lines = [f"| mass, kg | grasps | {' | '.join(kinds)} | none | palm or four digits |", "|---|" + "--:|" * 6]
    for low, high in zip(MASSES, MASSES[1:]):
        here = [row for row in rows if low <= row["mass_kg"] < high]
        if here:
            named = f"{low:g} to {high:g}" if np.isfinite(high) else f"{low:g} and more"
            kind = [taxonomy.kind_of(row["own_type"]) for row in here]
            cells = [f"{100 * kind.count(k) / len(here):.0f} %" for k in [*kinds, ""]]
            cells.append(f"{100 * np.mean([row['palm_or_four'] for row in here]):.0f} %")
            lines.append(f"| {named} | {len(here)} | {' | '.join(cells)} |")
    lines += [
        "",
        "For comparison, two housekeepers and two machinists at work: 92 % of the objects they grasp have at most 0.5"
        " kg (Feix, Bullock and Dollar 2014, IEEE Transactions on Haptics 7, 311-323). They take large and heavy ones"
        " with power grasps, but those below 2 cm and 20 g with precision grasps in only 61 % (the same, part two).",
    ]
    return "\n".join(lines)
