#!/usr/bin/env python3
"""Writes FILE.npz (arrays `gyro` of two columns and `t`) or FILE.mat (variable `gyro_x`) with 20 s of rates at 200 Hz.

    arrays.py FILE

For the commands of docs/allan.md; by the standard library alone.
"""
import pathlib
import random
import struct
import sys
import zipfile

RATE_HZ = 200.0
ROWS = 4000
numbers = random.Random(2007)
times = [i / RATE_HZ for i in range(ROWS)]
rates = [[numbers.gauss(0.0, 10.0) for _ in range(2)] for _ in range(ROWS)]


def npy(values, shape):
    """A NumPy array of doubles: format version 1, rows first."""
    head = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}".encode()
    head += b" " * (63 - (10 + len(head)) % 64) + b"\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head + struct.pack(f"<{len(values)}d", *values)


def mat_variable(name, values):
    """A column of doubles as an element of a MAT-file of version 5."""
    def element(kind, data):
        return struct.pack("<II", kind, len(data)) + data + b"\0" * (-len(data) % 8)
    body = element(6, struct.pack("<II", 6, 0)) + element(5, struct.pack("<ii", len(values), 1))
    body += element(1, name.encode()) + element(9, struct.pack(f"<{len(values)}d", *values))
    return struct.pack("<II", 14, len(body)) + body


target = pathlib.Path(sys.argv[1])
flat = [value for row in rates for value in row]
if target.suffix == ".npz":
    with zipfile.ZipFile(target, "w") as archive:
        archive.writestr("gyro.npy", npy(flat, (ROWS, 2)))
        archive.writestr("t.npy", npy(times, (ROWS,)))
elif target.suffix == ".mat":
    head = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<H", 0x0100) + b"IM"
    target.write_bytes(head + mat_variable("gyro_x", [row[0] for row in rates]))
else:
    sys.exit(f"{sys.argv[0]}: {target}: .npz or .mat only")
