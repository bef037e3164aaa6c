#pragma once
#include <limits>
#include <span>

#include "analysis/noise/model/likelihood.hpp"

namespace ringlock::noise {

/// What the samples that are missing take of the information on the parameters.
///
/// Where missing samples are filled in, the likelihood of the completed record is too sharp: it counts them as data.
/// With the Fisher information of a completed record and that of the samples that are there, the variance of a
/// parameter, all others of its model free, is larger by
///     inflation = [(information there)^-1]_kk / [(information of a completed record)^-1]_kk >= 1,
/// and as much too large is a rise of the completed deviance along that parameter: 1/(1 - fraction of missing
/// information), the 1 + r of D. Rubin, Multiple Imputation (1987), and of X.-L. Meng and D. Rubin, Biometrika 79
/// (1992) 103.
struct LostInformation {
    std::array<Parameters, parameter_count> complete{};  ///< by pairs of parameters, any scale of each
    std::array<Parameters, parameter_count> present{};   ///< of the samples that are there, on the same scales
    double ramp_inflation = 1.0;
    double share_present = 1.0;  ///< of the record
    /// Draws that the missing samples were filled in with. Their chance adds (sqrt(inflation) - 1)^2/draws to the
    /// variance, relatively: where a share f is lost one by one, a contrast of the spectrum has inflation 1/(1 - f)^2,
    /// the score of the data a variance of (1 - f)^2, and that of the draws f^2/draws.
    double draws = std::numeric_limits<double>::infinity();

    /// Of parameter `which`, one of `terms`, which are all free.
    double inflation(std::span<const std::size_t> terms, std::size_t which) const;
    /// The same in the model of these terms; the share of missing samples where the parameter is unknown.
    double inflation(const Model& model, std::size_t which) const;
};

}  // namespace ringlock::noise
