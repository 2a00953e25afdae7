"""Tests of the report, on the recorded rows of a tiny run (see tests/golden.rs)."""

import csv
import math
import re
from pathlib import Path

import pandas as pd
import pytest

import claims
import pictures
import report
import run_data

TINY = Path(__file__).parent / "tiny"


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """The report of the tiny run, as text."""
    folder = tmp_path_factory.mktemp("report")
    report.write(run_data.Run(TINY), folder)
    return folder / "README.md"


def rows(page, title):
    """The rows of a table of a page, by column; of columns with the same name the first."""
    lines = page.read_text().split(f"\n**{title}**\n\n")[1].split("\n\n")[0].splitlines()
    header, _, *values = ([cell.strip() for cell in line.strip("|").split("|")] for line in lines)
    return [dict(reversed(list(zip(header, row, strict=True)))) for row in values]


def listed(file):
    with (TINY / file).open() as lines:
        return list(csv.DictReader(lines))


def test_ladder_shows_means_of_the_listed_searches(page):
    searches = listed("searches.csv")
    table = rows(page, "Attempts and time per valid grasp")
    assert [row["set"] for row in table] == [*"ABCDEF", "GUIDED"]
    for row in table:
        for threads, column in [("1", "ms"), ("2", "ms on 2 threads")]:
            own = [search for search in searches if (search["set"], search["threads"]) == (row["set"], threads)]
            assert len(own) == 6
            # All holdouts have equally many grasps, so the mean of the means is the mean.
            mean = sum(int(search["nanoseconds"]) for search in own) / 6e6
            assert float(row[column]) == pytest.approx(mean, rel=0.01)
        mean = sum(int(search["attempts"]) for search in own) / 6
        assert float(row["attempts"].replace(",", "")) == pytest.approx(mean, rel=0.01)


def test_shares_of_output_types_are_those_of_the_listed_attempts(page):
    attempts = listed("attempts.csv")
    for row in rows(page, "Output types of the negative grasp sets, % (and % of all)"):
        own = [a["output_type"] for a in attempts if a["set"] == row["set"] and a["output_type"] != "Valid"]
        assert len(own) == int(row["attempts"]) == 15
        shares = [float(row[kind].split(" ")[0]) for kind in run_data.FAILURES]
        assert shares == [round(100 * own.count(kind) / 15, 1) for kind in run_data.FAILURES]


def test_lost_contacts_are_those_of_the_listed_digits(page):
    table = rows(page, "Contacts lost when the digits of the positive grasp set C close with another bend ratio alone")
    attempts = [a for a in listed("attempts.csv") if a["set"] == "C" and a["output_type"] == "Valid"]
    ratios = ["0.7", "1", "1.42"]
    touching = 0
    for digit in run_data.DIGITS:
        for old, row in enumerate(row for row in table if row["digit"] == digit):
            own = [a[f"{digit}_touches_with"] for a in attempts if a[f"{digit}_bend_ratio"] == ratios[old]]
            assert int(row["touching"]) == len(own)
            touching += len(own)
            for new, ratio in enumerate(["0.7", "1.0", "1.42"]):
                lost = "–" if new == old else str(sum(flags[new] == "n" for flags in own))
                assert row[f"lost on {ratio}"] == lost
    assert touching > 10


def test_page_links_every_picture(page):
    linked = re.findall(r"\]\(([\w-]+\.png)\)", page.read_text())
    assert linked and sorted(linked) == sorted(file.name for file in page.parent.glob("*.png"))
    assert len(linked) == len(pictures.PICTURES)
    assert all((page.parent / file).read_bytes().startswith(b"\x89PNG") for file in linked)


def test_statements_that_hold_by_construction_agree(page):
    said = {row["the thesis"]: row["verdict"] for row in rows(page, "What chapter 5 says, and what this run shows")}
    assert said["NoContacts and NoThumb become NoThumbEarlystop"] == "agrees"
    # With 0.7 tried first, it cannot be the least used ratio.
    assert said["the fingers touch less often with ratio 0.7 than with 1 or 1.42, which are equally good"] == "differs"
    # All but that on NotImmobilizing attempts of set F, of which there are none.
    assert len(said) == 30


def test_figures_and_statements_on_other_sets_are_left_out(tmp_path):
    """A run of set F on one thread without failed attempts has neither figures nor statements on others."""
    for file in ["searches.csv", "attempts.csv"]:
        frame = pd.read_csv(TINY / file)
        kept = frame[frame.set == "F"]
        kept = kept[kept.threads == 1] if "threads" in kept else kept[kept.output_type == "Valid"]
        kept.to_csv(tmp_path / file, index=False)
    (tmp_path / "run.json").write_text((TINY / "run.json").read_text())
    said = report.write(run_data.Run(tmp_path), tmp_path / "report")
    assert {file.stem for file in (tmp_path / "report").glob("*.png")} == {"ladder"}
    assert {claim.where for claim in said} == {"5.5", "6.1, open question"}


def test_printed_figures_of_the_thesis_fit_each_other():
    """Guards against errors in copied figures."""
    for name, by_holdout in run_data.THESIS_BY_HOLDOUT.items():
        for mean, printed in zip((sum(column) / 15 for column in zip(*by_holdout, strict=True)), run_data.THESIS_LADDER[name], strict=True):
            assert abs(mean - printed) <= 1
    all_ratios, one_random = (run_data.COLUMNS[letter][2] for letter in ("(a)", "(c)"))
    assert tuple(a + c for a, c in zip(all_ratios, one_random, strict=True)) == run_data.THESIS_LADDER["E"]
    for digits, totals in [(run_data.DIGITS, [278, 152, 123]), (run_data.FINGERS, [195, 75, 66])]:
        assert [sum(old[new] for digit in digits for old in run_data.THESIS_LOST[digit]) for new in range(3)] == totals


def test_statistics_match_values_by_hand():
    # Two groups with variances 2 and 0: (2/2 + 0/2) summed, root, halved.
    groups = pd.DataFrame({"holdout": ["a", "a", "b", "b"], "x": [1, 3, 5, 5]})
    assert run_data.margin(groups, "x") == pytest.approx(1.96 * 0.5)
    assert run_data.mean_of_means(pd.DataFrame({"holdout": list("aab"), "x": [1, 3, 6]}), "x") == 4
    # Ranks 1 2 3 4 against 2 1 4 3: 1 - 6 Σd² / (n (n² - 1)) = 1 - 24 / 60.
    xs, ys = pd.Series([1.0, 2, 3, 4]), pd.Series([20.0, 1, 400, 30])
    assert run_data.rank_correlation(xs, ys) == pytest.approx(0.6)
    assert math.isnan(run_data.rank_correlation(xs, pd.Series([1.0] * 4)))
    even = pd.Series([(i + 0.5) / 100 for i in range(100)])
    assert run_data.distance_from_uniform(even, 0, 1) < 0.006
    assert run_data.distance_from_uniform(pd.Series([0.0] * 4), 0, 1) == 1
    # Variance 2 within; means 0 and 4 have variance 8, of which 2 / 2 comes from the draws.
    draws = pd.DataFrame(math.nan, index=range(2), columns=["comfort", *(f"comfort_again_{n}" for n in range(run_data.REPEATS))])
    draws[["comfort", "comfort_again_0"]] = [[-1, 1], [3, 5]]
    assert run_data.share_by_draw(draws) == pytest.approx(2 / 9)
    assert run_data.share_in_range(pd.Series([-0.5, 0, 8, 8.5]), run_data.PALM_DISTANCE) == 0.5


@pytest.mark.parametrize(
    "ours, thesis, verdict", [(15, 12, claims.AGREES), (3, 12, claims.IN_PART), (0.9, 2, claims.DIFFERS), (1.1, 0.9, claims.AGREES)]
)
def test_ratios_agree_in_size_or_in_direction(ours, thesis, verdict):
    assert claims.compared(ours, thesis) == verdict


@pytest.mark.parametrize("value, text", [(43_357.2, "43,357"), (41.63, "41.6"), (0.956, "0.956"), (7, "7"), (0.0, "0"), (None, "–")])
def test_numbers_have_three_digits(value, text):
    assert run_data.number(value) == text
