#include "analysis/closure/chain/shared_rate.hpp"

#include <algorithm>
#include <cmath>

#include "analysis/closure/options.hpp"
#include "analysis/closure/samples/model/source.hpp"
#include "analysis/closure/stats/p_values.hpp"

namespace ringlock::closure {

std::vector<double> rates_of_patterns(std::span<const double> found_hz, double record_rate_hz) {
    std::vector<double> all;
    for (const double found : found_hz) {
        for (const SamePattern& pattern : with_same_pattern(found, record_rate_hz)) {
            const bool known = std::any_of(all.begin(), all.end(), [&](double other_hz) {
                return same_source(pattern.hz, other_hz, record_rate_hz);
            });
            if (!known) all.push_back(pattern.hz);
        }
    }
    return all;
}

std::vector<ChainRate> ranked(const RateTable& table) {
    std::vector<ChainRate> rates;
    for (std::size_t k = 0; k < table.hz.size(); ++k) {
        ChainRate& rate = rates.emplace_back();
        rate.hz = table.hz[k];
        for (const auto& of_record : table.log_likelihood) {
            rate.log_likelihood.push_back(of_record[k]);
            rate.sum += of_record[k];
        }
    }
    std::stable_sort(rates.begin(), rates.end(), [](const ChainRate& a, const ChainRate& b) { return a.sum > b.sum; });
    if (rates.empty()) return rates;
    const ChainRate likeliest = rates.front();
    const double distinguished_up_to_hz = options.samples.contest.distinguished_up_to * table.record_rate_hz;
    const auto pattern_hz = [&](double hz) { return alias(hz, table.record_rate_hz).hz; };
    for (ChainRate& rate : rates) {
        for (std::size_t r = 0; r < rate.log_likelihood.size(); ++r) {
            rate.log_likelihood[r] -= likeliest.log_likelihood[r];
        }
        rate.sum -= likeliest.sum;
        const bool same = same_source(pattern_hz(rate.hz), pattern_hz(likeliest.hz), table.record_rate_hz);
        const bool beyond = same && rate.hz > distinguished_up_to_hz && likeliest.hz > distinguished_up_to_hz;
        rate.tied = &rate != &rates.front() && (beyond || -rate.sum < options.tie);
    }
    return rates;
}

SharedRate shared_of(std::span<const RateEstimate> rates) {
    SharedRate shared;
    if (rates.empty()) return shared;
    // Relative to the first, so that no digits are lost.
    const double about_hz = rates.front().hz;
    double information = 0.0;
    double sum = 0.0;
    for (const RateEstimate& rate : rates) {
        const double weight = 1.0 / (rate.sd_hz * rate.sd_hz);
        information += weight;
        sum += weight * (rate.hz - about_hz);
    }
    shared.mean = {about_hz + sum / information, 1.0 / std::sqrt(information)};
    for (const RateEstimate& rate : rates) shared.chi2 += std::pow((rate.hz - shared.mean.hz) / rate.sd_hz, 2);
    shared.freedom = static_cast<int>(rates.size()) - 1;
    if (shared.freedom > 0) shared.p_value = chi2_tail(shared.chi2, shared.freedom);
    return shared;
}

double p_of_wrong(double gain, std::size_t models) {
    return std::min(1.0, static_cast<double>(models) * std::exp(-gain));
}

}  // namespace ringlock::closure
