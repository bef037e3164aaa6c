#pragma once
#include <optional>
#include <vector>

#include "analysis/closure/turns/screen/dither_shape.hpp"
#include "analysis/closure/turns/screen/score_tests.hpp"
#include "analysis/record/record.hpp"

namespace ringlock::closure {

/// The parameters with the effects of the dither's shape that are in the model, estimated together from these columns;
/// none if they do not differ from those of the model.
std::optional<TurnParameters> shape_read_again(const record::Turns& turns, const TurnFit& fit);

/// The dependence of the radius of the quadrature circle on its phase.
struct RadiusFold {
    gyro::Ellipse ellipse;       ///< the best one
    Eigen::Matrix4d covariance;  ///< of gain, offset_sin, offset_cos, orthogonality_rad
    double chi2 = 0.0;           ///< of all four together
};
RadiusFold radius_fold(const record::Turns& turns, const Rows& rows);

/// The effects that these columns show and the fit does not contain yet, or all of them if `again`, each by itself.
std::vector<Candidate> screen_side_channels(const record::Turns& turns, const TurnFit& fit, const JoinedPhase& joined,
                                            bool again = false);

}  // namespace ringlock::closure
