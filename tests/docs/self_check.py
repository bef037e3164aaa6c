#!/usr/bin/env python3
"""Tests of commands.py: what it finds in a page, and that it fails with file and line where a command is wrong.

    self_check.py --program build/app/ringlock
"""
import pathlib
import subprocess
import sys
import tempfile
import unittest

sys.dont_write_bytecode = True
import commands  # noqa: E402

PROGRAM = ""


def found(text):
    return [(c.line, c.kind(), c.text) for c in commands.commands_of_page("page.md", text)]


PAGE = "docs/" "page.md"


class Extraction(unittest.TestCase):
    def test_blocks_fenced_and_indented_with_continued_lines(self):
        self.assertEqual(found("""Text
```
ringlock run a.toml -o a.h5    # a comment
$ ringlock allan log.csv \\
    --rate 1 --kind rate
some output
```

    ringlock analyze OUT.h5 [--json]
                     [-q]
    output
"""), [(3, "run", "ringlock run a.toml -o a.h5"), (4, "run", "ringlock allan log.csv --rate 1 --kind rate"),
       (9, "synopsis", "ringlock analyze OUT.h5 [--json] [-q]")])

    def test_inline_code_within_prose_and_tables_and_over_the_end_of_a_line(self):
        self.assertEqual(found("""`ringlock closure` and `ringlock merge a.h5
--missing` or `tools/test -R x`

| `ringlock allan DATA --kind rate\\|phase` | `ringlock run --print-schema` | `other` |
"""), [(1, "name", "ringlock closure"), (1, "run", "ringlock merge a.h5 --missing"), (2, "tool", "tools/test -R x"),
       (4, "synopsis", "ringlock allan DATA --kind rate|phase"), (4, "synopsis", "ringlock run --print-schema")])

    def test_brackets_in_quotes_are_arguments(self):
        self.assertEqual(found("""    ringlock allan log.npz --column 'gyro[:,0]' --rate 1 "--kind" rate
"""), [(1, "run", "ringlock allan log.npz --column 'gyro[:,0]' --rate 1 \"--kind\" rate")])

    def test_blocks_of_other_languages_hold_no_commands(self):
        self.assertEqual(found("```toml\n# see\nringlock run a.toml\n```\n```cpp\nringlock x;\n```\n"), [])

    def test_a_session_has_the_output_behind_it(self):
        text = "```sh\nls\nringlock x\n```\n\nIt prints\n\n```text\na\n...\nb\n```\n"
        session, = commands.commands_of_page("page.md", text)
        self.assertEqual((session.line, session.text, session.session), (2, "ls\nringlock x", ["a", "...", "b"]))


class Output(unittest.TestCase):
    def missing(self, shown, printed):
        return commands.first_missing(shown.split("\n"), printed)

    def test_numbers_agree_nearly_and_words_exactly(self):
        self.assertEqual(self.missing("N  0.00500 deg", "N 0.005001   deg"), "")
        self.assertEqual(self.missing("3 4.5e-3", "3 4.51e-3"), "")
        self.assertEqual(self.missing("N 0.00500 deg", "N 0.00520 deg"), "N 0.00500 deg")
        self.assertEqual(self.missing("N 5 deg", "N 5 rad"), "N 5 deg")

    def test_lines_come_in_order_and_dots_leave_lines_out(self):
        printed = "head\na\nb\nc\n\nd\n"
        self.assertEqual(self.missing("a\nb", printed), "")
        self.assertEqual(self.missing("a\n...\nd", printed), "")
        self.assertEqual(self.missing("a\nc", printed), "c")
        self.assertEqual(self.missing("b\n...\na", printed), "a")


class Failures(unittest.TestCase):
    """Runs a small repository of pages."""

    def run_on(self, page, manifest="", name=PAGE):
        with tempfile.TemporaryDirectory() as folder:
            root = pathlib.Path(folder)
            (root / "docs").mkdir()
            (root / "scenarios").mkdir()
            (root / "tools").mkdir()
            (root / "README.md").write_text("", encoding="utf-8")
            (root / name).write_text(page, encoding="utf-8")
            (root / "m.toml").write_text(manifest, encoding="utf-8")
            command = [sys.executable, commands.__file__, "--root", root, "--program", PROGRAM]
            done = subprocess.run([*command, "--manifest", root / "m.toml"], stdout=subprocess.PIPE, text=True, check=False)
            return done.returncode, done.stdout

    def expect(self, page, *parts, manifest=""):
        status, output = self.run_on(page, manifest)
        self.assertEqual(status, 1, output)
        for part in parts:
            self.assertIn(part, output)

    def test_what_is_right_passes(self):
        self.assertEqual(self.run_on("`ringlock devices [--json]`\n\n    ringlock devices\n")[0], 0)

    def test_a_command_that_fails(self):
        self.expect("\n    ringlock validate absent.toml\n", PAGE + ":2:", "exit status 2", "absent.toml")

    def test_an_option_and_a_command_that_do_not_exist(self):
        self.expect("`ringlock run S.toml [--sett K=V]`\n", PAGE + ":1:", "does not have the option --sett")
        self.expect("`ringlock rum`\n", PAGE + ":1:", "no command rum")
        self.expect("`tools/absent`\n", PAGE + ":1:", "there is no tools/absent")

    def test_a_word_in_capitals_without_a_value(self):
        self.expect("\n    ringlock validate FILE\n", PAGE + ":2:", "FILE: a word in capitals")

    def test_an_option_that_the_page_of_all_commands_lacks(self):
        with_page = commands.REFERENCE
        status, output = self.run_on("\n    ringlock devices [-x]\n", name=with_page)
        self.assertEqual(status, 1)
        self.assertIn("on this page has the option --json", output)

    def test_output_that_the_session_does_not_have(self):
        self.expect("```sh\necho 3 words\n```\n```text\n4 words\n```\n", PAGE + ":2:", "4 words")

    def test_an_entry_that_nothing_needs(self):
        self.expect("", "no command needs", manifest="[[skip]]\ncommand = 'x'\nreason = 'none'\n")


if __name__ == "__main__":
    PROGRAM = sys.argv[sys.argv.index("--program") + 1]
    unittest.main(argv=[sys.argv[0]])
