#pragma once
#include <functional>
#include <vector>

#include "analysis/noise/losses/filling.hpp"
#include "analysis/noise/model/line.hpp"

namespace ringlock::noise {

/// Noise and means of a record: what missing rates are filled in with.
struct RecordModel {
    std::vector<double> variance;  ///< of coefficients 1 to n - 1, less the end errors
    double angle_noise = 0.0;
    std::vector<double> means;

    CoefficientNoise noise() const { return {variance, angle_noise}; }
};

/// Gaps that take too long to be filled in.
struct GivenUp {};

/// The model of a fit: `spectrum` without lines.
RecordModel record_model(const Spectrum& spectrum, const Maximum& fit, std::span<const Line> lines);

/// Fits a record with missing rates (expectation and maximisation, A. Dempster, N. Laird, D. Rubin, J. R. Stat. Soc. B
/// 39 (1977) 1): fills in under a model, fits the completed record, until the model that comes out is the one that went
/// in. The steps are accelerated (D. Anderson, J. ACM 12 (1965) 547) on the logarithms of the variances.
/// \param begin  changed to the model under which the record was filled in last
/// \param fit    the maximum of the likelihood of a filled record
/// \return the record as it was filled in last; throws GivenUp where that takes too long
Filled settle(Filling& filling, RecordModel& begin, const std::function<RecordModel(const Filled&)>& fit);

}  // namespace ringlock::noise
