#!/usr/bin/env python3
"""Compiles the source of the new effect that docs/tutorials/adding-an-effect.md shows.

    effect_compiles.py COMPILER ROOT [FLAG...]
"""
import pathlib
import subprocess
import sys

sys.dont_write_bytecode = True
import commands  # noqa: E402

compiler, root, *flags = sys.argv[1:]
page = pathlib.Path(root) / "docs/tutorials/adding-an-effect.md"
sources = [lines for _, language, lines in commands.blocks_of(page.read_text(encoding="utf-8").split("\n"))
           if language == "cpp" and lines[0].startswith("#include")]
if len(sources) != 1:
    sys.exit(f"{page}: {len(sources)} blocks of C++ that begin with #include, instead of one")
done = subprocess.run([compiler, "-std=c++20", "-Wall", "-Wextra", "-Wconversion", "-Wno-sign-conversion", "-Werror",
                       "-fsyntax-only", "-I", root, *flags, "-x", "c++", "-"],
                      input="\n".join(sources[0]) + "\n", text=True, check=False)
sys.exit(done.returncode)
