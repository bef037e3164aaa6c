# %% [markdown]
# # ringlock from Python: a tour
#
# The cells of this script (`# %%`) run in editors that know such cells, and as a whole with `python3`. It simulates a
# few gyros, analyses a series, and lets the closed loop find an error source, all within a minute of one processor.
# [python.md](python.md) describes the functions.

# %%
import numpy as np
import ringlock

print("ringlock", ringlock.__version__)

# %% [markdown]
# ## Simulate an ensemble
#
# A scenario is a path, a dict of keys that differ from the defaults, or a `Scenario`. The keys are those of
# [scenario.md](scenario.md).

# %%
scenario = ringlock.Scenario(
    {
        "ensemble": {"gyros": 8, "duration_s": 120, "seed": 2007},
        "arms.names": ["uncompensated", "noise_injected", "noise_injected+compensated"],
    }
)
result = ringlock.run(scenario)
theory_deg_rt_h = result.theory().arw_deg_rt_h
print(f"theory, turns at random phases: {theory_deg_rt_h:.4g} deg/sqrt(h)")
for name, arm in result.arms().items():
    if arm.arw_deg_rt_h is not None and arm.arw_deg_rt_h.median is not None:
        print(f"{name}: {arm.arw_deg_rt_h.median / theory_deg_rt_h:.4f} of theory")
    else:
        print(f"{name}: no random walk, {arm.arw_reason}")

# Noise that randomises the turns gives the random walk of theory.
assert abs(result["noise_injected"].arw_deg_rt_h.median / theory_deg_rt_h - 1) < 0.05

# %% [markdown]
# Each gyro has its own figures, and its angle at every sample. The arrays are views of the memory of the result.

# %%
arm = result["noise_injected"]
print("rate errors of the gyros [deg/h]:", np.array2string(arm.gyro_rate_error_deg_h, precision=4))
record = result.angle_record("noise_injected")
input_arcsec = scenario["input.rate_deg_h"] * record.time_s
walk_arcsec = record.angle_arcsec - input_arcsec
print("scatter of the angles at the end [arcsec]:", walk_arcsec[:, -1].std().round(3))

# %% [markdown]
# ## Analyse a series
#
# `kind` says what the numbers are, and `unit` makes noise coefficients possible. The deviation is a dict of arrays; the
# coefficients are those of `ringlock allan --json`.

# %%
rate_hz = 100.0
arw_deg_rt_h = 0.01
rng = np.random.default_rng(2)
rates_deg_h = 15 + rng.normal(0, 60 * arw_deg_rt_h * np.sqrt(rate_hz), 100_000)
analysis = ringlock.allan(rates_deg_h, rate_hz=rate_hz, kind="rate", unit="deg/h")
oadev = analysis["deviations"]["oadev"]
for tau_s, dev, lo, hi in list(zip(oadev["tau_s"], oadev["dev"], oadev["lo"], oadev["hi"]))[::4]:
    print(f"{tau_s:8.2f} s  {dev:.4f} deg/h  ({lo:.4f} to {hi:.4f})")
arw = analysis["noise"]["arw_deg_rt_h"]
print(f"angle random walk {arw['value']:.5f} ({arw['lo']:.5f} to {arw['hi']:.5f}) deg/sqrt(h)")
assert abs(arw["value"] / arw_deg_rt_h - 1) < 0.01

# %% [markdown]
# ## Find an error source
#
# The record comes from the simulation here. Records of one's own are files, `ringlock.Record("log.csv")`, or arrays,
# `ringlock.Record.samples(...)` and `ringlock.Record.turns(...)`.

# %%
faulty = ringlock.Scenario(
    {
        "ensemble": {"duration_s": 20, "dither_asymmetry_sd_ratio": 0},
        "effects": {"lockin_turn_asymmetry": {"ratio": 0.2}},
    }
)
closure = ringlock.close(ringlock.simulate_record(faulty))
print(closure["verdict"])
for step in closure["steps"]:
    for name, parameter in step["parameters"].items():
        print(f"{step['effect']}: {name} = {parameter['value']:.3f} +- {parameter['std']:.3f}")
assert [step["effect"] for step in closure["steps"]] == ["lockin_turn_asymmetry"]

# %% [markdown]
# ## Wrong input
#
# Errors are exceptions whose messages name the key, the value and what is allowed.

# %%
try:
    scenario["gyro.lockin_threshold_deg_h"] = -1
except ringlock.InputError as error:
    print(error)
