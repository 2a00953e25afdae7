"""The rows of a run, statistics of them, and the figures that the thesis has."""

import json
import math

import pandas as pd

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


def object_of(holdout):
    return holdout.split("-")[0]
