#!/usr/bin/env python3
"""Runs every documented command: those of README.md, CONTRIBUTING.md, results/FORMAT.md and all pages of docs/.

    commands.py --program build/app/ringlock            run every `ringlock` command, check every `tools/` command
    commands.py --program build/app/ringlock --tools    run the quick mode of every tool that has one (many minutes)
    commands.py --list                                  print every command with its place and what is done with it

Commands are found in blocks of code (fenced or indented) and, within prose and tables, in inline code that begins with
`ringlock` or `tools/`. What is done with one follows from its form:

    ringlock closure, tools/build     a name: the program or the folder tools/ must have it
    ringlock run S.toml [-o OUT.h5]   a synopsis, with brackets, alternatives or dots: its options must exist, and those
                                      of docs/commands.md together must have all options; likewise inline code with a
                                      word in capitals, or with nothing but options
    anything else                     is run, in a temporary folder that belongs to the page, in the order of the page

A block that begins with ```sh is a session: all its lines go to one bash with `set -e`. A block ```text behind it shows
its output: its lines must come in the output of the session in that order, where a line `...` leaves out any number of
lines. Words and whole numbers agree exactly, other numbers to one per cent or one unit of the last digit that is shown.

commands.toml, next to this script, says what a page leaves open: the files that its commands read, words in capitals
that stand for a value, settings that make a study short, and commands that cannot be run, with the reason. An entry of
it that no page needs is an error. A new command that is not found there and does not run fails with file and line.
"""
import argparse
import concurrent.futures
import fnmatch
import math
import os
import pathlib
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib

HERE = pathlib.Path(__file__).resolve().parent

FIRST_WORD = re.compile(r"(?:ringlock|build/app/ringlock|mpirun|tools/[\w-]+)(?=\s|$)")
INLINE = re.compile(r"(?<!`)`([^`]+)`(?!`)")
# Lower-case alternatives `a|b`, brackets and dots that a shell would not read as they are meant.
SYNOPSIS = re.compile(r"\[|\.\.\.|[\w\"]\|[\w\"]")
PLACEHOLDER = re.compile(
    r"(?<![\w.$-])(?:[A-Z][A-Z0-9]*)(?:[._-][A-Z0-9]+)*(?:\.(?:toml|h5|csv|svg|txt|html|md))?(?![\w.])")
QUOTED = re.compile(r"('[^']*'|\"[^\"]*\")")
OUTPUT_OPTIONS = {"-o", "--output", "--plot", "--csv", "--psd", "--map"}
NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
NO_ENTRY = "{} has no entry [[tool]] in tests/docs/commands.toml: a quick mode, or why it has none"
REFERENCE = "docs/commands.md"  # the page that lists all options of every command
LANGUAGES_OF_COMMANDS = {"", "sh", "bash", "console", "shell"}


class Command:
    """One command as a page has it, or one session of a page."""

    def __init__(self, page, line, text, inline=False, session=None):
        self.page = page        # path from the root of the repository
        self.line = line        # of its beginning, from 1
        self.text = text
        self.inline = inline
        self.session = session  # None, or the lines of output that the page shows behind the session

    def place(self):
        return f"{self.page}:{self.line}"

    def kind(self):
        if self.session is not None:
            return "session"
        words = self.text.split()
        if words[0].startswith("tools/"):
            return "tool"
        if len(words) == 1 or (self.inline and len(words) == 2 and re.fullmatch(r"[a-z]+", words[1])):
            return "name"
        # What stands in quotes is for the shell to keep.
        open_text = QUOTED.sub("''", self.text)
        if SYNOPSIS.search(open_text):
            return "synopsis"
        if self.inline and (PLACEHOLDER.search(open_text) or all(w.startswith("-") for w in self.arguments())):
            return "synopsis"
        return "run"

    def arguments(self):
        """The words behind `ringlock COMMAND`."""
        words = self.text.split()
        behind = words.index("ringlock") + 2 if "ringlock" in words else 1
        return words[behind:]


def without_comment(text):
    return re.sub(r"\s+#\s.*$", "", text).rstrip()


def blocks_of(lines):
    """Yields (first line, language, lines) of blocks of code; indented ones have the language ''."""
    i = 0
    while i < len(lines):
        fence = re.match(r"(\s*)(```+|~~~+)\s*(\S*)", lines[i])
        if fence:
            end = i + 1
            while end < len(lines) and not lines[end].strip().startswith(fence[2]):
                end += 1
            indent = len(fence[1])
            yield i + 1, fence[3], [line[indent:] if line[:indent].isspace() else line for line in lines[i + 1:end]]
            i = end + 1
        elif lines[i].startswith("    ") and (i == 0 or not lines[i - 1].strip()):
            end = i
            while end < len(lines) and (lines[end].startswith("    ") or not lines[end].strip()):
                end += 1
            yield i, "", [line[4:] for line in lines[i:end]]
            i = end
        else:
            i += 1


def commands_of_block(page, first, lines):
    """Commands of a block without a session, each with its continued lines."""
    i = 0
    while i < len(lines):
        line = lines[i]
        text = line.strip().removeprefix("$ ")
        if not FIRST_WORD.match(text):
            i += 1
            continue
        start = i
        indent = len(line) - len(line.lstrip())
        text = without_comment(text)
        while i + 1 < len(lines):
            following = lines[i + 1]
            deeper = len(following) - len(following.lstrip()) > indent + 4
            if text.endswith("\\"):
                text = text[:-1].rstrip()
            elif not (following.strip() and deeper and not FIRST_WORD.match(following.strip())):
                break
            text += " " + without_comment(following.strip())
            i += 1
        i += 1
        yield Command(page, first + start + 1, text)


def commands_of_page(page, text):
    lines = text.split("\n")
    in_block = set()
    blocks = list(blocks_of(lines))
    for number, (first, language, block) in enumerate(blocks):
        in_block.update(range(first - 1, first + len(block) + 1))
        if language == "sh":
            shown = []
            if number + 1 < len(blocks) and blocks[number + 1][1] == "text":
                shown = blocks[number + 1][2]
            yield Command(page, first + 1, "\n".join(block), session=shown)
        elif language in LANGUAGES_OF_COMMANDS:
            yield from commands_of_block(page, first, block)
    # Prose with the blocks blanked, so that lines keep their numbers and a span may go over the end of a line.
    prose = "\n".join("" if i in in_block else line for i, line in enumerate(lines))
    for span in INLINE.finditer(prose):
        if "\n\n" in span[1]:
            continue
        code = " ".join(span[1].replace("\\|", "|").split())
        if FIRST_WORD.match(code):
            yield Command(page, prose.count("\n", 0, span.start()) + 1, code, inline=True)


def pages(root):
    found = [root / "README.md", root / "CONTRIBUTING.md", root / "results/FORMAT.md"]
    return [p for p in found if p.exists()] + sorted((root / "docs").rglob("*.md"))


def all_commands(root):
    commands = []
    for page in pages(root):
        found = list(commands_of_page(str(page.relative_to(root)), page.read_text(encoding="utf-8")))
        # In the order of the page, so that a command may read what an earlier one has written.
        commands += sorted(found, key=lambda c: c.line)
    return commands


class Manifest:
    """commands.toml; remembers which entries were used."""

    def __init__(self, path):
        with open(path, "rb") as file:
            tables = tomllib.load(file)
        known = {"file", "value", "add", "skip", "tool"}
        if set(tables) - known:
            raise SystemExit(f"{path}: unknown tables {sorted(set(tables) - known)}")
        self.path = path
        self.entries = {kind: tables.get(kind, []) for kind in known}
        self.used = {id(entry): False for entries in self.entries.values() for entry in entries}

    def matches(self, entry, page):
        return fnmatch.fnmatch(page, entry.get("page", "*"))

    def use(self, entry):
        self.used[id(entry)] = True
        return entry

    def skip(self, command):
        for entry in self.entries["skip"]:
            if self.matches(entry, command.page) and re.search(entry["command"], command.text):
                return self.use(entry)["reason"]
        return None

    def value(self, word, page):
        for entry in self.entries["value"]:
            if self.matches(entry, page) and entry["word"] == word:
                return self.use(entry)["is"]
        return None

    def added(self, command):
        """Arguments that shorten a command: those of every entry that matches."""
        words = []
        for entry in self.entries["add"]:
            if self.matches(entry, command.page) and re.search(entry["command"], command.text):
                words.append(self.use(entry)["arguments"])
        return " ".join(words)

    def file(self, name, command):
        for entry in self.entries["file"]:
            if (self.matches(entry, command.page) and any(fnmatch.fnmatch(name, n) for n in entry["names"])
                    and re.search(entry.get("command", ""), command.text)):
                return self.use(entry)
        return None

    def tool(self, name):
        for entry in self.entries["tool"]:
            if entry["name"] == name:
                return self.use(entry)
        return None

    def unused(self, kinds):
        for kind in kinds:
            for entry in self.entries[kind]:
                if not self.used[id(entry)]:
                    yield f"{self.path}: an entry [[{kind}]] that no command needs: {entry}"


class Runner:
    def __init__(self, root, program, manifest, folder):
        self.root = root
        self.manifest = manifest
        self.folder = folder
        self.program = program
        self.bin = folder / "bin"
        self.bin.mkdir()
        (self.bin / "ringlock").symlink_to(program)
        self.environment = dict(os.environ, PATH=f"{self.bin}:{os.environ['PATH']}", HERE=str(HERE), LC_ALL="C.UTF-8",
                                PYTHONDONTWRITEBYTECODE="1")
        self.helps = {}
        self.problems = []

    def bash(self, text, folder):
        return subprocess.run(["bash", "-e", "-o", "pipefail", "-c", text], cwd=folder, env=self.environment,
                              stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, timeout=1800,
                              text=True, errors="replace", check=False)

    def fail(self, command, why, details=""):
        shown = "\n".join("    " + line for line in details.rstrip().split("\n")[-15:]) if details.strip() else ""
        self.problems.append(f"{command.place()}: {command.text.partition(chr(10))[0]}\n  {why}\n{shown}")

    def help(self, subcommand):
        """Text of the help of `ringlock SUBCOMMAND`, '' for the program's; None where there is no such command."""
        if subcommand not in self.helps:
            words = [self.program] + ([subcommand] if subcommand else []) + ["--help"]
            done = subprocess.run(words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
            self.helps[subcommand] = done.stdout if done.returncode == 0 else None
        return self.helps[subcommand]

    def check_name(self, command):
        words = command.text.split()
        if words[0] == "ringlock" and len(words) == 2 and self.help(words[1]) is None:
            self.fail(command, f"the program has no command {words[1]}")

    def check_synopsis(self, command):
        """Its options must be those of the command."""
        if "ringlock" not in command.text.split():  # mpirun with options of its own
            return
        words = command.text[command.text.find("ringlock"):].split()
        subcommand = next((w for w in words[1:2] if re.fullmatch(r"[a-z]+", w)), "")
        text = self.help(subcommand)
        if text is None:
            self.fail(command, f"the program has no command {subcommand}")
            return
        for option in re.findall(r"(?<![\w-])--?[a-z][a-z-]*", command.text[command.text.find("ringlock"):]):
            if not re.search(re.escape(option) + r"(?![\w-])", text):
                self.fail(command, f"ringlock {subcommand} --help does not have the option {option}")

    def check_reference(self, commands):
        """The synopses of the page of all commands together have every option of the help of each."""
        text_of = {}
        for command in commands:
            words = command.text.split()
            if command.page == REFERENCE and command.kind() == "synopsis" and re.fullmatch(r"[a-z]+", words[1]):
                first, text = text_of.get(words[1], (command, ""))
                text_of[words[1]] = (first, text + " " + command.text)
        for subcommand, (first, text) in text_of.items():
            for spellings in re.findall(r"^\s+((?:-\w,)?--[a-z][a-z-]*)", self.help(subcommand) or "", re.MULTILINE):
                names = spellings.split(",")
                if "--help" not in names and not any(re.search(re.escape(n) + r"(?![\w-])", text) for n in names):
                    self.fail(first, f"no synopsis of `ringlock {subcommand}` on this page has the option {names[-1]}")

    def make_file(self, entry, name, folder):
        """Makes an input as the manifest says; '' or what went wrong."""
        target = folder / name
        target.parent.mkdir(parents=True, exist_ok=True)
        if "text" in entry:
            target.write_text(entry["text"], encoding="utf-8")
            return ""
        if "block" in entry:
            text = (self.root / entry["page"]).read_text(encoding="utf-8").split("\n")
            blocks = [lines for _, language, lines in blocks_of(text) if language == entry["block"]]
            if not blocks:
                return f"{entry['page']} has no block ```{entry['block']}"
            target.write_text("\n".join(blocks[0]) + "\n", encoding="utf-8")
            return ""
        done = self.bash(entry["make"].replace("$FILE", shlex.quote(name)), folder)
        if done.returncode or not target.exists():
            return f"could not make {name} by: {entry['make']}\n{done.stdout}{done.stderr}"
        return ""

    def make_inputs(self, command, text, folder):
        try:
            words = shlex.split(text)
        except ValueError as error:
            self.fail(command, f"bash would not read it: {error}")
            return False
        before = ""
        for word in words:
            output = before in OUTPUT_OPTIONS or before.endswith(">")
            before = word
            name = word.partition("=")[2] if word.startswith("--") and "=" in word else word
            name = name.replace("*", "one")  # a pattern of the shell finds this file then
            if output or not name or name.startswith("/") or (folder / name).exists():
                continue
            entry = self.manifest.file(name, command)
            if entry:
                error = self.make_file(entry, name, folder)
                if error:
                    self.fail(command, "its input cannot be made", error)
                    return False
        return True

    def prepared(self, command):
        """The command with its placeholders filled in and made short; None where a placeholder is not known."""
        text = command.text.replace("build/app/ringlock", "ringlock")
        added = self.manifest.added(command)
        parts = QUOTED.split(text)
        unknown = []

        def fill(match):
            value = self.manifest.value(match[0], command.page)
            if value is None:
                unknown.append(match[0])
                return match[0]
            return value

        text = "".join(part if QUOTED.fullmatch(part) else PLACEHOLDER.sub(fill, part) for part in parts)
        if unknown:
            self.fail(command, f"{', '.join(unknown)}: a word in capitals without a value in tests/docs/commands.toml")
            return None
        if added:
            command_part, arrow, target = text.partition(" > ")
            text = f"{command_part} {added}{arrow}{target}"
        return text

    def folder_of(self, page):
        folder = self.folder / page.replace("/", "-")
        if not folder.exists():
            folder.mkdir()
            shutil.copytree(self.root / "scenarios", folder / "scenarios")
            for name in ("results", "docs", "build/app"):
                (folder / name).mkdir(parents=True)
            (folder / "build/app/ringlock").symlink_to(self.program)
        return folder

    def run(self, command):
        text = self.prepared(command)
        if text is None:
            return
        folder = self.folder_of(command.page)
        if not self.make_inputs(command, text, folder):
            return
        done = self.bash(text, folder)
        if done.returncode:
            self.fail(command, f"run as `{text}`: exit status {done.returncode}", done.stdout + done.stderr)

    def run_session(self, command):
        folder = self.folder_of(command.page)
        done = self.bash(command.text, folder)
        if done.returncode:
            self.fail(command, f"the session ends with status {done.returncode}", done.stdout + done.stderr)
            return
        missing = first_missing(command.session, done.stdout)
        if missing:
            self.fail(command, f"its output does not have the line that the page shows:\n    {missing}\n  but:",
                      done.stdout)

    def run_page(self, commands):
        """Runs the commands of one page in their order."""
        seen = set()
        for command in commands:
            kind = command.kind()
            if kind == "name":
                self.check_name(command)
            elif kind == "synopsis":
                self.check_synopsis(command)
            elif kind == "tool":
                check_tool(self, command)
            elif command.text in seen or self.manifest.skip(command) is not None:
                continue
            elif kind == "session":
                self.run_session(command)
            else:
                seen.add(command.text)
                self.run(command)


def agree(shown, printed):
    """Whether a number that a page shows is the one that was printed."""
    if shown == printed:
        return True
    if re.fullmatch(r"[-+]?\d+", shown):
        return False
    last_digit = 10.0 ** -len(re.split(r"[eE]", shown)[0].partition(".")[2])
    exponent = re.split(r"[eE]", shown)[1:]
    if exponent:
        last_digit *= 10.0 ** int(exponent[0])
    a, b = float(shown), float(printed)
    return math.isfinite(b) and abs(a - b) <= max(0.01 * abs(a), 1.001 * last_digit)


def same_line(shown, printed):
    """Whether a line of output is the one of the page: words alike, numbers nearly, blanks of any width."""
    if NUMBER.sub("0", shown).split() != NUMBER.sub("0", printed).split():
        return False
    return all(agree(a, b) for a, b in zip(NUMBER.findall(shown), NUMBER.findall(printed), strict=True))


def first_missing(shown, output):
    """The first line of `shown` that the output does not have in its place, or ''. Blank lines do not count."""
    printed = [line for line in output.split("\n") if line.strip()]
    at = 0
    anywhere = True  # the first line may stand anywhere
    for line in shown:
        if not line.strip():
            continue
        if line.strip() == "...":
            anywhere = True
            continue
        last = len(printed) if anywhere else min(at + 1, len(printed))
        found = next((i for i in range(at, last) if same_line(line, printed[i])), None)
        if found is None:
            return line
        at = found + 1
        anywhere = False
    return ""


def check_tool(runner, command):
    """The tool is there, can be started, and knows the options that the page gives it."""
    words = command.text.split()
    path = runner.root / words[0]
    if not path.is_file():
        runner.fail(command, f"there is no {words[0]}")
        return
    if path.suffix:  # a list or a module
        return
    if runner.manifest.tool(words[0]) is None:
        runner.fail(command, NO_ENTRY.format(words[0]))
    if not os.access(path, os.X_OK):
        runner.fail(command, f"{words[0]} is not executable")
    text = path.read_text(encoding="utf-8")
    if "study_pages" in text:
        text += (runner.root / "tools/study_pages.py").read_text(encoding="utf-8")
    passes_on = '"$@"' in text  # to ctest or cmake, which know more options than this can
    for option in re.findall(r"(?<![\w-])--?[a-z][a-z-]*", " ".join(words[1:])):
        if option not in text and not passes_on:
            runner.fail(command, f"{words[0]} does not have the option {option}")


def run_tools(runner, commands):
    """Runs the quick mode of every documented tool."""
    for name in sorted({c.text.split()[0] for c in commands if c.kind() == "tool"}):
        place = next(c for c in commands if c.kind() == "tool" and c.text.split()[0] == name)
        if (runner.root / name).suffix:
            continue
        entry = runner.manifest.tool(name)
        if entry is None:
            runner.fail(place, NO_ENTRY.format(name))
            continue
        if "quick" not in entry:
            print(f"not run: {name}: {entry['reason']}")
            continue
        start = time.monotonic()
        done = runner.bash(entry["quick"].replace("$PROGRAM", shlex.quote(str(runner.program))), runner.root)
        print(f"{name}: {entry['quick']}: {time.monotonic() - start:.0f} s, status {done.returncode}", flush=True)
        if done.returncode == 77:
            print(done.stdout + done.stderr)
        elif done.returncode:
            runner.fail(place, f"`{entry['quick']}` ends with status {done.returncode}", done.stdout + done.stderr)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--program", type=lambda p: pathlib.Path(p).resolve())
    parser.add_argument("--tools", action="store_true", help="run the quick modes of tools/ instead")
    parser.add_argument("--list", action="store_true", help="print the commands and run nothing")
    parser.add_argument("--page", default="*", help="only these pages (a pattern); unused entries are no error then")
    parser.add_argument("--root", type=pathlib.Path, default=HERE.parents[1], help="the repository")
    parser.add_argument("--manifest", type=pathlib.Path, default=HERE / "commands.toml")
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    manifest = Manifest(options.manifest)
    commands = [c for c in all_commands(options.root) if fnmatch.fnmatch(c.page, options.page)]
    if options.list:
        for command in commands:
            reason = manifest.skip(command) if command.kind() in ("run", "session") else None
            kind = f"not run ({reason})" if reason else command.kind()
            print(f"{command.place()}: {kind}: " + command.text.replace("\n", "; "))
        return 0
    if not options.program:
        parser.error("--program is missing")

    with tempfile.TemporaryDirectory(prefix="ringlock-docs-") as folder:
        runner = Runner(options.root, options.program, manifest, pathlib.Path(folder))
        if options.tools:
            run_tools(runner, commands)
            kinds = ["tool"]
        else:
            by_page = {}
            for command in commands:
                by_page.setdefault(command.page, []).append(command)
            timed = []

            def timed_page(page):
                start = time.monotonic()
                runner.run_page(by_page[page])
                timed.append((time.monotonic() - start, page))

            with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
                for done in [pool.submit(timed_page, page) for page in by_page]:
                    done.result()
            runner.check_reference(commands)
            kinds = ["file", "value", "add", "skip"]
            counts = {}
            for command in commands:
                counts[command.kind()] = counts.get(command.kind(), 0) + 1
            print(", ".join(f"{count} of kind {kind}" for kind, count in sorted(counts.items())))
            for seconds, page in sorted(timed, reverse=True)[:5]:
                print(f"{seconds:6.1f} s  {page}")
        problems = runner.problems
        if options.page == "*":
            problems += manifest.unused(kinds)
    for problem in problems:
        print(problem)
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
