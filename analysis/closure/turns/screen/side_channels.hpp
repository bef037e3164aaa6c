#pragma once
#include <optional>
#include <vector>

#include "analysis/closure/turns/screen/dither_shape.hpp"
#include "analysis/closure/turns/screen/score_tests.hpp"
#include "analysis/record/record.hpp"

namespace ringlock::closure {

/// The shape effects that are in the model as these columns tell of them together; nothing where they tell what the
/// model has already.
std::optional<TurnParameters> shape_read_again(const record::Turns& turns, const TurnFit& fit);

/// How the radius of the quadrature circle follows its phase.
struct RadiusFold {
    gyro::Ellipse ellipse;       ///< the best one
    Eigen::Matrix4d covariance;  ///< of gain, offset_sin, offset_cos, orthogonality_rad
    double chi2 = 0.0;           ///< of all four together
};
RadiusFold radius_fold(const record::Turns& turns, const Rows& rows);

/// The effects that these columns tell of and that the fit does not have yet, or all of them `again`, each by itself.
std::vector<Candidate> screen_side_channels(const record::Turns& turns, const TurnFit& fit, const JoinedPhase& joined,
                                            bool again = false);

}  // namespace ringlock::closure
