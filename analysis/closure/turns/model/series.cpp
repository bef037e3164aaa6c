#include "analysis/closure/turns/model/series.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "analysis/closure/options.hpp"
#include "analysis/closure/stats/count_chain.hpp"
#include "engine/core/error.hpp"
#include "engine/core/units.hpp"
#include "engine/gyro/device.hpp"

namespace ringlock::closure {

namespace {

double median(std::vector<double> values) {
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
}

/// Whole quarters, modulo four, of most of the differences: the counter's zero.
std::int64_t most_frequent_quarter(const std::vector<double>& quarters, std::size_t count) {
    int votes[4] = {};
    for (std::size_t i = 0; i < count; ++i) ++votes[std::llround(quarters[i]) & 3];
    return std::max_element(votes, votes + 4) - votes;
}

bool all_phases_come(const std::vector<double>& phase_rad, const std::vector<int>& direction) {
    constexpr std::size_t bins = options.turns.reading.phase_bins;
    double counts[2][bins] = {};
    for (std::size_t i = 0; i < phase_rad.size(); ++i) {
        const double fringes = phase_rad[i] / units::two_pi;
        const auto bin = static_cast<std::size_t>((fringes - std::floor(fringes)) * static_cast<double>(bins)) % bins;
        counts[direction[i] > 0 ? 0 : 1][bin] += 1.0;
    }
    const double least = options.turns.reading.least_share_of_even * 0.5 * static_cast<double>(phase_rad.size()) /
                         static_cast<double>(bins);
    for (const auto& of : counts) {
        for (const double count : of) {
            if (count < least) return false;
        }
    }
    return true;
}

/// Quarters that the counter has lost, turn by turn; nearly zero at the first turn.
std::vector<std::int64_t> lost_quarters(const CountedQuarters& counted) {
    const TurnOptions::Reading& of = options.turns.reading;
    const std::size_t n = counted.off.size();
    std::vector<std::int64_t> lost(n);
    std::int64_t now = most_frequent_quarter(counted.off, std::min(n, of.turns_for_zero));
    if (now > 2) now -= 4;
    std::size_t changes = 0;
    for (std::size_t i = 0; i < n; ++i) {
        const double margin = 0.5 + std::min(of.edge_margin + of.noise_margin_sd * counted.sd[i], of.most_margin);
        double rest = counted.off[i] - static_cast<double>(now);
        rest -= 4.0 * std::round(0.25 * rest);
        if (std::abs(rest) > margin) {
            now += std::llround(rest);
            ++changes;
        }
        lost[i] = now;
    }
    if (changes == 0) return lost;
    // Some miscounts are hidden near the edges of quarters, and where many are lost, two at once or four are. The most
    // probable path of all turns includes these.
    const double p = std::min(of.most_miscounts_per_turn, static_cast<double>(changes) / static_cast<double>(n));
    double likeliest = -std::numeric_limits<double>::infinity();
    for (const double edge : options.stats.count_chain.edge_sds) {
        CountChain chain(counted, edge);
        const double log_likelihood = chain.log_likelihood(p);
        if (!(log_likelihood > likeliest)) continue;
        likeliest = log_likelihood;
        lost = chain.likeliest_path(p);
    }
    const std::int64_t whole = lost.front() > 2 ? 4 : 0;
    for (std::int64_t& quarters : lost) quarters -= whole;
    return lost;
}

}  // namespace

JoinedPhase join(const record::Turns& turns, const gyro::Ellipse& ellipse, bool count_again) {
    const std::size_t n = turns.size();
    JoinedPhase joined;
    joined.phase_rad.resize(n);
    joined.miscounts.resize(n);
    std::vector<double> angle(n);
    std::vector<double> radius(n);
    // sin = S ((1 + gain) sin psi + offset_sin), cos = S (cos(psi + orthogonality) + offset_cos); S from the radii.
    double scale = 1.0;
    const auto round = [&](std::size_t i, double& s, double& c) {
        s = (turns.sine[i] / scale - ellipse.offset_sin) / (1.0 + ellipse.gain);
        c = turns.cosine[i] / scale - ellipse.offset_cos;
        c = (c + s * std::sin(ellipse.orthogonality_rad)) / std::cos(ellipse.orthogonality_rad);
    };
    for (int pass = 0; pass < 8; ++pass) {
        for (std::size_t i = 0; i < n; ++i) {
            double s = 0.0;
            double c = 0.0;
            round(i, s, c);
            radius[i] = std::hypot(s, c);
            angle[i] = std::atan2(s, c);
        }
        scale *= median(radius);
    }
    double squares = 0.0;
    const double mid = median(radius);
    for (double& r : radius) r = std::abs(r - mid);
    std::vector<double> sorted = radius;
    const double robust = 1.4826 * median(sorted);
    std::size_t counted = 0;
    for (const double r : radius) {
        if (r > options.turns.reading.radius_outlier_sd * robust) continue;
        squares += r * r;
        ++counted;
    }
    // The transformation of the ellipse to a circle makes an ellipse of the detectors' noise.
    double of_radius = 1.0;
    if (!(ellipse == gyro::Ellipse{})) {
        const double tangent = std::tan(ellipse.orthogonality_rad);
        const double of_cosine = 1.0 / std::pow(std::cos(ellipse.orthogonality_rad), 2);
        const double of_sine = 1.0 / std::pow(1.0 + ellipse.gain, 2);
        of_radius = 0.0;
        for (const double psi : angle) {
            const double s = std::sin(psi);
            const double c = std::cos(psi);
            joined.readout.push_back(std::pow(c - s * tangent, 2) * of_sine + s * s * of_cosine);
            of_radius += (std::pow(s + c * tangent, 2) * of_sine + c * c * of_cosine) / static_cast<double>(n);
        }
    }
    joined.readout_sd_rad = std::sqrt(squares / (of_radius * static_cast<double>(std::max<std::size_t>(counted, 1))));

    CountedQuarters quarters{.off = std::vector<double>(n), .sd = std::vector<double>(n), .direction = turns.direction};
    for (std::size_t i = 0; i < n; ++i) {
        const double of_noise = joined.readout.empty() ? 1.0 : std::sqrt(joined.readout[i]);
        quarters.sd[i] = joined.readout_sd_rad * of_noise / units::quarter_fringe_rad;
        const double q = angle[i] / units::quarter_fringe_rad - (static_cast<double>(turns.quarter_count[i] % 4) + 0.5);
        quarters.off[i] = q - 4.0 * std::round(0.25 * q);
    }
    joined.miscounts = lost_quarters(quarters);
    const std::int64_t first = joined.miscounts.front();
    // The counter's own zero may be further off than a floating-point number can count quarters.
    const std::int64_t whole_fringes = turns.quarter_count[0] / 4 * 4;
    for (std::size_t i = 0; i < n; ++i) {
        const std::int64_t now = joined.miscounts[i];
        if (i > 0 && now != joined.miscounts[i - 1]) joined.miscounted.push_back(i);
        const std::int64_t count = turns.quarter_count[i] - whole_fringes + (count_again ? now : first);
        const double middle = (static_cast<double>(count) + 0.5) * units::quarter_fringe_rad;
        joined.phase_rad[i] = angle[i] + units::two_pi * std::round((middle - angle[i]) / units::two_pi);
    }
    for (std::int64_t& lost : joined.miscounts) lost -= first;
    return joined;
}

std::vector<double> TurnSeries::input_angles_arcsec(std::span<const double> times_s) const {
    const std::vector<double>& row_s = input.time_s;
    std::vector<double> angles;
    angles.reserve(times_s.size());
    std::size_t next = 0;  // the first row after the time
    for (const double time : times_s) {
        while (next < row_s.size() && row_s[next] <= time) ++next;
        while (next > 0 && row_s[next - 1] > time) --next;
        if (next == 0) {
            angles.push_back((time - row_s[0]) * input.value[0]);
            continue;
        }
        const std::size_t row = next - 1;
        const double since = time - row_s[row];
        const double slope =
            next < row_s.size() ? (input.value[next] - input.value[row]) / (row_s[next] - row_s[row]) : 0.0;
        angles.push_back(input_angle[row] + (input.value[row] + 0.5 * slope * since) * since);
    }
    return angles;
}

double swing_over_dither(double share) { return std::sqrt(1.0 - share * share) + share * std::asin(share); }

namespace {

/// Amplitude and swings of the dither from those of the phase. The swings are relative, and only the change of the
/// rotation from turn to turn is removed from them.
void take_rotation_from_swings(double half_swing_rad, TurnSeries& series) {
    constexpr double most_share = options.turns.reading.most_rotation;
    constexpr int passes = 12;  // each changes a tenth of the one before, or less
    const auto n = static_cast<double>(series.size());
    const auto rate_deg_h = [&](std::size_t i) { return series.mean_rate_deg_h + series.input_rate_deg_h[i]; };
    std::vector<double> over(series.size(), 1.0);
    double mean = 1.0;
    for (int pass = 0; pass < passes; ++pass) {
        series.amplitude_rad = half_swing_rad / mean;
        mean = 0.0;
        for (std::size_t i = 0; i < over.size(); ++i) {
            over[i] = swing_over_dither(std::clamp(series.relative_rate(rate_deg_h(i)), -1.0, 1.0));
            mean += over[i] / n;
        }
    }
    for (std::size_t i = 0; i < over.size(); ++i) {
        series.swing[i] *= mean / over[i];
        const double share = std::abs(series.relative_rate(rate_deg_h(i)));
        if (share < most_share) continue;
        throw InputError(fmt::format(
            "/turns: at turn {} the gyro rotates by {:.4g} deg/h, {:.0f} % of the dither's peak rate; "
            "the phase must reverse well within each half cycle, and the closed loop accepts at most {:.0f} %",
            i, rate_deg_h(i), 100.0 * share, 100.0 * most_share));
    }
}

}  // namespace

TurnSeries prepare(const record::Record& record, const JoinedPhase& joined) {
    const record::Turns& turns = *record.turns;
    const std::size_t n = turns.size();
    if (n < record::fewest_turns_to_close) {
        throw InputError(
            fmt::format("/turns: {} turns are too few to fit and to predict; a closed loop needs at least {}", n,
                        record::fewest_turns_to_close));
    }
    TurnSeries series;
    const record::Declared& declared = record.declared;
    gyro::Setup& setup = series.setup;
    series.radius_sd_rad = joined.readout_sd_rad;
    series.readout = joined.readout;
    series.scale_factor_declared = declared.scale_factor_arcsec.has_value();
    setup.scale_factor_arcsec = declared.scale_factor_arcsec.value_or(setup.scale_factor_arcsec);
    setup.lockin_threshold_deg_h = declared.lockin_threshold_deg_h.value_or(setup.lockin_threshold_deg_h);
    series.start_s = turns.time_s[0];
    for (std::size_t i = 0; i < n; ++i) {
        series.time_s.push_back(turns.time_s[i] - turns.time_s[0]);
        series.direction.push_back(turns.direction[i]);
    }
    series.input_rate_deg_h.assign(n, declared.input_rate_deg_h.value_or(0.0));
    for (std::size_t i = 0; i < n && !record.input_rate_deg_h.empty(); ++i) {
        series.input_rate_deg_h[i] = record.input_rate_deg_h.at(turns.time_s[i]);
    }
    series.interval_s = series.time_s.back() / static_cast<double>(n - 1);
    // Between turns of one kind, where the dither cancels.
    const std::size_t last = (n - 1) / 2 * 2;
    double input = 0.0;
    for (std::size_t i = 0; i < last; ++i) input += series.input_rate_deg_h[i] / static_cast<double>(last);
    series.mean_rate_deg_h = (joined.phase_rad[last] - joined.phase_rad[0]) / series.time_s[last] *
                                 setup.scale_factor_arcsec / units::two_pi -
                             input;
    // Rotation lengthens swings of one sign and shortens those of the other, and does not change the dither's
    // amplitude.
    const double rotation_rad = units::two_pi / setup.scale_factor_arcsec * series.interval_s;
    double swings_of[2] = {};
    std::size_t counts_of[2] = {};
    series.swing.resize(n);
    for (std::size_t i = 0; i + 1 < n; ++i) {
        series.swing[i] = (joined.phase_rad[i + 1] - joined.phase_rad[i]) * turns.direction[i] -
                          turns.direction[i] * rotation_rad * series.input_rate_deg_h[i];
        const std::size_t side = turns.direction[i] > 0 ? 0 : 1;
        swings_of[side] += series.swing[i];
        ++counts_of[side];
    }
    for (int side = 0; side < 2; ++side) swings_of[side] /= static_cast<double>(counts_of[side]);
    const double swings = 0.5 * (swings_of[0] + swings_of[1]);
    const double least_swing_rad = options.turns.reading.least_swing_rad;
    if (!(std::min(swings_of[0], swings_of[1]) > least_swing_rad)) {
        throw InputError(
            fmt::format("/turns: half cycles swing by {:.4g} rad of phase on average; minima (direction 1) "
                        "must be followed by maxima (-1) at least {:g} rad above them",
                        swings, least_swing_rad));
    }
    for (std::size_t i = 0; i + 1 < n; ++i) series.swing[i] /= swings_of[turns.direction[i] > 0 ? 0 : 1];
    series.swing[n - 1] = 1.0;
    take_rotation_from_swings(0.5 * swings, series);
    setup.dither_frequency_hz = 0.5 / series.interval_s;
    const double w = units::pi / series.interval_s;
    // A = 2 pi Omega_D/(K w)
    setup.dither_peak_rate_deg_s =
        series.amplitude_rad * w * setup.scale_factor_arcsec / (units::two_pi * units::deg_h_per_deg_s);
    series.acceleration_rad_s2 = series.amplitude_rad * w * w;
    series.all_phases_come = all_phases_come(joined.phase_rad, series.direction);
    series.input = record.input_rate_deg_h;
    if (series.input.empty()) series.input = {{turns.time_s[0]}, {series.input_rate_deg_h[0]}};
    for (double& time : series.input.time_s) time -= turns.time_s[0];
    const auto& rows = series.input;
    series.input_angle.assign(rows.time_s.size(), 0.0);
    for (std::size_t k = 1; k < rows.time_s.size(); ++k) {
        series.input_angle[k] = series.input_angle[k - 1] +
                                0.5 * (rows.value[k] + rows.value[k - 1]) * (rows.time_s[k] - rows.time_s[k - 1]);
    }
    if (!record.temperature_c.empty()) {
        const double start = record.temperature_c.at(turns.time_s[0]);
        for (std::size_t i = 0; i < n; ++i) {
            series.temperature_change_k.push_back(record.temperature_c.at(turns.time_s[i]) - start);
        }
    }
    return series;
}

}  // namespace ringlock::closure
