#include "analysis/noise/model/subsets.hpp"

#include <bit>

namespace ringlock::noise {

Model model_of(Mask mask) {
    Model m;
    for (std::size_t i = 0; i < term_count; ++i) m.has[i] = ((mask >> i) & 1u) != 0;
    m.ramp = (mask & ramp_bit) != 0;
    return m;
}

double Prices::of(Mask bit) const {
    if (bit == ramp_bit) return ramp;
    return bit == correlated_bit ? correlated : variance[static_cast<std::size_t>(std::countr_zero(bit))];
}

double Prices::of_all(Mask mask) const {
    double sum = 0.0;
    for (Mask bit = 1; bit <= ramp_bit; bit <<= 1) sum += (mask & bit) != 0 ? of(bit) : 0.0;
    return sum;
}

Subsets::Subsets(const Likelihood& likelihood, Mask all, const Parameters& start) : all_(all), fits_(ramp_bit << 1) {
    const auto better = [&](Mask mask, const Parameters& from) {
        Maximum again = likelihood.maximise(model_of(mask), &from);
        if (again.deviance < fits_[mask].deviance) fits_[mask] = again;
    };
    for (Mask mask = 1; mask < fits_.size(); ++mask) {
        if (!is_model(mask)) continue;
        const bool timed = (mask & correlated_bit) != 0;
        fits_[mask] = likelihood.maximise(model_of(mask), timed ? &start : nullptr);
        // A model is never worse than one of its parts; where the search stopped early, go on from the best part.
        for (Mask bit = 1; bit <= ramp_bit; bit <<= 1) {
            const Mask part = mask & ~bit;
            if ((mask & bit) == 0 || !is_model(part)) continue;
            if (fits_[part].deviance >= fits_[mask].deviance - 1e-6) continue;
            Parameters from = fits_[part].theta;
            if (bit == correlated_bit) from[log_time] = start[log_time];
            better(mask, from);
        }
    }
}

Mask Subsets::best(const Prices& prices, Mask wanted) const {
    Mask best = 0;
    double best_score = std::numeric_limits<double>::infinity();
    for (Mask mask = 1; mask < fits_.size(); ++mask) {
        if (!is_model(mask) || (mask & wanted) != wanted) continue;
        const double score = fits_[mask].deviance + prices.of_all(mask);
        if (score < best_score) {
            best_score = score;
            best = mask;
        }
    }
    return best;
}

}  // namespace ringlock::noise
