"""Seconds that Python takes for the overlapping Allan deviation at octaves of 10^7 points, one number a line.

Uses allantools where it is installed, else the array expression that allantools evaluates, in NumPy. The first line
says which.
"""
import sys
import time

import numpy as np

n, rounds = int(sys.argv[1]), int(sys.argv[2])
phase = np.cumsum(np.random.default_rng(1).standard_normal(n))
factors = [2**k for k in range(64) if 2 * 2**k < n]

try:
    import allantools

    def deviations():
        return allantools.oadev(phase, rate=1.0, data_type="phase", taus=factors)[1]

    print("allantools", allantools.__version__)
except ImportError:

    def deviations():
        out = []
        for m in factors:
            difference = phase[2 * m :] - 2 * phase[m:-m] + phase[: -2 * m]
            out.append(np.sqrt(np.sum(difference * difference) / (2.0 * len(difference))) / m)
        return out

    print("NumPy", np.__version__)

for _ in range(rounds):
    start = time.perf_counter()
    deviations()
    print(time.perf_counter() - start)
