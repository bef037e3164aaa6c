#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <span>

#include "analysis/record/readers.hpp"
#include "engine/core/units.hpp"

namespace ringlock::record {
namespace {

/// Errors of one kind: the first position, and their number.
struct Tally {
    std::size_t first = 0;
    std::size_t count = 0;

    void note(std::size_t row) {
        if (count++ == 0) first = row;
    }
};

double median(std::vector<double> values) {
    if (values.empty()) return 0.0;
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
}

/// Largest output, in any unit: in squares and sums with larger values other values lose all of their digits.
constexpr double largest_reading = 1e15;

class Checker {
   public:
    explicit Checker(const Record& record) : record_(record) {}

    std::vector<Finding> run() {
        if (!record_.turns && !record_.samples) error("/", "has neither turns nor samples; a record has one of them");
        check_declared();
        if (record_.turns) check_turns(*record_.turns);
        if (record_.samples) check_samples(*record_.samples);
        check_track("/environment", "temperature_c", record_.temperature_c);
        check_track("/reference", "input_rate_deg_h", record_.input_rate_deg_h);
        for (const std::string& name : record_.ignored) {
            warn(name, "has no meaning in a record and is ignored");
        }
        check_gaps();
        return std::move(findings_);
    }

   private:
    void error(std::string where, std::string what) {
        findings_.push_back({std::move(where), std::move(what), Severity::error});
    }
    void warn(std::string where, std::string what) {
        findings_.push_back({std::move(where), std::move(what), Severity::warning});
    }
    static std::string row(const std::string& column, std::size_t number) {
        return fmt::format("{}, row {} (counted from 0)", column, number);
    }
    /// One finding for the tally; `what` gives the text for the first row.
    template <class What>
    void report(Severity severity, const std::string& column, const Tally& tally, const What& what) {
        if (tally.count == 0) return;
        std::string text = what(tally.first);
        if (tally.count > 1) text += fmt::format("; {} such rows", tally.count);
        findings_.push_back({row(column, tally.first), std::move(text), severity});
    }

    bool same_length(const std::string& column, std::size_t length, const std::string& other, std::size_t wanted) {
        if (length == wanted) return true;
        error(column, fmt::format("has {} rows where {} has {}; all columns must be as long", length, other, wanted));
        return false;
    }

    /// True where all values are finite, and none is so large that the others lose their digits in sums with it.
    bool finite(const std::string& column, std::span<const double> values,
                double largest = std::numeric_limits<double>::infinity()) {
        Tally bad;
        Tally huge;
        for (std::size_t i = 0; i < values.size(); ++i) {
            if (!std::isfinite(values[i])) {
                bad.note(i);
            } else if (std::abs(values[i]) > largest) {
                huge.note(i);
            }
        }
        report(Severity::error, column, bad, [&](std::size_t i) {
            return fmt::format(
                "is {}; every value must be a finite number (cut the record there, or fill the gap knowingly)",
                values[i]);
        });
        report(Severity::error, column, huge, [&](std::size_t i) {
            return fmt::format(
                "is {}; no reading can be beyond {:g}, and with it in a sum no other reading counts (look "
                "for the row in the program that wrote the record)",
                values[i], largest);
        });
        return bad.count == 0 && huge.count == 0;
    }

    /// As finite(), of samples, of which some may be missing: NaN. `there`: those that are not.
    bool finite_or_missing(const std::string& column, std::span<const double> values, double largest,
                           std::vector<double>& there) {
        Tally missing;
        std::size_t stretches = 0;
        for (std::size_t i = 0; i < values.size(); ++i) {
            if (!std::isnan(values[i])) {
                there.push_back(values[i]);
                continue;
            }
            if (i == 0 || !std::isnan(values[i - 1])) ++stretches;
            missing.note(i);
        }
        if (missing.count > 0) {
            const bool too_many = 2 * missing.count > values.size();
            findings_.push_back(
                {row(column, missing.first),
                 fmt::format("{} of {} samples are missing (NaN), in {} {}, of which this is the first{}",
                             missing.count, values.size(), stretches, stretches == 1 ? "stretch" : "stretches",
                             too_many ? "; a record must have at least half of them: cut it where they are" : ""),
                 too_many ? Severity::error : Severity::warning});
            if (too_many) return false;
        }
        std::vector<double> finite_values(values.begin(), values.end());
        for (double& value : finite_values) value = std::isnan(value) ? 0.0 : value;
        return finite(column, finite_values, largest);
    }

    /// Where a text leaves samples out, by its lines.
    void check_gaps() {
        constexpr std::size_t most = 20;
        const std::string column = record_.samples ? name_of(record_.samples->kind) : "";
        for (std::size_t i = 0; i < record_.gaps.size() && i < most; ++i) {
            const Gap& gap = record_.gaps[i];
            warn(fmt::format("/samples/{}, line {}", column, gap.line),
                 fmt::format("{} {} missing between {} and {} (rows {} to {}, counted from 0)", gap.samples,
                             gap.samples == 1 ? "sample is" : "samples are", gap.from, gap.to, gap.first,
                             gap.first + gap.samples - 1));
        }
        if (record_.gaps.size() > most) {
            warn(fmt::format("/samples/{}", column), fmt::format("has {} such gaps in all", record_.gaps.size()));
        }
    }

    bool in_order(const std::string& column, std::span<const double> time_s) {
        Tally bad;
        for (std::size_t i = 1; i < time_s.size(); ++i) {
            if (!(time_s[i] > time_s[i - 1])) bad.note(i);
        }
        report(Severity::error, column, bad, [&](std::size_t i) {
            return fmt::format("is {} s after {} s; times must increase from row to row", time_s[i], time_s[i - 1]);
        });
        return bad.count == 0;
    }

    void check_declared() {
        const Declared& d = record_.declared;
        const auto must = [&](const char* name, const std::optional<double>& value, bool zero_too, bool negative_too) {
            if (!value) return;
            const bool right = std::isfinite(*value) && (negative_too || *value > 0.0 || (zero_too && *value == 0.0));
            if (right) return;
            error(fmt::format("/declared, attribute {}", name),
                  fmt::format("is {}; must be a {} number (or leave it out)", *value,
                              negative_too ? "finite"
                              : zero_too   ? "finite, not negative"
                                           : "finite, positive"));
        };
        must("scale_factor_arcsec", d.scale_factor_arcsec, false, false);
        must("lockin_threshold_deg_h", d.lockin_threshold_deg_h, true, false);
        must("dither_frequency_hz", d.dither_frequency_hz, false, false);
        must("dither_peak_rate_deg_s", d.dither_peak_rate_deg_s, true, false);
        must("bias_deg_h", d.bias_deg_h, true, true);
        must("clock_hz", d.clock_hz, true, false);
        must("readout_noise_rad", d.readout_noise_rad, true, false);
        must("input_rate_deg_h", d.input_rate_deg_h, true, true);
    }

    void check_turns(const Turns& t) {
        const std::size_t n = t.size();
        if (n == 0) {
            error("/turns", "has no rows");
            return;
        }
        const std::string time = "/turns/time_s";
        bool lengths = same_length("/turns/direction", t.direction.size(), time, n);
        lengths = same_length("/turns/quarter_count", t.quarter_count.size(), time, n) && lengths;
        lengths = same_length("/turns/sin", t.sine.size(), time, n) && lengths;
        lengths = same_length("/turns/cos", t.cosine.size(), time, n) && lengths;
        lengths = same_length("/turns/accel_before_rad_s2", t.accel_before_rad_s2.size(), time, n) && lengths;
        lengths = same_length("/turns/accel_after_rad_s2", t.accel_after_rad_s2.size(), time, n) && lengths;

        const bool times_finite = finite(time, t.time_s);
        const bool ordered = times_finite && in_order(time, t.time_s);
        const bool detectors =
            finite("/turns/sin", t.sine, largest_reading) & finite("/turns/cos", t.cosine, largest_reading);
        check_acceleration("/turns/accel_before_rad_s2", t.accel_before_rad_s2);
        check_acceleration("/turns/accel_after_rad_s2", t.accel_after_rad_s2);
        const bool alternate = check_directions(t.direction);
        if (detectors && t.sine.size() == t.cosine.size()) check_radius(t);
        if (!lengths || !alternate) return;
        if (ordered) check_half_periods(t);
        const bool steady = check_swings(t);
        if (detectors && steady) compare_counts(t);
    }

    void check_acceleration(const std::string& column, std::span<const double> values) {
        if (!finite(column, values)) return;
        Tally bad;
        for (std::size_t i = 0; i < values.size(); ++i) {
            if (values[i] < 0.0) bad.note(i);
        }
        report(Severity::error, column, bad, [&](std::size_t i) {
            return fmt::format("is {}; must be a magnitude, or 0 where none was seen", values[i]);
        });
    }

    bool check_directions(std::span<const std::int8_t> direction) {
        Tally wrong;
        Tally repeated;
        for (std::size_t i = 0; i < direction.size(); ++i) {
            if (direction[i] != 1 && direction[i] != -1) {
                wrong.note(i);
            } else if (i > 0 && direction[i] == direction[i - 1]) {
                repeated.note(i);
            }
        }
        report(Severity::error, "/turns/direction", wrong, [&](std::size_t i) {
            return fmt::format("is {}; must be +1 at a phase minimum, -1 at a maximum", direction[i]);
        });
        report(Severity::error, "/turns/direction", repeated, [&](std::size_t i) {
            return fmt::format(
                "is {:+} as the row before; minima and maxima must alternate (a row is missing or stands twice; "
                "cut the record there)",
                direction[i]);
        });
        return wrong.count == 0 && repeated.count == 0;
    }

    void check_radius(const Turns& t) {
        std::vector<double> radii(t.sine.size());
        for (std::size_t i = 0; i < radii.size(); ++i) radii[i] = std::hypot(t.sine[i], t.cosine[i]);
        constexpr double least = 1e-6;  // of the usual radius; detectors are a few thousandths wrong at best
        const double usual = median(radii);
        Tally dark;
        for (std::size_t i = 0; i < radii.size(); ++i) {
            if (radii[i] <= least * usual || !std::isfinite(radii[i])) dark.note(i);
        }
        report(Severity::error, "/turns/sin and cos", dark, [&](std::size_t i) {
            return fmt::format("are {} and {}: no phase can be read from a circle of radius {}", t.sine[i], t.cosine[i],
                               radii[i]);
        });
        constexpr std::size_t enough = 4;
        const auto constant = [](std::span<const double> values) {
            return std::all_of(values.begin(), values.end(), [&](double v) { return v == values.front(); });
        };
        if (radii.size() >= enough && constant(t.sine) && constant(t.cosine)) {
            warn("/turns/sin and cos", fmt::format("are {} and {} in every row; are the detectors connected?",
                                                   t.sine.front(), t.cosine.front()));
        }
    }

    /// Half cycles of one sign last alike: the drive has one frequency.
    void check_half_periods(const Turns& t) {
        constexpr double longest = 1.75;  // of the usual one; a missing pair of rows makes it 3
        constexpr double shortest = 0.25;
        constexpr std::size_t enough = 8;
        if (t.size() < enough) return;
        std::array<std::vector<double>, 2> halves;
        for (std::size_t i = 1; i < t.size(); ++i) halves[i % 2].push_back(t.time_s[i] - t.time_s[i - 1]);
        const std::array<double, 2> usual = {median(halves[0]), median(halves[1])};
        Tally bad;
        for (std::size_t i = 1; i < t.size(); ++i) {
            const double ratio = (t.time_s[i] - t.time_s[i - 1]) / usual[i % 2];
            if (!(ratio >= shortest && ratio <= longest)) bad.note(i);
        }
        report(Severity::error, "/turns/time_s", bad, [&](std::size_t i) {
            return fmt::format(
                "is {:.6g} s after the row before, where half cycles of that sign usually last {:.6g} s; "
                "rows must be consecutive turns (cut the record where some are missing)",
                t.time_s[i] - t.time_s[i - 1], usual[i % 2]);
        });
        if (!record_.declared.dither_frequency_hz) return;
        const double measured = 1.0 / (usual[0] + usual[1]);
        const double declared = *record_.declared.dither_frequency_hz;
        if (declared > 0.0 && std::abs(std::log2(measured / declared)) > 0.5) {
            warn("/declared, attribute dither_frequency_hz",
                 fmt::format("is {:g} Hz where the turns come at {:.6g} Hz", declared, measured));
        }
    }

    /// Counts gained in the half cycles: alike from half cycle to half cycle of one sign but for noise, drift and
    /// counts that were missed. False where they make no sense.
    bool check_swings(const Turns& t) {
        constexpr std::size_t enough = 9;
        if (t.size() < enough) return true;
        std::vector<double> swing(t.size() - 1);  // upright
        Tally huge;
        std::size_t falling = 0;
        for (std::size_t i = 1; i < t.size(); ++i) {
            const double gain = static_cast<double>(t.quarter_count[i]) - static_cast<double>(t.quarter_count[i - 1]);
            swing[i - 1] = t.direction[i - 1] * gain;
            if (swing[i - 1] < 0.0) ++falling;
            if (std::abs(gain) > 1e15) huge.note(i);
        }
        report(Severity::error, "/turns/quarter_count", huge, [&](std::size_t i) {
            return fmt::format("is {} after {}; no counter gains as much in half a cycle", t.quarter_count[i],
                               t.quarter_count[i - 1]);
        });
        if (huge.count > 0) return false;
        if (10 * falling > 9 * swing.size()) {
            error("/turns/quarter_count",
                  "falls after minima and rises after maxima; direction or count has the wrong sign");
            return false;
        }
        // The expected swing of each half cycle is the median over half cycles of the same sign on either side, so that
        // steady rates, drifting amplitudes and steps of the rate are no jumps.
        constexpr std::ptrdiff_t reach = 4;
        std::vector<double> off(swing.size());
        for (std::size_t i = 0; i < swing.size(); ++i) {
            std::array<double, 2 * reach + 1> near{};
            std::size_t found = 0;
            for (std::ptrdiff_t k = -reach; k <= reach; ++k) {
                const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(i) + 2 * k;
                if (at >= 0 && at < static_cast<std::ptrdiff_t>(swing.size())) {
                    near[found++] = swing[static_cast<std::size_t>(at)];
                }
            }
            std::nth_element(near.begin(), near.begin() + found / 2, near.begin() + found);
            off[i] = std::abs(swing[i] - near[found / 2]);
        }
        // 30 standard deviations of the usual deviation: noise does not reach that, and a few missed counts are no
        // jump.
        constexpr double deviations = 30.0;
        constexpr double normal = 1.4826;  // standard deviation of a normal distribution over its median size
        constexpr double least = 32.0;     // quarter fringes
        const double usual = normal * median(off);
        const double most = std::max(least, deviations * usual);
        Tally jumps;
        for (std::size_t i = 0; i < off.size(); ++i) {
            if (off[i] > most) jumps.note(i + 1);
        }
        report(Severity::error, "/turns/quarter_count", jumps, [&](std::size_t i) {
            return fmt::format(
                "jumps: {} counts since the row before, {:.0f} off the half cycles around it, "
                "which differ by {:.3g} rms among themselves; cut the record there",
                t.quarter_count[i] - t.quarter_count[i - 1], off[i - 1], usual);
        });
        return jumps.count == 0;
    }

    /// Whether count and detectors keep naming the same quarter fringe. Where they do not, counts were missed, or the
    /// detectors' curve is no circle: an effect to be found, and no error of the record.
    void compare_counts(const Turns& t) {
        const std::size_t n = t.size();
        std::array<std::size_t, 4> shifts{};
        std::vector<double> apart(n);  // quadrature less the middle of the counted quarter, in quarters of [0, 4)
        for (std::size_t i = 0; i < n; ++i) {
            const double quarters = std::atan2(t.sine[i], t.cosine[i]) * 4.0 / units::two_pi;
            const auto counted = static_cast<double>(((t.quarter_count[i] % 4) + 4) % 4);
            const double difference = quarters - counted - 0.5;
            apart[i] = difference - 4.0 * std::floor(difference / 4.0);
            ++shifts[static_cast<std::size_t>(std::floor(apart[i] + 0.5)) % 4];
        }
        const auto likeliest = static_cast<double>(std::max_element(shifts.begin(), shifts.end()) - shifts.begin());
        constexpr double tolerance = 0.75;  // half a quarter, and as much again for noise at its ends
        Tally other;
        for (std::size_t i = 0; i < n; ++i) {
            const double off = std::remainder(apart[i] - likeliest, 4.0);
            if (std::abs(off) > tolerance) other.note(i);
        }
        const double share = static_cast<double>(other.count) / static_cast<double>(n);
        if (share <= 0.03) return;
        if (runs_backwards(t)) {
            error("/turns/sin",
                  "turns the other way than quarter_count, in all quadrants: sin and cos are swapped, "
                  "or one of them or the count has the wrong sign; write sin = sin psi, cos = cos psi, "
                  "quarter_count = floor(psi/(pi/2)) of the same phase psi");
            return;
        }
        if (const double times = acceleration_over_swing(t); std::abs(std::log(times)) > std::log(2.0)) {
            error("/turns/quarter_count",
                  fmt::format("swings by so little or so much that accelerations are {:.3g} times those "
                              "of such a swing, and names other quarter fringes than the detectors: "
                              "it must count quarter fringes, four to a fringe",
                              times));
            return;
        }
        warn(row("/turns/quarter_count", other.first),
             fmt::format("names another quarter fringe than the detectors, here and at {:.3g} % "
                         "of the turns (counts may have been missed)",
                         100.0 * share));
    }

    /// Whether quadrants of the detectors go down where the count goes up: sums of both stay, differences do not.
    static bool runs_backwards(const Turns& t) {
        constexpr double nearly_all = 0.9;
        constexpr double far_from_all = 0.7;
        std::array<std::size_t, 4> sums{};
        std::array<std::size_t, 4> differences{};
        for (std::size_t i = 0; i < t.size(); ++i) {
            const double quarters = std::atan2(t.sine[i], t.cosine[i]) * 4.0 / units::two_pi;
            const auto quadrant = static_cast<std::int64_t>(std::floor(quarters)) + 4;
            const std::int64_t counted = (t.quarter_count[i] % 4 + 4) % 4;
            ++sums[static_cast<std::size_t>((quadrant + counted) % 4)];
            ++differences[static_cast<std::size_t>((quadrant - counted + 4) % 4)];
        }
        const auto most = [&](const std::array<std::size_t, 4>& of) {
            return static_cast<double>(*std::max_element(of.begin(), of.end())) / static_cast<double>(t.size());
        };
        return most(sums) > nearly_all && most(differences) < far_from_all;
    }

    /// Mean acceleration over that of a dither with the counted swing; 1 where the record has no accelerations.
    static double acceleration_over_swing(const Turns& t) {
        const std::size_t n = t.size();
        const double w = 0.5 * units::two_pi * static_cast<double>(n - 1) / (t.time_s.back() - t.time_s.front());
        double counts = 0.0;
        std::vector<double> seen;
        for (std::size_t i = 0; i < n; ++i) {
            if (t.accel_before_rad_s2[i] > 0.0) seen.push_back(t.accel_before_rad_s2[i]);
            if (i > 0) counts += std::abs(static_cast<double>(t.quarter_count[i] - t.quarter_count[i - 1]));
        }
        if (seen.size() < n / 4 || !(counts > 0.0)) return 1.0;
        const auto middle = seen.begin() + static_cast<std::ptrdiff_t>(seen.size() / 2);
        std::nth_element(seen.begin(), middle, seen.end());
        const double amplitude_rad = 0.5 * counts / static_cast<double>(n - 1) * 0.25 * units::two_pi;
        return *middle / (amplitude_rad * w * w);
    }

    void check_samples(const Samples& s) {
        if (!(s.rate_hz > 0.0) || !std::isfinite(s.rate_hz)) {
            error("/samples, attribute rate_hz",
                  fmt::format("is {}; must be a positive number of samples a second", s.rate_hz));
        }
        if (!std::isfinite(s.t0_s)) error("/samples, attribute t0_s", fmt::format("is {}; must be finite", s.t0_s));
        const std::string column = fmt::format("/samples/{}", name_of(s.kind));
        const bool counted = s.kind == SampleKind::quarter_count;
        if (counted ? !s.values.empty() : !s.counts.empty()) {
            error("/samples", fmt::format("has {} in addition to {}; must have one of them",
                                          counted ? "angles" : "counts", name_of(s.kind)));
        }
        const std::size_t n = s.size();
        if (n == 0) error(column, "has no rows");
        std::vector<double> there;
        const bool all_finite = counted || finite_or_missing(column, s.values, largest_reading, there);
        for (const auto& [name, values] : s.witnesses) {
            const std::string witness = fmt::format("/samples/{}", name);
            same_length(witness, values.size(), column, n);
            std::vector<double> ignored;
            finite_or_missing(witness, values, std::numeric_limits<double>::infinity(), ignored);
            const bool known = std::any_of(witness_names.begin(), witness_names.end(),
                                           [&, &called = name](const char* one) { return called == one; });
            if (!known) warn(witness, "is not a witness of a record and is ignored");
        }
        if (!all_finite || n == 0) return;
        constexpr std::size_t enough = 3;
        const bool stuck =
            counted ? std::all_of(s.counts.begin(), s.counts.end(), [&](auto v) { return v == s.counts.front(); })
                    : std::all_of(there.begin(), there.end(), [&](auto v) { return v == there.front(); });
        if (stuck && n >= enough) {
            warn(column, fmt::format("is {} in every row; did the gyro run?",
                                     counted ? static_cast<double>(s.counts.front()) : there.front()));
            return;
        }
        check_steps(s, column);
    }

    /// Increments far off all others.
    void check_steps(const Samples& s, const std::string& column) {
        const std::size_t n = s.size();
        constexpr std::size_t enough = 16;
        if (n < enough) return;
        std::vector<double> gain;
        gain.reserve(n);
        const bool increments = s.kind == SampleKind::angle_increment_arcsec;
        if (increments) gain = s.values;
        for (std::size_t i = 1; i < n && !increments; ++i) {
            gain.push_back(s.kind == SampleKind::quarter_count
                               ? static_cast<double>(s.counts[i]) - static_cast<double>(s.counts[i - 1])
                               : s.values[i] - s.values[i - 1]);
        }
        // The gain next to a missing sample is NaN.
        const auto there = [](std::vector<double> values) {
            std::erase_if(values, [](double value) { return std::isnan(value); });
            return values;
        };
        const double middle = median(there(gain));
        std::vector<double> off(gain.size());
        for (std::size_t i = 0; i < gain.size(); ++i) off[i] = std::abs(gain[i] - middle);
        const double usual = median(there(off));
        if (!(usual > 0.0) || !std::isfinite(usual)) return;
        constexpr double far = 1000.0;
        Tally jumps;
        for (std::size_t i = 0; i < off.size(); ++i) {
            if (off[i] > far * usual) jumps.note(increments ? i : i + 1);
        }
        report(Severity::warning, column, jumps, [&](std::size_t i) {
            return fmt::format("gains {:.6g} where samples usually gain {:.6g} +- {:.3g}; is it a glitch?",
                               gain[increments ? i : i - 1], middle, usual);
        });
    }

    void check_track(const std::string& group, const std::string& name, const Track& track) {
        const std::string time = group + "/time_s";
        const std::string column = fmt::format("{}/{}", group, name);
        if (track.time_s.empty() && track.value.empty()) return;
        const bool same = same_length(column, track.value.size(), time, track.time_s.size());
        const bool times = finite(time, track.time_s);
        finite(column, track.value);
        if (!times || !in_order(time, track.time_s) || !same) return;
        const auto covers = [&](double first_s, double last_s, const char* what) {
            const double duration = last_s - first_s;
            constexpr double slack = 0.01;
            const double early = std::max(0.0, track.time_s.front() - first_s);
            const double late = std::max(0.0, last_s - track.time_s.back());
            if (!(duration > 0.0) || !std::isfinite(duration) || early + late <= slack * duration) return;
            warn(time, fmt::format("goes from {:.6g} to {:.6g} s, {} from {:.6g} to {:.6g} s; "
                                   "beyond its ends the values at the ends are used",
                                   track.time_s.front(), track.time_s.back(), what, first_s, last_s));
        };
        if (record_.turns && !record_.turns->time_s.empty()) {
            covers(record_.turns->time_s.front(), record_.turns->time_s.back(), "the turns");
        }
        if (record_.samples && record_.samples->size() > 0 && record_.samples->rate_hz > 0.0) {
            const double length = static_cast<double>(record_.samples->size() - 1) / record_.samples->rate_hz;
            covers(record_.samples->t0_s, record_.samples->t0_s + length, "the samples");
        }
    }

    const Record& record_;
    std::vector<Finding> findings_;
};

}  // namespace

std::vector<Finding> check(const Record& record) { return Checker(record).run(); }

}  // namespace ringlock::record
