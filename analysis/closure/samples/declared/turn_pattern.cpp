#include "analysis/closure/samples/declared/turn_pattern.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <limits>
#include <utility>

#include "analysis/closure/options.hpp"
#include "analysis/closure/samples/fit/line_search.hpp"
#include "analysis/closure/stats/p_values.hpp"
#include "engine/core/units.hpp"

namespace ringlock::closure {

namespace {

/// Variance of the part of a kick up to `x` units of time after its turn, relative to that of the whole kick: abs(1/2 +
/// (C(x) + i S(x))/(1 + i))^2 with Fresnel's integrals of pi x^2/2 (Abramowitz and Stegun, 7.3), for a uniformly
/// distributed phase.
class KickProfile {
   public:
    KickProfile() {
        // Simpson's rule on a grid that resolves the fastest oscillation.
        std::complex<double> integral = 0.0;
        const auto swing = [](double x) { return std::polar(1.0, 0.5 * units::pi * x * x); };
        for (std::size_t i = 0; i < right_.size(); ++i) {
            const double x = step * static_cast<double>(i);
            const std::complex<double> share = integral / std::complex<double>(1.0, 1.0);
            right_[i] = std::norm(0.5 + share);
            left_[i] = std::norm(0.5 - share);
            integral += step / 6.0 * (swing(x) + 4.0 * swing(x + 0.5 * step) + swing(x + step));
        }
    }
    double at(double x) const {
        const double place = std::abs(x) / step;
        if (place >= static_cast<double>(right_.size() - 1)) return x > 0.0 ? 1.0 : 0.0;
        const auto i = static_cast<std::size_t>(place);
        const auto& side = x > 0.0 ? right_ : left_;
        const double share = place - static_cast<double>(i);
        return side[i] + share * (side[i + 1] - side[i]);
    }
    static constexpr double reach = 8.0;

   private:
    static constexpr double step = 0.01;
    std::array<double, static_cast<std::size_t>(reach / step) + 1> right_{}, left_{};
};

/// The profile averaged over turns with a normal deviation of their times, as a function of the place of the row's end
/// in turns after the turn.
class BlurredProfile {
   public:
    BlurredProfile(double unit_turns, double late_turns) {
        static const KickProfile profile;
        constexpr std::array<double, 7> nodes = {-2.651961, -1.673552, -0.816288, 0.0, 0.816288, 1.673552, 2.651961};
        // Gauss-Hermite with seven nodes (Abramowitz and Stegun, table 25.10).
        constexpr std::array<double, 7> weights = {0.000971781, 0.0545156, 0.425607,   0.810265,
                                                   0.425607,    0.0545156, 0.000971781};
        for (std::size_t i = 0; i < values_.size(); ++i) {
            const double turns = reach * (2.0 * static_cast<double>(i) / static_cast<double>(values_.size() - 1) - 1.0);
            double sum = 0.0;
            double total = 0.0;
            for (std::size_t k = 0; k < nodes.size(); ++k) {
                sum += weights[k] * profile.at((turns - std::sqrt(2.0) * late_turns * nodes[k]) / unit_turns);
                total += weights[k];
            }
            values_[i] = sum / total;
        }
    }
    double at(double turns) const {
        if (turns >= reach) return 1.0;
        if (turns <= -reach) return 0.0;
        const double place = 0.5 * (turns / reach + 1.0) * static_cast<double>(values_.size() - 1);
        const auto i = std::min(static_cast<std::size_t>(place), values_.size() - 2);
        const double share = place - static_cast<double>(i);
        return values_[i] + share * (values_[i + 1] - values_[i]);
    }
    static constexpr double reach = 1.0;

   private:
    std::array<double, 801> values_{};
};

/// Variance by kicks of a row that ends at that place between two turns, relative to the mean. `ratio`: turns per row.
double weight_at(const BlurredProfile& profile, double place, double ratio) {
    double sum = 0.0;
    const auto first = static_cast<int>(std::floor(place - ratio - BlurredProfile::reach));
    const auto last = static_cast<int>(std::ceil(place + BlurredProfile::reach));
    for (int turn = first; turn <= last; ++turn) {
        const double end = place - turn;
        sum += profile.at(end) * profile.at(ratio - end);
    }
    return sum / ratio;
}

constexpr std::size_t cycle_bins = 256;
using Weights = std::array<double, cycle_bins>;

/// Squares of the innovations by the place of the row's end between two turns.
struct Folded {
    std::array<double, cycle_bins> squares{}, count{};
};

Folded fold(const SampleFit& fit, double turns_a_row) {
    Folded folded;
    const auto& e = fit.innovations();
    for (std::size_t i = 0; i < e.size(); ++i) {
        if (!fit.informative()[i]) continue;
        const double turns = turns_a_row * static_cast<double>(i + 1);
        const auto bin = static_cast<std::size_t>((turns - std::floor(turns)) * cycle_bins) % cycle_bins;
        folded.squares[bin] += e[i] * e[i];
        folded.count[bin] += 1.0;
    }
    return folded;
}

struct Placed {
    double gain = -std::numeric_limits<double>::infinity();
    std::size_t shift = 0;
};

/// The most likely place of the turns. `share`: share of the innovations' variance that arrives in kicks.
Placed place_turns(const Folded& folded, const Weights& weights, double share) {
    std::array<double, cycle_bins> log_variance{}, inverse{};
    for (std::size_t b = 0; b < cycle_bins; ++b) {
        const double variance = std::max(1e-6, 1.0 + share * (weights[b] - 1.0));
        log_variance[b] = std::log(variance);
        inverse[b] = 1.0 / variance;
    }
    Placed best;
    for (std::size_t shift = 0; shift < cycle_bins; ++shift) {
        double gain = 0.0;
        for (std::size_t b = 0; b < cycle_bins; ++b) {
            const std::size_t w = (b + shift) % cycle_bins;
            gain += 0.5 * (folded.squares[b] * (1.0 - inverse[w]) - folded.count[b] * log_variance[w]);
        }
        if (gain > best.gain) best = {gain, shift};
    }
    return best;
}

double scale_factor(const record::Declared& declared) { return declared.scale_factor_arcsec.value_or(0.0); }

double peak_arcsec_s(const record::Declared& declared) {
    return declared.dither_peak_rate_deg_s.value_or(0.0) * units::arcsec_per_deg;
}

/// Duration of a kick [s]: the root of pi over the acceleration of the phase at a turn; 0 where it is unknown.
double kick_unit_s(const record::Declared& declared) {
    const double k = scale_factor(declared);
    const double peak = peak_arcsec_s(declared);
    if (!(k > 0.0) || !(peak > 0.0)) return 0.0;
    return std::sqrt(units::pi * k / (units::two_pi * peak * units::two_pi * *declared.dither_frequency_hz));
}

}  // namespace

std::optional<SeenTurns> turns_in_squares(const SampleFit& base, const record::Declared& declared) {
    const SampleTurnOptions& by = options.samples.turns;
    const SampleSeries& series = base.series();
    const double declared_hz = 2.0 * *declared.dither_frequency_hz;
    const auto& e = base.innovations();
    double mean = 0.0;
    double count = 0.0;
    for (std::size_t i = 0; i < e.size(); ++i) {
        if (!base.informative()[i]) continue;
        mean += e[i] * e[i];
        count += 1.0;
    }
    mean /= std::max(count, 1.0);
    std::vector<double> squares(e.size(), 0.0);
    double power = 0.0;
    for (std::size_t i = 0; i < e.size(); ++i) {
        if (!base.informative()[i]) continue;
        squares[i] = e[i] * e[i] - mean;
        power += squares[i] * squares[i];
    }
    std::size_t padded = 1;
    while (padded < 2 * e.size()) padded *= 2;
    const std::vector<double> spectrum = periodogram(squares, padded);
    const double bin_hz = series.rate_hz / static_cast<double>(padded);
    const double tolerance_hz = std::max(options.samples.declared_dither_error * declared_hz, 8.0 * bin_hz);
    double seen_hz = declared_hz;
    double seen_power = 0.0;
    double look_elsewhere = 0.0;
    for (double hz = declared_hz - tolerance_hz; hz <= declared_hz + tolerance_hz; hz += bin_hz) {
        const double alias_hz = std::abs(std::remainder(hz, series.rate_hz));
        const auto at = static_cast<std::size_t>(std::llround(alias_hz / bin_hz));
        look_elsewhere += 1.0;
        // A slow change of the noise is no pattern of turns.
        if (at < by.fewest_cycles || at >= spectrum.size() || spectrum[at] <= seen_power) continue;
        seen_power = spectrum[at];
        seen_hz = hz;
    }
    if (!(power > 0.0) || of_several(std::exp(-seen_power / power), look_elsewhere) > by.seen_p) return std::nullopt;
    return SeenTurns{seen_hz, bin_hz};
}

std::optional<TurnPattern> find_turn_pattern(const SampleFit& base, const record::Declared& declared) {
    if (!declared.dither_frequency_hz) return std::nullopt;
    const SampleTurnOptions& by = options.samples.turns;
    const SampleSeries& series = base.series();
    const double declared_hz = 2.0 * *declared.dither_frequency_hz;
    if (declared_hz * series.interval_s > by.most_turns_a_row) return std::nullopt;
    if (declared.lockin_threshold_deg_h == 0.0) return std::nullopt;

    const auto seen = turns_in_squares(base, declared);
    if (!seen) return std::nullopt;
    const auto& e = base.innovations();
    const double seen_hz = seen->turn_hz;
    const double bin_hz = seen->bin_hz;
    // Share of the variance of an innovation of the base model by its white rate.
    const double by_rate =
        std::min(1.0, std::pow(base.model().noise.rate_arcsec_rt_s / base.typical_sd(), 2) * series.interval_s);
    const double unit_s = kick_unit_s(declared);
    TurnPattern best;
    best.gain = -std::numeric_limits<double>::infinity();
    const auto search = [&](double centre_hz, double half_width_hz, double step_hz) {
        for (double hz = centre_hz - half_width_hz; hz <= centre_hz + half_width_hz; hz += step_hz) {
            const Folded folded = fold(base, hz * series.interval_s);
            for (const double late_s : by.late_s) {
                if (late_s * hz > by.most_late_turns) continue;
                const double unit_turns = std::max(unit_s * hz, 1e-3);
                const BlurredProfile profile(unit_turns, late_s * hz);
                Weights weights;
                for (std::size_t b = 0; b < cycle_bins; ++b) {
                    weights[b] =
                        weight_at(profile, (static_cast<double>(b) + 0.5) / cycle_bins, hz * series.interval_s);
                }
                for (const double share : by.shares) {
                    const Placed placed = place_turns(folded, weights, share * by_rate);
                    if (placed.gain <= best.gain) continue;
                    best.gain = placed.gain;
                    best.turn_hz = hz;
                    best.place = static_cast<double>(placed.shift) / cycle_bins;
                    best.late_s = late_s;
                    best.share = share;
                }
            }
        }
    };
    // A cycle over the record is two bins or more.
    search(seen_hz, 4.0 * bin_hz, 0.5 * bin_hz);
    search(best.turn_hz, 0.5 * bin_hz, 0.06 * bin_hz);
    if (best.gain < by.least_gain) return std::nullopt;
    const BlurredProfile profile(std::max(unit_s * best.turn_hz, 1e-3), best.late_s * best.turn_hz);
    KickRows kicks;
    const double turns_a_row = best.turn_hz * series.interval_s;
    for (std::size_t i = 0; i < e.size(); ++i) {
        const double end = turns_a_row * static_cast<double>(i + 1) + best.place;
        double variance = 0.0;
        double carried = 0.0;
        double covariance = 0.0;
        // Turns that are nearer to the end of this row than to that of another.
        for (double turn = std::floor(end - 0.5 * turns_a_row) + 1.0; turn <= end + 0.5 * turns_a_row; ++turn) {
            const double first = profile.at(end - turn);
            const double second = profile.at(turn - end);
            variance += first;
            carried += second;
            covariance += 0.5 * (1.0 - first - second);
        }
        kicks.variance.push_back(variance);
        kicks.carried.push_back(carried);
        kicks.covariance.push_back(covariance);
    }
    best.kicks = std::make_shared<const KickRows>(std::move(kicks));
    return best;
}

void take_turn_pattern(const TurnPattern& pattern, SampleNoise& noise) {
    noise.kick_share = pattern.share;
    noise.kicks = pattern.kicks;
    noise.turn_hz = pattern.turn_hz;
    constexpr double of_arcsine = -1.5;
    noise.kick_excess = of_arcsine;
}

void drop_turn_pattern(SampleNoise& noise) { copy_turn_pattern({}, noise); }

void copy_turn_pattern(const SampleNoise& from, SampleNoise& to) {
    to.kick_share = from.kick_share;
    to.kicks = from.kicks;
    to.turn_hz = from.turn_hz;
    to.kick_excess = from.kick_excess;
    to.dither = from.dither;
    to.dither_share = from.dither_share;
    to.dither_memory = from.dither_memory;
    to.dither_follower = from.dither_follower;
    to.sidebands = from.sidebands;
    to.count_error = from.count_error;
    to.swing_hz = from.swing_hz;
    to.swing_cos = from.swing_cos;
    to.swing_sin = from.swing_sin;
}

namespace {

/// Sum of the fourth powers of the response of sums of innovations to one disturbance, given as increments.
double fourth_powers(const SampleFit& fit, const std::vector<double>& disturbance, std::size_t length) {
    const std::size_t n = fit.innovations().size();
    const std::size_t reach = std::min(n, options.samples.turns.response_rows);
    std::vector<double> increments(reach, 0.0);
    const std::size_t at = reach / 2;
    for (std::size_t i = 0; i < disturbance.size() && at + i < reach; ++i) increments[at + i] = disturbance[i];
    const std::vector<double> response = fit.filter().apply(increments);
    double sum = 0.0;
    double running = 0.0;
    for (std::size_t i = 0; i < reach; ++i) {
        running += response[i];
        if (i >= length) running -= response[i - length];
        sum += running * running * running * running;
    }
    return sum;
}

double excess_of_kicks(const SampleFit& fit, std::size_t length) {
    const SampleNoise& noise = fit.model().noise;
    if (!noise.kicks || noise.kick_excess == 0.0) return 0.0;
    double sum = 0.0;
    double count = 0.0;
    for (std::size_t i = 1; i < fit.innovations().size(); ++i) {
        if (!fit.informative()[i]) continue;
        const double kicks = noise.kicks->variance[i] + noise.kicks->carried[i - 1];
        const double share = noise.kick_variance() / (fit.sd(i) * fit.sd(i));
        sum += noise.kick_excess * kicks * share * share;
        count += 1.0;
    }
    return count > 0.0 ? sum / count / static_cast<double>(length) : 0.0;
}

}  // namespace

double expected_excess(const SampleFit& fit, std::size_t length) {
    double excess = excess_of_kicks(fit, length);
    const SampleNoise& noise = fit.model().noise;
    const double of_reader = noise.dither ? std::sqrt(1.0 - noise.dither_share) : 1.0;
    const double counted = std::min(fit.series().count_noise_arcsec, of_reader * noise.angle_arcsec);
    if (counted > 0.0 && length <= options.samples.turns.longest_sum && !(fit.model().noise.from_hz > 0.0)) {
        constexpr double of_uniform = -1.2;
        const double m = static_cast<double>(length);
        excess += of_uniform * fourth_powers(fit, {counted, -counted}, length) / (m * m);
    }
    return excess;
}

}  // namespace ringlock::closure
