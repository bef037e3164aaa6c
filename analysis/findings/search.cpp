#include "analysis/findings/search.hpp"

#include <algorithm>
#include <cmath>

#include "analysis/findings/events.hpp"
#include "analysis/findings/median.hpp"
#include "analysis/findings/stretches.hpp"
#include "analysis/findings/thresholds.hpp"
#include "analysis/noise/decomposition.hpp"
#include "analysis/noise/model/line.hpp"
#include "analysis/noise/model/spectrum.hpp"
#include "analysis/noise/model/subsets.hpp"

namespace ringlock::findings {
namespace {

constexpr std::size_t fewest_rates = 64;
constexpr double significance_of_lines = 1e-3;

/// The record in the cosine basis and the noise that explains it.
struct Noise {
    noise::Decomposition parts;
    std::vector<double> residual;
    std::vector<double> variance;
};

Noise noise_of(std::span<const double> rate) {
    Noise out{noise::decompose(noise::cosine_spectrum(rate), significance_of_lines), {}, {}};
    out.residual = noise::residual(out.parts.noise, out.parts.five);
    out.variance = noise::coefficient_variances(out.parts.noise, out.parts.five);
    return out;
}

/// The rates without gross values that stand alone, each replaced by the mean of its neighbours. The whitening of a
/// record with a random walk or a flicker spreads such a value over many rates, which would look like a disturbed
/// stretch.
std::vector<double> without_isolated(std::vector<double> rate) {
    constexpr double gross = 8.0;                          // usual deviations: chance makes one in 1e15 so large
    constexpr double deviations_in_median = 0.6744897502;  // of the size of a normal deviate
    constexpr std::size_t near = 32;
    constexpr std::size_t most_near = 4;  // more of them within `near` rates are a disturbed stretch
    constexpr int passes = 3;             // an angle that is off moves two rates
    const std::size_t n = rate.size();
    for (int pass = 0; pass < passes; ++pass) {
        std::vector<double> contrast(n, 0.0);
        for (std::size_t i = 1; i + 1 < n; ++i) contrast[i] = std::abs(rate[i] - 0.5 * (rate[i - 1] + rate[i + 1]));
        const double most = gross * median_of(contrast) / deviations_in_median;
        std::vector<std::size_t> found;
        for (std::size_t i = 1; i + 1 < n; ++i) {
            if (contrast[i] > most && contrast[i] >= contrast[i - 1] && contrast[i] > contrast[i + 1])
                found.push_back(i);
        }
        for (std::size_t k = 0; k < found.size(); ++k) {
            const bool crowded = k + most_near < found.size() && found[k + most_near] - found[k] <= near;
            const bool crowded_before = k >= most_near && found[k] - found[k - most_near] <= near;
            if (crowded || crowded_before) continue;
            rate[found[k]] = 0.5 * (rate[found[k] - 1] + rate[found[k] + 1]);
        }
        if (found.empty()) break;
    }
    return rate;
}

class Search {
   public:
    Search(std::span<const double> rate, bool of_angles, const SearchOptions& options)
        : options_(options), of_angles_(of_angles) {
        out_.rate.assign(rate.begin(), rate.end());
        least_outlier_ = normal_threshold(options.outlier_level, rate.size() * (of_angles ? 2 : 1));
        least_jump_ = normal_threshold(options.jump_level, rate.size());
    }

    Searched run() {
        for (int round = 0;; ++round) {
            const Noise noise = noise_of(out_.rate);
            if (round == 0) find_disturbed(noise);
            if (!out_.findings.empty() && round == 0) break;
            if (!take_events(noise)) {
                take_outliers_of_tail(noise);
                find_stretches(noise);
                break;
            }
            const auto most = options_.most_outliers * static_cast<double>(out_.rate.size());
            if (round < options_.most_rounds && static_cast<double>(out_.findings.size()) <= most) continue;
            out_.ended = false;
            break;
        }
        std::sort(out_.findings.begin(), out_.findings.end(),
                  [](const Finding& a, const Finding& b) { return a.row < b.row; });
        return std::move(out_);
    }

   private:
    /// Takes off the least probable events; false where chance explains all that are left.
    bool take_events(const Noise& noise) {
        const std::size_t n = noise.residual.size() + 1;
        const Scan pulses = scan(Event::pulse, noise.residual, noise.variance);
        const Scan steps = scan(Event::step, noise.residual, noise.variance);
        const Scan doublets = of_angles_ ? scan(Event::doublet, noise.residual, noise.variance) : Scan();
        const Best pulse = best_of(pulses, least_outlier_, 0, n);
        const Best doublet = best_of(doublets, least_outlier_, 0, n);
        const std::size_t end = options_.end_of_jump;
        const Best step = n > 2 * end ? best_of(steps, least_jump_, end, n - end + 1) : Best();
        if (step.excess > std::max(pulse.excess, doublet.excess) && take_step(noise, steps, step.at)) return true;
        if (doublet.excess > pulse.excess) return take_all(Event::doublet, doublets, pulses);
        return pulse.excess > 0.0 && take_all(Event::pulse, pulses, doublets);
    }

    /// Takes off the event of that rate, of the size that is found at place `at` of the scan.
    void take_one(Event event, std::size_t rate, const Scan& found, std::size_t at) {
        take_off(event, rate, found.size[at], out_.rate);
        const Kind kind = event == Event::pulse && of_angles_ ? Kind::jump : Kind::outlier;
        const std::size_t row = event == Event::doublet ? rate + 1 : rate;
        out_.findings.push_back({kind, row, 1, found.size[at], std::abs(found.sigma[at]), kind == Kind::jump});
    }

    /// All events of that kind that stand out from their neighbours, and more so than events of the other kind there.
    bool take_all(Event event, const Scan& found, const Scan& competing) {
        constexpr std::size_t apart = 3;
        bool any = false;
        std::size_t last = 0;
        const std::size_t n = found.sigma.size();
        for (std::size_t t = 0; t < n; ++t) {
            const double size = std::abs(found.sigma[t]);
            if (size < least_outlier_ || (any && t < last + apart)) continue;
            bool largest = true;
            for (std::size_t k = t - std::min(t, apart); k < std::min(n, t + apart + 1); ++k) {
                largest = largest && std::abs(found.sigma[k]) <= size;
                if (k < competing.sigma.size()) largest = largest && std::abs(competing.sigma[k]) <= size;
            }
            if (!largest) continue;
            take_one(event, t, found, t);
            any = true;
            last = t;
        }
        return any;
    }

    /// The noise before a step is taken off holds a part of it for a random walk, and makes it seem smaller: its place
    /// and size are estimated again in the noise that is left without it.
    bool take_step(const Noise& noise, const Scan& steps, std::size_t at) {
        constexpr int estimates = 3;
        const noise::Spectrum& spectrum = noise.parts.noise;
        Finding found{Kind::jump, at, 1, steps.size[at], std::abs(steps.sigma[at])};
        for (int k = 0; k < estimates; ++k) {
            std::vector<double> without = out_.rate;
            take_off(Event::step, found.row, found.size, without);
            const Noise left = noise_of(without);
            const double gain = noise.parts.five.deviance - left.parts.five.deviance;
            if (!(gain > least_jump_ * least_jump_)) return false;
            const Scan again = scan(Event::step, noise::residual(spectrum, left.parts.five), left.variance);
            const std::size_t end = options_.end_of_jump;
            const Best best = best_of(again, 0.0, end, again.sigma.size() - end + 1);
            found.row = best.at;
            found.size = again.size[best.at];
            found.size_sigma = std::abs(again.sigma[best.at]);
        }
        take_off(Event::step, found.row, found.size, out_.rate);
        out_.findings.push_back(found);
        return true;
    }

    /// Outliers among the rates that the spectrum leaves out at the end of the record: by the spectrum of the last
    /// rates, in the noise of all the others. Sinusoids are not in that noise: a record that has any is left as it is.
    void take_outliers_of_tail(const Noise& noise) {
        constexpr std::size_t shares = 8;
        constexpr int most_rounds = 3;
        const std::size_t n = out_.rate.size();
        const std::size_t tail = n - noise.parts.noise.samples;
        if (tail == 0 || !noise.parts.lines.empty()) return;
        const std::size_t wanted = std::min(n, std::max(fewest_rates, shares * tail));
        const std::size_t size = noise::cosine_spectrum(std::span(out_.rate).last(wanted)).samples;
        for (int round = 0; round < most_rounds; ++round) {
            const noise::Spectrum last = noise::cosine_spectrum(std::span(out_.rate).last(size));
            const std::vector<double> residual = noise::residual(last, noise.parts.five);
            const std::vector<double> variance = noise::coefficient_variances(last, noise.parts.five);
            const Scan pulses = scan(Event::pulse, residual, variance);
            const Scan doublets = of_angles_ ? scan(Event::doublet, residual, variance) : Scan();
            const Best pulse = best_of(pulses, least_outlier_, size - tail, size);
            const Best doublet = best_of(doublets, least_outlier_, size - tail, size);
            if (pulse.excess == 0.0 && doublet.excess == 0.0) return;
            const bool two = doublet.excess > pulse.excess;
            const std::size_t at = two ? doublet.at : pulse.at;
            take_one(two ? Event::doublet : Event::pulse, at + n - size, two ? doublets : pulses, at);
        }
    }

    void find_disturbed(const Noise& noise) {
        const std::vector<double> usual = without_isolated(out_.rate);
        if (usual == out_.rate) {
            out_.findings = disturbed_stretches(whitened(noise.residual, noise.variance), options_);
        } else {
            const Noise of_usual = noise_of(usual);
            out_.findings = disturbed_stretches(whitened(of_usual.residual, of_usual.variance), options_);
        }
    }

    void find_stretches(const Noise& noise) {
        const std::vector<double> white = whitened(noise.residual, noise.variance);
        for (const Finding& stretch : stretches_of_other_variance(white, options_)) out_.findings.push_back(stretch);
    }

    const SearchOptions& options_;
    bool of_angles_;
    double least_outlier_ = 0.0;
    double least_jump_ = 0.0;
    Searched out_;
};

}  // namespace

Searched search_rates(std::span<const double> rate, bool of_angles, const SearchOptions& options) {
    if (rate.size() < fewest_rates) return {{}, {rate.begin(), rate.end()}, true};
    return Search(rate, of_angles, options).run();
}

}  // namespace ringlock::findings
