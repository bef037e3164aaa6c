#include "analysis/noise/losses/fit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "analysis/noise/claims.hpp"
#include "analysis/noise/decomposition.hpp"
#include "analysis/noise/losses/present_information.hpp"
#include "analysis/noise/losses/settle.hpp"
#include "analysis/noise/model/rounding.hpp"
#include "engine/core/error.hpp"

namespace ringlock::noise {
namespace {

/// Pairs of solutions: so many that the chance of the draws adds a tenth at most to the variance of a contrast of the
/// spectrum (LostInformation), and in a short record, where they cost little, more.
std::size_t pairs_for(const LossyRates& rates) {
    const auto all = static_cast<double>(rates.rate.size());
    const double lost = static_cast<double>(rates.unknowns()) / all;
    const double draws = 10.0 * std::pow(lost / (1.0 - lost), 2);
    const double cheap = std::min(8.0, 1e5 / all);
    return static_cast<std::size_t>(std::clamp(std::max(cheap, 0.5 * (draws + 1.0)), 2.0, 16.0));
}

class LossyFit {
   public:
    LossyFit(LossyRates rates, std::size_t pairs, double tau0_s, const Options& options)
        : filling_(std::move(rates), pairs), tau0_s_(tau0_s), options_(options) {}

    CompletedFit run(double largest_rate) {
        CompletedFit out{{}, false, filling_.rates().rate};
        try {
            out.fit = fitted(largest_rate, out.rate);
        } catch (const GivenUp&) {
            out.given_up = true;
            out.fit.reason = "the gaps of the record take too long to be filled in";
        }
        return out;
    }

   private:
    NoiseFit fitted(double largest_rate, std::vector<double>& completed) {
        NoiseFit out;
        out.samples = filling_.rates().rate.size() - filling_.rates().unknowns();
        if (only_rounding(filling_.bridged(), largest_rate)) {
            out.reason = "the record shows no noise above the rounding of its numbers";
            return out;
        }
        all_terms();
        const Likelihood likelihood(parts_.noise);
        Claims claims(likelihood, parts_, options_);
        Filled of_values = values(claims);
        completed = filling_.completed();
        const Likelihood of_claimed(of_values.expected);
        claims.estimate_from(of_claimed);
        claims.describe(tau0_s_, out);
        out.goodness =
            goodness_of_fit(of_values.sample, claims.estimate(), parts_.lines, tau0_s_, options_.misfit_threshold);
        out.described = out.goodness.accepted;
        out.reason = out.goodness.reason;
        return out;
    }
    const Maximum& maximum() const {
        return parts_.markov.supported(options_.significance) ? parts_.markov.best : parts_.five;
    }
    RecordModel decomposed(Spectrum spectrum) {
        spectrum.lost = lost_;
        parts_ = decompose(std::move(spectrum), options_.significance);
        return record_model(parts_.noise, maximum(), parts_.lines);
    }
    /// Parts of the record with all terms and what is lost of their information; twice, because what is lost decides
    /// whether correlated noise is among them.
    void all_terms() {
        auto first = std::make_shared<LostInformation>();
        first->share_present = filling_.share_present();
        lost_ = first;
        model_ = decomposed(filling_.bridged());
        settle(filling_, model_, [&](const Filled& filled) { return decomposed(filled.expected); });
        measure_loss();
        Filled last = settle(filling_, model_, [&](const Filled& filled) { return decomposed(filled.expected); });
    }
    void measure_loss() {
        Maximum at = maximum();
        if (!(at.theta[correlated] > 0.0) && parts_.markov.evidence > 0.0) at.theta = parts_.markov.best.theta;
        const std::size_t pairs = std::clamp<std::size_t>(50000 / filling_.rates().rate.size(), 1, 4);
        auto measured = std::make_shared<LostInformation>(
            present_information(parts_.noise, at, model_.noise(), filling_.rates().gaps, pairs));
        measured->share_present = filling_.share_present();
        measured->draws = filling_.draws();
        lost_ = measured;
    }
    /// The record filled in under the model that the values are of, without its lines.
    Filled values(const Claims& claims) {
        Model wanted = model_of(claims.terms());
        wanted.restricted = true;
        const LineFinder finder(filling_.rates().rate.size());
        const auto without_lines = [&](Spectrum& spectrum) {
            spectrum.lost = lost_;
            for (const Line& line : parts_.lines) finder.add(line, -1.0, spectrum.z);
            spectrum.sum_bins();
        };
        Maximum at = claims.estimate();
        RecordModel model = record_model(parts_.noise, at, parts_.lines);
        Filled out = settle(filling_, model, [&](const Filled& filled) {
            Spectrum rest = filled.expected;
            without_lines(rest);
            at = Likelihood(rest).maximise(wanted, &at.theta);
            return record_model(rest, at, parts_.lines);
        });
        without_lines(out.expected);
        without_lines(out.sample);
        return out;
    }

    Filling filling_;
    double tau0_s_;
    const Options& options_;
    Decomposition parts_;
    RecordModel model_;
    std::shared_ptr<const LostInformation> lost_;
};

/// Angle that the rates reach, over tau0: the rounding of the data is that of their angles.
double largest_angle(const LossyRates& rates, double tau0_s) {
    double largest = 0.0;
    double sum = 0.0;
    for (const double r : rates.rate) {
        sum += r * tau0_s;
        largest = std::max(largest, std::abs(sum));
    }
    return largest;
}

}  // namespace

NoiseFit fit_noise(const allan::Phase& phase, double tau0_s, const Options& options) {
    if (phase.whole()) return fit_noise(phase.x, tau0_s, options);
    return fit_and_complete(lossy_rates(phase, tau0_s), tau0_s, options).fit;
}

CompletedFit fit_and_complete(const LossyRates& rates, double tau0_s, const Options& options) {
    if (!(tau0_s > 0.0) || !std::isfinite(tau0_s)) {
        throw InputError(fmt::format("sampling interval {} s: must be a positive number", tau0_s));
    }
    for (std::size_t i = 0; i < rates.rate.size(); ++i) {
        if (!std::isfinite(rates.rate[i])) {
            throw InputError(fmt::format("rate {} of the record is {}: must be finite", i + 1, rates.rate[i]));
        }
    }
    const std::size_t present = rates.rate.size() - rates.unknowns();
    if (present < std::max<std::size_t>(8, options.fewest_samples)) {
        CompletedFit out{{}, false, rates.rate};
        out.fit.samples = present;
        out.fit.reason = fmt::format("{} increments: at least {} are needed", present, options.fewest_samples);
        return out;
    }
    LossyRates used = rates.first(cosine_spectrum(rates.rate).samples);
    const std::size_t pairs = pairs_for(used);
    CompletedFit out = LossyFit(std::move(used), pairs, tau0_s, options).run(largest_angle(rates, tau0_s) / tau0_s);
    out.rate.insert(out.rate.end(), rates.rate.begin() + static_cast<std::ptrdiff_t>(out.rate.size()),
                    rates.rate.end());
    return out;
}

bool fitted_as_a_whole(const LossyRates& rates) {
    const auto all = static_cast<double>(rates.rate.size());
    return rates.rate.size() <= most_lossy_rates &&
           all - static_cast<double>(rates.unknowns()) >= least_share_present * all;
}

}  // namespace ringlock::noise
