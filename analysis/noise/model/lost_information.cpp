#include "analysis/noise/model/lost_information.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <vector>

#include "engine/core/dense.hpp"

namespace ringlock::noise {
namespace {

/// Information on some parameters, on the scales on which that of a completed record has ones on its diagonal.
Eigen::MatrixXd information_on(const std::array<Parameters, parameter_count>& all,
                               const std::array<Parameters, parameter_count>& complete,
                               std::span<const std::size_t> terms) {
    const auto count = static_cast<Eigen::Index>(terms.size());
    Eigen::MatrixXd out(count, count);
    for (Eigen::Index a = 0; a < count; ++a) {
        for (Eigen::Index b = 0; b < count; ++b) {
            const std::size_t i = terms[static_cast<std::size_t>(a)];
            const std::size_t k = terms[static_cast<std::size_t>(b)];
            out(a, b) = all[i][k] / std::sqrt(complete[i][i] * complete[k][k]);
        }
    }
    return out;
}

}  // namespace

double LostInformation::inflation(std::span<const std::size_t> terms, std::size_t which) const {
    constexpr double most = 1e3;
    std::vector<std::size_t> known;
    for (const std::size_t i : terms) {
        if (complete[i][i] > 0.0) known.push_back(i);
    }
    const auto at = std::find(known.begin(), known.end(), which);
    if (at == known.end()) return 1.0 / share_present;
    const Eigen::Index k = at - known.begin();
    const auto variance = [&](const std::array<Parameters, parameter_count>& information) {
        const Eigen::MatrixXd matrix = information_on(information, complete, known);
        return dense::MinimumNorm(matrix).pseudo_inverse()(k, k);
    };
    const double ratio = variance(present) / variance(complete);
    const double clamped = std::isfinite(ratio) ? std::clamp(ratio, 1.0, most) : most;
    return clamped * (1.0 + std::pow(std::sqrt(clamped) - 1.0, 2) / draws);
}

double LostInformation::inflation(const Model& model, std::size_t which) const {
    std::vector<std::size_t> terms;
    for (std::size_t i = 0; i < term_count; ++i) {
        if (model.has[i]) terms.push_back(i);
    }
    if (model.has[correlated]) terms.push_back(log_time);
    return inflation(terms, which);
}

}  // namespace ringlock::noise
