#include "analysis/closure/samples/fit/swing.hpp"

#include <Eigen/Dense>
#include <cmath>
#include <utility>

#include "analysis/closure/samples/fit/line_search.hpp"
#include "engine/core/dense.hpp"

namespace ringlock::closure {

Swing swing_of_variance(const SampleFit& fit, double hz) {
    const auto& e = fit.innovations();
    const auto phase = line_phase(e.size(), fit.series().rate_hz, FrequencyTrack::still(hz));
    Swing swing;
    double mean = 0.0;
    for (int round = 0; round < 8; ++round) {
        Eigen::Matrix3d curvature = Eigen::Matrix3d::Zero();
        Eigen::Vector3d slope = Eigen::Vector3d::Zero();
        swing.gain = 0.0;
        for (std::size_t i = 0; i < e.size(); ++i) {
            if (!fit.informative()[i]) continue;
            const Eigen::Vector3d x(1.0, std::cos(phase[i]), std::sin(phase[i]));
            const double log_variance = mean * x(0) + swing.cos * x(1) + swing.sin * x(2);
            const double ratio = e[i] * e[i] * std::exp(-log_variance);
            swing.gain += 0.5 * (e[i] * e[i] - ratio - log_variance);
            slope += 0.5 * (ratio - 1.0) * x;
            curvature += 0.5 * x * x.transpose();
        }
        const Eigen::Vector3d step = dense::solve_symmetric(curvature, slope);
        mean += step(0);
        swing.cos += step(1);
        swing.sin += step(2);
        if (step.norm() < 1e-5) break;
    }
    return swing;
}

SampleFit with_swinging_errors(const SampleFit& fit, double hz, const Swing& seen) {
    SampleModel model = fit.model();
    const auto phase = line_phase(1, fit.series().rate_hz, FrequencyTrack::still(hz))[0];
    // The model's oscillation is relative to the start of the record, that of the innovations to its middle.
    model.noise.swing_hz = hz;
    model.noise.swing_cos = seen.cos * std::cos(phase) + seen.sin * std::sin(phase);
    model.noise.swing_sin = seen.sin * std::cos(phase) - seen.cos * std::sin(phase);
    return {fit.series(), std::move(model), fit.rows(), SampleFit::Noise::near};
}

}  // namespace ringlock::closure
