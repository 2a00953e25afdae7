"""Compares the figures of two reports."""

import csv
import re

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
