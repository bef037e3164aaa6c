#!/usr/bin/env python3
"""Writes a log of noise for the commands that pages show: one column for each name, a header, CSV on standard output.

    logs.py --rate HZ --seconds S --noise SD [--sum] [--stamps s|ms|ros] [--declare-rate] [--record] NAME...

Values are normal with that standard deviation, or with --sum their running sum. --stamps adds columns of time in front.
--declare-rate adds the comment `# rate_hz`, --record writes the text form of a record (docs/record.md).
"""
import argparse
import random

parser = argparse.ArgumentParser()
parser.add_argument("--rate", type=float, required=True)
parser.add_argument("--seconds", type=float, required=True)
parser.add_argument("--noise", type=float, required=True)
parser.add_argument("--sum", action="store_true")
parser.add_argument("--stamps", choices=["s", "ms", "ros"])
parser.add_argument("--declare-rate", action="store_true")
parser.add_argument("--record", action="store_true")
parser.add_argument("names", nargs="+")
options = parser.parse_args()

names = list(options.names)
if options.record:
    names = ["angle_increment_arcsec"]
if options.record or options.declare_rate:
    print(f"# rate_hz = {options.rate:g}")
stamps = {"s": ["t"], "ms": ["t"], "ros": ["header.stamp.secs", "header.stamp.nsecs"]}.get(options.stamps, [])
print(",".join(stamps + names))
numbers = random.Random(2007)
totals = [0.0] * len(names)
for i in range(round(options.rate * options.seconds)):
    row = []
    if options.stamps == "s":
        row = [f"{i / options.rate:.6f}"]
    elif options.stamps == "ms":
        row = [f"{1000.0 * i / options.rate:.3f}"]
    elif options.stamps == "ros":
        nanoseconds = 1_403_636_579_000_000_000 + round(1e9 * i / options.rate)
        row = [str(nanoseconds // 10**9), str(nanoseconds % 10**9)]
    for k in range(len(names)):
        value = numbers.gauss(0.0, options.noise)
        totals[k] += value
        row.append(f"{totals[k] if options.sum else value:.9g}")
    print(",".join(row))
