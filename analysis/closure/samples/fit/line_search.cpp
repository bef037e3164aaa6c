#include "analysis/closure/samples/fit/line_search.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <unsupported/Eigen/FFT>

#include "analysis/closure/options.hpp"
#include "analysis/closure/stats/p_values.hpp"
#include "engine/core/units.hpp"

namespace ringlock::closure {

namespace {

using Complex = std::complex<double>;

}  // namespace

std::size_t power_of_two(std::size_t least) {
    std::size_t n = 1;
    while (n < least) n *= 2;
    return n;
}

std::vector<Complex> transform(const std::vector<Complex>& in, bool back) {
    Eigen::FFT<double> fft;
    std::vector<Complex> out;
    if (back) {
        fft.inv(out, in);
    } else {
        fft.fwd(out, in);
    }
    return out;
}

std::vector<double> periodogram(const std::vector<double>& values, std::size_t padded) {
    std::vector<double> in(values);
    in.resize(padded, 0.0);
    std::vector<Complex> out;
    Eigen::FFT<double> fft;
    fft.SetFlag(Eigen::FFT<double>::HalfSpectrum);
    fft.fwd(out, in);
    std::vector<double> power(padded / 2);
    for (std::size_t k = 0; k < power.size(); ++k) power[k] = std::norm(out[k]);
    return power;
}

namespace {

/// Mean level of a periodogram about each bin, from medians over stretches of that many bins, which lines do not
/// change.
std::vector<double> level_about(const std::vector<double>& power, std::size_t stretch) {
    const std::size_t n = power.size();
    stretch = std::clamp<std::size_t>(stretch, 16, std::max<std::size_t>(16, n));
    std::vector<double> centres;
    std::vector<double> levels;
    for (std::size_t a = 0; a < n; a += stretch) {
        const std::size_t b = n - a < 2 * stretch ? n : a + stretch;
        std::vector<double> part(power.begin() + static_cast<std::ptrdiff_t>(a),
                                 power.begin() + static_cast<std::ptrdiff_t>(b));
        const auto middle = part.begin() + static_cast<std::ptrdiff_t>(part.size() / 2);
        std::nth_element(part.begin(), middle, part.end());
        centres.push_back(0.5 * static_cast<double>(a + b));
        levels.push_back(std::max(*middle / std::log(2.0), 1e-300));
        if (b == n) break;
    }
    std::vector<double> level(n);
    std::size_t c = 0;
    for (std::size_t i = 0; i < n; ++i) {
        const auto x = static_cast<double>(i);
        while (c + 1 < centres.size() && centres[c + 1] < x) ++c;
        if (x <= centres.front() || centres.size() == 1) {
            level[i] = levels.front();
        } else if (c + 1 >= centres.size()) {
            level[i] = levels.back();
        } else {
            const double share = (x - centres[c]) / (centres[c + 1] - centres[c]);
            level[i] = levels[c] * std::pow(levels[c + 1] / levels[c], share);
        }
    }
    return level;
}

/// Spectrum of the whole record, and the level about each frequency.
struct Spectrum {
    std::size_t padded;
    double rows, rate_hz, duration_s, bin_hz;
    std::vector<double> power, level;
    std::size_t first;  ///< first bin of the search
    std::vector<double> known_hz;
    double width_hz;

    Spectrum(const std::vector<double>& values, double rate, std::vector<double> known, double width)
        : padded(power_of_two(2 * values.size())),
          rows(static_cast<double>(values.size())),
          rate_hz(rate),
          duration_s(rows / rate),
          bin_hz(rate / static_cast<double>(padded)),
          power(periodogram(values, padded)),
          known_hz(std::move(known)),
          width_hz(width) {
        const double per_bin = rows / static_cast<double>(padded);  // Fourier frequencies per bin
        level = level_about(power, static_cast<std::size_t>(std::min(300.0, std::max(40.0, rows / 100.0)) / per_bin));
        first = static_cast<std::size_t>(options.samples.lines.fewest_cycles / per_bin);
    }
    double level_at(double hz) const {
        return level[std::min(level.size() - 1, static_cast<std::size_t>(std::max(0.0, hz) / bin_hz))];
    }
    /// A line of amplitude a has the power (a n/2)^2, and n a^2/2 of the sum of squares.
    double squares(double power_there) const { return 2.0 * power_there / rows; }
    bool passed_over(double hz) const {
        return std::any_of(known_hz.begin(), known_hz.end(), [&](double k) { return std::abs(hz - k) < width_hz; });
    }
    double cycles() const { return 0.5 * rows; }
};

/// Lines are compared by chi-squared over the level about them. Where both are significant beyond chance they are
/// compared by their own power: a strong line raises the level about itself, and makes power elsewhere.
bool stands_out(double chi2, double squares, const FoundLine& from) {
    return std::min(chi2, from.chi2) > options.samples.lines.certain ? squares > from.squares : chi2 > from.chi2;
}

void set_look_elsewhere(FoundLine& line, double trials) {
    line.look_elsewhere = std::max(1.0, trials);
    line.p_value = of_several(chi2_tail(line.chi2, 2), line.look_elsewhere);
}

FoundLine still_line(const Spectrum& spectrum) {
    FoundLine found;
    for (std::size_t k = spectrum.first; k + 4 < spectrum.power.size(); ++k) {
        const double chi2 = 2.0 * spectrum.power[k] / spectrum.level[k];
        const double hz = spectrum.bin_hz * static_cast<double>(k);
        const double squares = spectrum.squares(spectrum.power[k]);
        if (!stands_out(chi2, squares, found) || spectrum.passed_over(hz)) continue;
        found = {.frequency_hz = hz, .chi2 = chi2, .squares = squares};
    }
    set_look_elsewhere(found, look_elsewhere_of_frequency(found.chi2, spectrum.cycles()));
    return found;
}

/// All frequencies, and drifts of up to so many cycles of either sign; the phase is followed over the whole record.
FoundLine slow_line(const std::vector<double>& values, const Spectrum& spectrum) {
    // A drift with an error of half a cycle at most keeps 98 % of a line's power.
    const int most = options.samples.lines.slow_drift_cycles;
    FoundLine found;
    const std::size_t n = values.size();
    std::vector<Complex> turned(spectrum.padded, 0.0);
    for (int cycles = 1; cycles <= most; ++cycles) {
        const double drift = cycles / (spectrum.duration_s * spectrum.duration_s);
        for (std::size_t i = 0; i < n; ++i) {
            if (values[i] == 0.0) continue;
            const double t = (static_cast<double>(i) - 0.5 * (spectrum.rows - 1.0)) / spectrum.rate_hz;
            turned[i] = values[i] * std::polar(1.0, -units::pi * drift * t * t);
        }
        const auto out = transform(turned);
        // For real values, the drift of the other sign is at the frequency of the other sign.
        for (const int sign : {1, -1}) {
            for (std::size_t k = spectrum.first; k + 4 < spectrum.power.size(); ++k) {
                const double power = std::norm(out[sign > 0 ? k : spectrum.padded - k]);
                const double chi2 = 2.0 * power / spectrum.level[k];
                const double hz = spectrum.bin_hz * static_cast<double>(k);
                const double squares = spectrum.squares(power);
                if (!stands_out(chi2, squares, found) || spectrum.passed_over(hz)) continue;
                found = {.frequency_hz = hz, .drift_hz_per_s = sign * drift, .chi2 = chi2, .squares = squares};
            }
        }
    }
    set_look_elsewhere(found, look_elsewhere_of_drift(found.chi2, spectrum.cycles(), 2.0 * most));
    return found;
}

/// Follows the phase about a frequency and a drift: within half_hz of centre_hz, and over drifts about `drift` in steps
/// of one cycle, `steps` to either side.
FoundLine follow(const std::vector<double>& values, const Spectrum& spectrum, double centre_hz, double half_hz,
                 double drift, int steps, FoundLine found = {}) {
    const std::size_t n = values.size();
    // Sums over cells so short that the edges of the band lose 2 % at most.
    const auto cells = static_cast<std::size_t>(std::ceil(8.0 * half_hz * spectrum.duration_s));
    const std::size_t keep = std::min<std::size_t>(n, std::max<std::size_t>(1024, cells));
    const std::size_t step = n / keep;
    const std::size_t slow = (n + step - 1) / step;
    const double low_rate = spectrum.rate_hz / static_cast<double>(step);
    const auto phase = line_phase(n, spectrum.rate_hz, FrequencyTrack::even(centre_hz, drift));
    std::vector<Complex> low(slow, 0.0);
    for (std::size_t i = 0; i < n; ++i) low[i / step] += values[i] * std::polar(1.0, -phase[i]);
    const std::size_t padded = power_of_two(4 * slow);
    const auto all = static_cast<std::ptrdiff_t>(padded);
    const double bin_hz = low_rate / static_cast<double>(padded);
    const auto reach = std::min<std::ptrdiff_t>(all / 2 - 1, static_cast<std::ptrdiff_t>(half_hz / bin_hz));
    const double unit = 1.0 / (spectrum.duration_s * spectrum.duration_s);
    std::vector<Complex> turned(padded, 0.0);
    for (int d = -steps; d <= steps; ++d) {
        for (std::size_t i = 0; i < slow; ++i) {
            const double t =
                (static_cast<double>(i * step) + 0.5 * static_cast<double>(step - 1) - 0.5 * (spectrum.rows - 1.0)) /
                spectrum.rate_hz;
            turned[i] = low[i] * std::polar(1.0, -units::pi * d * unit * t * t);
        }
        const auto out = transform(turned);
        for (std::ptrdiff_t k = -reach; k <= reach; ++k) {
            const double hz = centre_hz + bin_hz * static_cast<double>(k);
            if (hz * spectrum.duration_s < options.samples.lines.fewest_cycles ||
                hz > 0.5 * spectrum.rate_hz - 4.0 * spectrum.bin_hz)
                continue;
            const double power = std::norm(out[static_cast<std::size_t>((k + all) % all)]);
            const double chi2 = 2.0 * power / spectrum.level_at(hz);
            const double squares = spectrum.squares(power);
            if (!stands_out(chi2, squares, found) || spectrum.passed_over(hz)) continue;
            found = {.frequency_hz = hz, .drift_hz_per_s = drift + d * unit, .chi2 = chi2, .squares = squares};
        }
    }
    return found;
}

/// Lines with any drift: sums of power along straight tracks over pieces, each so short that the line stays in its bin.
void track_lines(const std::vector<double>& values, const Spectrum& spectrum, FoundLines& lines) {
    const std::size_t n = values.size();
    constexpr auto lengths = static_cast<double>(options.samples.lines.pieces.size());
    double least = 1.0;
    double tracked_hz = 0.0;
    double tracked_drift = 0.0;
    double drift_cycles = 0.0;
    for (const std::size_t pieces : options.samples.lines.pieces) {
        const std::size_t length = n / pieces;
        if (length < options.samples.lines.shortest_piece) continue;
        const std::size_t wide = power_of_two(2 * length);
        const double hz = spectrum.rate_hz / static_cast<double>(wide);
        // A piece of which a part does not count has less power: each piece has its own level.
        const double bins = static_cast<double>(wide) / static_cast<double>(length);
        std::vector<std::vector<double>> relative;
        std::vector<std::vector<double>> levels;
        double used = 0.0;
        for (std::size_t p = 0; p < pieces; ++p) {
            const std::vector<double> part(values.begin() + static_cast<std::ptrdiff_t>(p * length),
                                           values.begin() + static_cast<std::ptrdiff_t>((p + 1) * length));
            auto s = periodogram(part, wide);
            auto& level = levels.emplace_back(s.size(), 0.0);
            if (std::accumulate(s.begin(), s.end(), 0.0) > 0.0) {
                used += 1.0;
                level =
                    level_about(s, static_cast<std::size_t>(std::max(32.0, static_cast<double>(length) / 20.0) * bins));
                for (std::size_t k = 0; k < s.size(); ++k) s[k] *= 2.0 / level[k];
            }
            relative.push_back(std::move(s));
        }
        if (used < options.samples.lines.fewest_pieces) continue;
        const auto most = static_cast<int>(pieces);
        double best = 0.0;
        int best_slope = 0;
        std::size_t best_bin = 0;
        double best_squares = 0.0;
        const auto first = static_cast<std::ptrdiff_t>(8.0 * bins);
        for (int slope = -most; slope <= most; ++slope) {
            std::vector<std::ptrdiff_t> shift(pieces);
            for (std::size_t p = 0; p < pieces; ++p) {
                const double x = (static_cast<double>(p) + 0.5) / static_cast<double>(pieces) - 0.5;
                shift[p] = static_cast<std::ptrdiff_t>(std::lround(x * slope * bins));
            }
            const auto half = static_cast<std::ptrdiff_t>(wide / 2);
            const auto edge = std::max<std::ptrdiff_t>(std::abs(shift.front()), std::abs(shift.back()));
            for (std::ptrdiff_t k = std::max(first, edge); k < half - edge - 2; ++k) {
                double sum = 0.0;
                for (std::size_t p = 0; p < pieces; ++p) sum += relative[p][static_cast<std::size_t>(k + shift[p])];
                if (sum > best && !spectrum.passed_over(hz * static_cast<double>(k))) {
                    best = sum;
                    best_slope = slope;
                    best_bin = static_cast<std::size_t>(k);
                    best_squares = 0.0;
                    for (std::size_t p = 0; p < pieces; ++p) {
                        const auto at = static_cast<std::size_t>(k + shift[p]);
                        best_squares += std::max(0.0, relative[p][at] - 2.0) * levels[p][at];
                    }
                    best_squares /= static_cast<double>(length);
                }
            }
        }
        // Each piece adds one bin to a sum, so that sums along different tracks are nearly independent.
        const double count = lengths * 1.5 * 0.5 * static_cast<double>(length) * (2.0 * most + 1.0);
        const double p = of_several(chi2_tail(best, static_cast<int>(2.0 * used)), count);
        if (best - 2.0 * used > lines.scattered && p < options.samples.lines.scattered_p) {
            lines.scattered = best - 2.0 * used;
            lines.scattered_hz = hz * static_cast<double>(best_bin);
            lines.scattered_drift_hz_per_s = best_slope * bins * hz / spectrum.duration_s;
            lines.scattered_squares = best_squares;
        }
        if (p >= least) continue;
        least = p;
        tracked_hz = hz * static_cast<double>(best_bin);
        tracked_drift = best_slope * bins * hz / spectrum.duration_s;
        drift_cycles = 2.0 * most * static_cast<double>(pieces);
    }
    if (least == 1.0) return;
    const double near_cycles = options.samples.lines.near_cycles;
    lines.tracked = follow(values, spectrum, tracked_hz, near_cycles / spectrum.duration_s, tracked_drift,
                           static_cast<int>(near_cycles));
    set_look_elsewhere(lines.tracked, look_elsewhere_of_drift(lines.tracked.chi2, spectrum.cycles(), drift_cycles));
    lines.tracked.p_value = std::min(1.0, 2.0 * std::min(lines.tracked.p_value, least));
}

}  // namespace

double look_elsewhere_of_drift(double chi2, double cycles, double drift_cycles) {
    // With unit variance about the best phase the slopes by frequency and drift have the variances (2 pi)^2 T^2/12 and
    // pi^2 T^4/180; the density of the field is (chi2 - 1) exp(-chi2/2)/(2 pi).
    const double inside = units::pi / std::sqrt(2160.0) * cycles * drift_cycles * std::max(0.0, chi2 - 1.0);
    return look_elsewhere_of_frequency(chi2, cycles) + inside;
}

FoundLine FoundLines::likeliest() const {
    FoundLine best = still;
    for (const FoundLine& other : {slow, tracked}) {
        // For strong lines both p-values are zero.
        const bool as_rare = other.p_value == best.p_value && stands_out(other.chi2, other.squares, best);
        if (other.p_value < best.p_value || as_rare) best = other;
    }
    const double kinds = options.samples.lines.kinds;
    best.look_elsewhere *= kinds;
    best.p_value = of_several(best.p_value, kinds);
    return best;
}

FoundLine find_still_line(const std::vector<double>& values, double rate_hz, const std::vector<double>& known_hz,
                          double width_hz) {
    return still_line(Spectrum(values, rate_hz, known_hz, width_hz));
}

FoundLines find_lines(const std::vector<double>& values, double rate_hz, const std::vector<double>& known_hz,
                      double width_hz) {
    const Spectrum spectrum(values, rate_hz, known_hz, width_hz);
    FoundLines lines;
    lines.still = still_line(spectrum);
    lines.slow = slow_line(values, spectrum);
    track_lines(values, spectrum, lines);
    return lines;
}

NarrowLines find_lines_in(const std::vector<double>& values, double rate_hz, const LineBand& band,
                          const std::vector<double>& known_hz, double width_hz) {
    // Larger drifts are in the search over all frequencies.
    const double most_cycles = options.samples.lines.declared_drift_cycles;
    const Spectrum spectrum(values, rate_hz, known_hz, width_hz);
    const double cycles = 2.0 * band.half_width_hz * spectrum.duration_s;
    const double drift_cycles =
        std::min(most_cycles, band.most_drift_hz_per_s * spectrum.duration_s * spectrum.duration_s);
    const auto steps = static_cast<int>(std::ceil(drift_cycles));
    NarrowLines found;
    found.still = follow(values, spectrum, band.centre_hz, band.half_width_hz, 0.0, 0);
    set_look_elsewhere(found.still, look_elsewhere_of_frequency(found.still.chi2, cycles));
    found.drifting = follow(values, spectrum, band.centre_hz, band.half_width_hz, 0.0, steps);
    set_look_elsewhere(found.drifting, look_elsewhere_of_drift(found.drifting.chi2, cycles, 2.0 * steps));
    return found;
}

}  // namespace ringlock::closure
