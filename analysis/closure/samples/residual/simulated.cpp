#include "analysis/closure/samples/residual/simulated.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>
#include <string>

#include "analysis/closure/options.hpp"
#include "analysis/closure/samples/model/lanes.hpp"
#include "engine/core/dense.hpp"
#include "engine/core/interrupt.hpp"
#include "engine/core/units.hpp"
#include "engine/random/stream.hpp"

namespace ringlock::closure {

namespace {

/// Errors of counts at successive latches.
class CountErrors {
   public:
    CountErrors(const SampleNoise& noise, double latch_hz, random::NormalStream& normal)
        : normal_(normal),
          error_(noise.count_error),
          steps_a_latch_(error_.hz / latch_hz),
          // The first harmonic of a phase that diffuses by D a second has the width 2 pi D/q^2. The counted angle has
          // the random walk of the angle that is read, and the one that a compensator has subtracted from it.
          walk_(std::sqrt(std::max(0.0, error_.width_hz / units::two_pi -
                                            std::pow(noise.rate_arcsec_rt_s / error_.step_arcsec, 2)) /
                          latch_hz)),
          // Uniform within a step.
          angle_(units::two_pi * normal()) {}

    /// \param turned_arcsec  rotation since the count before, apart from the mean rate
    void advance(double turned_arcsec) {
        before_ = now_;
        angle_ += steps_a_latch_ + turned_arcsec / error_.step_arcsec + walk_ * normal_();
        angle_ -= std::floor(angle_);
        const double jitter_arcsec = error_.jitter_arcsec > 0.0 ? error_.jitter_arcsec * normal_() : 0.0;
        const double counted = angle_ + jitter_arcsec / error_.step_arcsec;
        now_ = jitter_arcsec + error_.step_arcsec * (0.5 - (counted - std::floor(counted)));
    }
    double at(double share) const { return (1.0 - share) * before_ + share * now_; }

   private:
    random::NormalStream& normal_;
    const SampleNoise::CountError error_;
    double steps_a_latch_, walk_;
    double angle_;  ///< in steps
    double before_ = 0.0, now_ = 0.0;
};

using Root = Eigen::MatrixXd;

/// A matrix root of a covariance, which may be singular.
Root root_of(const SampleStates::Matrix& covariance, int count) {
    Eigen::MatrixXd matrix(count, count);
    for (int i = 0; i < count; ++i) {
        for (int j = 0; j < count; ++j) matrix(i, j) = covariance[i][j];
    }
    const dense::SymmetricEigen root = dense::symmetric_eigen(matrix);
    return root.vectors * root.values.cwiseMax(0.0).cwiseSqrt().asDiagonal();
}

Eigen::VectorXd normals(int count, random::NormalStream& normal) {
    Eigen::VectorXd values(count);
    for (int i = 0; i < count; ++i) values(i) = normal();
    return values;
}

/// The noise without the error of counts in states and white errors: it is in the simulated counts.
SampleNoise without_counts(SampleNoise noise) {
    const SampleNoise::CountError& error = noise.count_error;
    double others = error.step_arcsec * error.step_arcsec / 12.0 + error.jitter_arcsec * error.jitter_arcsec;
    for (int m = 1; m <= error.harmonics; ++m) others -= 0.5 * std::pow(error.amplitude_arcsec(m), 2);
    noise.angle_arcsec = std::sqrt(std::max(0.0, noise.angle_arcsec * noise.angle_arcsec - others));
    noise.count_error = {};
    noise.kicks = {};
    noise.swing_hz = 0.0;
    return noise;
}

/// Increments of the random part of the model.
std::vector<double> simulated_noise(const SampleFit& fit, random::NormalStream& normal) {
    const SampleNoise& noise = fit.model().noise;
    const double interval_s = fit.series().interval_s;
    const SampleStates states(without_counts(noise), interval_s);
    const int d = states.count;
    Eigen::MatrixXd f(d, d);
    for (int i = 0; i < d; ++i) {
        for (int j = 0; j < d; ++j) f(i, j) = states.f[i][j];
    }
    const Root root = root_of(states.q, d);
    Eigen::VectorXd x = root_of(states.start, d) * normals(d, normal);
    const double latch_hz = states.resampled ? noise.from_hz : noise.count_error.latch_hz;
    CountErrors counts(noise, latch_hz, normal);
    counts.advance(0.0);
    double latched = 1.0;
    std::vector<double> increments;
    double before = 0.0;
    const std::size_t rows = fit.series().size();
    const auto take = [&](int ticks, double share) {
        double angle_arcsec = x(0);
        for (int k = 0; k < ticks; ++k) {
            x = f * x + root * normals(d, normal);
            if (!states.resampled) break;
            counts.advance(x(0) - angle_arcsec);
            angle_arcsec = x(0);
        }
        double reading = std::sqrt(states.floor) * normal();
        if (states.resampled) {
            reading += (1.0 - share) * x(d - 2) + share * x(d - 1) + counts.at(share);
        } else {
            for (int i = 0; i < d; ++i) reading += states.h[i] * x(i);
            const double at = latch_hz * interval_s * static_cast<double>(increments.size() + 1);
            const double each_arcsec = (x(0) - angle_arcsec) / (latch_hz * interval_s);
            for (; latched < at; ++latched) counts.advance(each_arcsec);
            reading += counts.at(1.0 - (latched - at));
        }
        increments.push_back(reading - before);
        before = reading;
    };
    filter_gains(states, rows, [&](const SampleGains& row) { take(row.ticks, row.share); });
    while (increments.size() < rows) take(1, 0.0);
    return increments;
}

/// Residual tests of a record that is simulated by the model.
SampleResidualTests simulated_tests(const SampleFit& fit, double lattice_arcsec, std::uint64_t number) {
    constexpr std::uint64_t seed = 0;
    random::NormalStream normal({seed, number}, random::Purpose::bootstrap);
    SampleSeries series = fit.series();
    series.increment = simulated_noise(fit, normal);
    const std::vector<double> known = fit.determined();
    for (std::size_t i = 0; i < known.size(); ++i) series.increment[i] += known[i];
    const SampleFit simulated(series, fit.model(), fit.rows(), SampleFit::Noise::held);
    return test_residual(simulated, lattice_arcsec);
}

}  // namespace

void correct_for_counts(const SampleFit& fit, double lattice_arcsec, SampleResidualTests& tests) {
    if (fit.model().noise.count_error.harmonics == 0) return;
    const int records = options.samples.count_error.simulated_records;
    std::map<std::string, double> mean;  // of -log(p)
    for (int k = 0; k < records; ++k) {
        check_interrupt();
        for (const SampleResidualTest& test : simulated_tests(fit, lattice_arcsec, static_cast<std::uint64_t>(k))) {
            mean[test.result.subject] -= std::log(std::max(test.result.p_value, 1e-300)) / records;
        }
    }
    for (SampleResidualTest& test : tests) {
        const auto found = mean.find(test.result.subject);
        if (found == mean.end() || found->second <= 1.0) continue;
        test.result.p_value = std::pow(test.result.p_value, 1.0 / found->second);
    }
}

}  // namespace ringlock::closure
