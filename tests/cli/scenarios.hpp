#pragma once

/// Scenarios of some blocks of gyros, which take a second or so.
namespace ringlock::test {

/// Six blocks of gyros, all ways of sharing a trajectory, with angle records.
inline constexpr const char* with_records = R"([ensemble]
gyros = 90
duration_s = 20.0
[arms]
names = ["ideal", "uncompensated", "noise_injected", "noise_injected+compensated"]
)";

/// The same without records.
inline constexpr const char* statistics_only = R"([ensemble]
gyros = 90
duration_s = 20.0
[output]
angle_record = false
)";

/// Gyros whose arms are read, of a noisy drive: outputs of the gyros of a block do not come side by side.
inline constexpr const char* read_by_readers = R"([ensemble]
gyros = 60
duration_s = 3.0
settle_s = 0.5
[noise_injection]
model = "drive"
[reader]
output_hz = 50.0
latch_hz = 250.0
fraction = "detectors"
stripping = "reference+fir"
fir_order = 20
reference_noise_arcsec = 0.05
[output]
sample_interval_s = 0.1
[arms]
names = ["ideal", "uncompensated", "noise_injected+compensated"]
)";

/// Points of unequal cost.
inline constexpr const char* design = R"([ensemble]
gyros = 20
duration_s = 20.0
[output]
angle_record = false
[design]
kind = "list"
[[design.vary]]
key = "dither.frequency_hz"
values = [80.0, 124.0, 400.0]
)";

/// A lot that grows to 64 gyros or so.
inline constexpr const char* growing = R"([ensemble]
duration_s = 30.0
[arms]
names = ["noise_injected"]
[output]
angle_record = false
[stop]
arw_relative = 0.02
most_gyros = 256
)";

}  // namespace ringlock::test
