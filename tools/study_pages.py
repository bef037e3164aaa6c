"""What the scripts of the pages in docs/studies share: running ringlock, keeping its figures, writing pages.

Every number of a page is computed from the stored figures. Sentences that state an order state it after looking
(holds()): where the figures say something else, the script stops and names the sentence.
"""
import argparse
import json
import math
import pathlib
import subprocess
import sys
import tempfile
import textwrap
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent
PROGRAM = ROOT / "build" / "app" / "ringlock"


class Runs:
    """Runs scenarios with settings in place of what their files say; counts the wall time."""

    def __init__(self, program):
        self.program = program
        self.wall_s = 0.0

    def run(self, scenario, settings=()):
        """The JSON object that `ringlock run` prints."""
        with tempfile.TemporaryDirectory() as folder:
            command = [str(self.program), "run", str(ROOT / "scenarios" / scenario), "-q", "--json", "-o",
                       f"{folder}/out.h5"]
            for setting in settings:
                command += ["--set", setting]
            start = time.monotonic()
            done = subprocess.run(command, capture_output=True, text=True)
            self.wall_s += time.monotonic() - start
        if done.returncode != 0:
            sys.exit(f"{' '.join(command)}\n{done.stderr}")
        return json.loads(done.stdout)


def rounded(value):
    """Six digits are more than the figures carry; null stays null."""
    if isinstance(value, dict):
        return {key: rounded(v) for key, v in value.items()}
    if isinstance(value, list):
        return [rounded(v) for v in value]
    return float(f"{value:.6g}") if isinstance(value, float) else value


def quantiles(arm, figure):
    """[5, 50, 95 %] of a figure over the gyros, each [value, lo, hi] with null for an end that cannot be bounded."""
    return [[q["value"], q["lo"], q["hi"]] for q in arm["quantiles"][figure]]


def holds(sentence, true):
    if not true:
        sys.exit(f"the figures do not say: {sentence}")
    return sentence


def significant(x, digits=3):
    """Digits without an exponent, for numbers of everyday size."""
    if x is None:
        return "none"
    if x == 0.0:
        return "0"
    decimals = max(0, digits - 1 - math.floor(math.log10(abs(x))))
    return f"{x:.{decimals}f}"


def percent(share):
    """"47 (37 .. 57)" of a share with its interval."""
    return f"{100 * share['value']:.0f} ({100 * share['lo']:.0f} .. {100 * share['hi']:.0f})"


def table(header, rows):
    lines = ["| " + " | ".join(header) + " |", "|" + "---|" * len(header)]
    return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in rows]) + "\n"


def filled(text):
    """Paragraphs filled to 120 columns; tables, headings, lists' first words and indented lines as they are."""
    out = []
    for block in text.strip().split("\n\n"):
        if block.startswith(("|", "#", "    ", "![", "<!--")):
            out.append(block)
        elif block.startswith("- "):
            items = ("\n" + block).split("\n- ")[1:]
            out.append("\n".join(textwrap.fill(" ".join(item.split()), 120, initial_indent="- ", subsequent_indent="  ",
                                               break_long_words=False, break_on_hyphens=False) for item in items))
        else:
            out.append(textwrap.fill(" ".join(block.split()), 120, break_long_words=False, break_on_hyphens=False))
    return "\n\n".join(out) + "\n"


def plot(file, size, lines):
    """Draws with gnuplot; the same lines give the same bytes under the same gnuplot."""
    head = [f"set terminal svg size {size} noenhanced font 'sans,12' background '#ffffff'", f"set output '{file}'",
            "set grid lc '#dddddd'"]
    subprocess.run(["gnuplot"], input="\n".join(head + lines) + "\n", text=True, check=True)


def block(name, rows):
    """A gnuplot data block; null and NaN are left out."""
    kept = [row for row in rows if all(x is not None and math.isfinite(x) for x in row)]
    return [f"${name} << EOD", *(" ".join(f"{x:.6g}" for x in row) for row in kept), "EOD"]


def main(name, simulate, page, draw):
    """The command line of a page's script.

    simulate(runs, small) -> figures as JSON has them; page(figures) -> text; draw(figures, file).
    """
    parser = argparse.ArgumentParser(description=f"Writes docs/studies/{name}.md and its figure.")
    way = parser.add_mutually_exclusive_group()
    way.add_argument("--run", action="store_true", help="simulate first and store the figures (needs build/)")
    way.add_argument("--check", action="store_true", help="change nothing; fail where the page is not what they say")
    way.add_argument("--small", metavar="PROGRAM", help="simulate a small version and write its page to the terminal")
    arguments = parser.parse_args()
    stored = ROOT / "results" / "studies" / f"{name}.json"
    text_file = ROOT / "docs" / "studies" / f"{name}.md"
    if arguments.small:
        sys.stdout.write(filled(page(rounded(simulate(Runs(arguments.small), True)))))
        return
    if arguments.run:
        runs = Runs(PROGRAM)
        figures = rounded(simulate(runs, False))
        figures["wall_s"] = round(runs.wall_s)
        stored.write_text(json.dumps(figures, indent=1) + "\n")
    figures = json.loads(stored.read_text())
    text = filled(page(figures))
    if arguments.check:
        if text != text_file.read_text():
            sys.exit(f"{text_file}: not what tools/{name} writes")
        return
    text_file.write_text(text)
    draw(figures, ROOT / "docs" / "figures" / f"{name}.svg")
