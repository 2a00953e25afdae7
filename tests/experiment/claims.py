"""Statements of chapter 5, against a run."""

import math
from dataclasses import dataclass

import pandas as pd

from run_data import (
    COLUMN_SETS,
    DIGITS,
    FINGERS,
    HOLDOUTS,
    INDEX_YAW,
    KOLMOGOROV_95,
    MEASURES,
    PALM_COM_PALM,
    RATIOS,
    STEPS,
    THESIS_BY_HOLDOUT,
    THESIS_MOST_CONTACTS,
    THESIS_SUFFICIENT,
    distance_from_uniform,
    margin,
    mean_of_means,
    object_of,
    rank_correlation,
    share_by_draw,
    share_in_range,
)

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
