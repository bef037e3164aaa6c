#include "analysis/findings/clean_fit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>
#include <cmath>
#include <string>
#include <vector>

#include "analysis/findings/decided.hpp"
#include "analysis/findings/events.hpp"
#include "analysis/findings/thresholds.hpp"
#include "analysis/noise/model/likelihood.hpp"
#include "analysis/noise/model/line.hpp"
#include "analysis/noise/model/spectrum.hpp"
#include "analysis/noise/model/subsets.hpp"

namespace ringlock::findings {
namespace {

/// Why coefficients of the rest would mislead, or nothing.
std::string why_withheld(const Searched& searched) {
    if (!searched.ended) {
        return fmt::format("{} outliers and jumps were found and the search was given up", searched.findings.size());
    }
    const auto stretches = std::count_if(searched.findings.begin(), searched.findings.end(),
                                         [](const Finding& f) { return f.kind == Kind::variance; });
    if (stretches > 0) {
        return fmt::format("the noise of {} stretch{} is of another size than that of the rest", stretches,
                           stretches == 1 ? "" : "es");
    }
    return "";
}

/// A record in the cosine basis and its noise without a rate random walk.
struct WithoutWalk {
    noise::Spectrum spectrum;
    noise::Maximum fit;

    explicit WithoutWalk(std::span<const double> rate) : spectrum(noise::cosine_spectrum(rate)) {
        const noise::Likelihood likelihood(spectrum);
        fit = likelihood.maximise(noise::model_of(noise::five_terms & ~(noise::Mask{1} << noise::rate_random_walk)));
    }
};

/// The jump that is likeliest in noise without random walk, where its evidence exceeds that of the random walk.
std::optional<Finding> jump_instead_of_walk(const std::vector<double>& rate, const SearchOptions& options) {
    constexpr int estimates = 2;
    const double significance = noise::Options{}.significance;
    const double price_of_walk =
        boost::math::quantile(boost::math::complement(boost::math::chi_squared(1.0), 2.0 * significance));
    const WithoutWalk without(rate);
    const noise::Likelihood likelihood(without.spectrum);
    const double evidence_of_walk =
        without.fit.deviance - likelihood.maximise(noise::model_of(noise::five_terms)).deviance;
    const std::size_t n = without.spectrum.samples;
    const std::size_t end = options.end_of_jump;
    if (n <= 2 * end) return std::nullopt;
    noise::Maximum model = without.fit;
    Finding jump{.kind = Kind::jump};
    double gain = 0.0;
    for (int k = 0; k < estimates; ++k) {
        const Scan steps = scan(Event::step, noise::residual(without.spectrum, model),
                                noise::coefficient_variances(without.spectrum, model));
        const Best best = best_of(steps, 0.0, end, n - end + 1);
        jump.row = best.at;
        jump.size = steps.size[best.at];
        jump.size_sigma = std::abs(steps.sigma[best.at]);
        std::vector<double> left = rate;
        take_off(Event::step, jump.row, jump.size, left);
        model = WithoutWalk(left).fit;
        gain = without.fit.deviance - model.deviance;
    }
    const double threshold = normal_threshold(options.jump_level, n);
    if (gain - threshold * threshold < evidence_of_walk - price_of_walk) return std::nullopt;
    return jump;
}

}  // namespace

void decide(const std::vector<double>& rate, const SearchOptions& options, CleanFit& out) {
    if (out.noise.rrw_deg_h_rt_h.resolved && out.noise.sinusoids.empty()) {
        out.instead_of_walk = jump_instead_of_walk(rate, options);
        if (out.instead_of_walk) out.noise.rrw_deg_h_rt_h = {};
    }
    const std::string why = why_withheld(out.searched);
    if (why.empty()) return;
    out.noise.described = false;
    out.noise.reason = why;
}

CleanFit fit_without_events(std::span<const double> angle_arcsec, double tau0_s, bool of_angles,
                            const SearchOptions& options) {
    std::vector<double> rate;
    for (std::size_t i = 1; i < angle_arcsec.size(); ++i) {
        rate.push_back((angle_arcsec[i] - angle_arcsec[i - 1]) / tau0_s);
    }
    CleanFit out{search_rates(rate, of_angles, options), {}, {}};
    rate = {};
    const bool any = std::any_of(out.searched.findings.begin(), out.searched.findings.end(),
                                 [](const Finding& f) { return f.kind != Kind::variance; });
    if (any) {
        std::vector<double> cleaned{0.0};
        for (const double r : out.searched.rate) cleaned.push_back(cleaned.back() + r * tau0_s);
        out.noise = noise::fit_noise(cleaned, tau0_s);
    } else {
        out.noise = noise::fit_noise(angle_arcsec, tau0_s);
    }
    decide(out.searched.rate, options, out);
    return out;
}

}  // namespace ringlock::findings
