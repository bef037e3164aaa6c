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
