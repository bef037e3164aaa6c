#include "analysis/closure/sample_filter.hpp"

#include <cmath>

#include "engine/core/units.hpp"

namespace ringlock::closure {

SampleFilter::SampleFilter(const SampleNoise& noise, std::size_t rows, double interval_s) {
    resampled_ = noise.from_hz > 0.0;
    const double dt = resampled_ ? 1.0 / noise.from_hz : interval_s;
    // States: angle, rates, resonances (two each), readings (two)
    n_ = 1;
    f_[0][0] = 1.0;
    q_[0][0] = noise.rate_arcsec_rt_s * noise.rate_arcsec_rt_s * dt;
    Matrix p{};
    if (noise.walk_arcsec2_s3 > 0.0) {
        f_[0][n_] = dt;
        f_[n_][n_] = 1.0;
        q_[n_][n_] = noise.walk_arcsec2_s3 * dt;
        p[n_][n_] = q_[n_][n_];
        ++n_;
    }
    for (const auto& term : noise.terms) {
        if (n_ >= most - 5) break;
        const double decay = std::exp(-dt / term.time_s);
        f_[0][n_] = term.time_s * -std::expm1(-dt / term.time_s);
        f_[n_][n_] = decay;
        q_[n_][n_] = term.variance_arcsec2_s2 * -std::expm1(-2.0 * dt / term.time_s);
        p[n_][n_] = term.variance_arcsec2_s2;
        ++n_;
    }
    std::vector<int> resonances;
    for (const auto& resonance : noise.resonances) {
        if (!(resonance.arcsec > 0.0) || n_ + 4 > most) continue;
        resonances.push_back(n_);
        const double r = std::exp(-units::pi * resonance.width_hz * dt);
        const double a = 2.0 * r * std::cos(units::two_pi * resonance.hz * dt);
        const double b = r * r;
        const double v = resonance.arcsec * resonance.arcsec;
        f_[n_][n_] = a;
        f_[n_][n_ + 1] = -b;
        f_[n_ + 1][n_] = 1.0;
        // Variance over that of what drives it (Box and Jenkins, "Time Series Analysis", 1976, section 3.2.4)
        q_[n_][n_] = v * (1.0 - b) * ((1.0 + b) * (1.0 + b) - a * a) / (1.0 + b);
        p[n_][n_] = p[n_ + 1][n_ + 1] = v;
        p[n_][n_ + 1] = p[n_ + 1][n_] = v * a / (1.0 + b);
        n_ += 2;
    }
    const double readout = noise.angle_arcsec * noise.angle_arcsec;
    // The record begins at angle zero as it was read.
    p[0][0] = readout + q_[0][0];
    double floor = readout;
    if (resampled_) {
        const int r0 = n_;
        const int r1 = n_ + 1;
        f_[r0][r1] = 1.0;
        // r1 of the new tick = angle and resonance there + error; the noise of both is in q.
        f_[r1] = f_[0];
        for (int j = 0; j < n_; ++j) q_[r1][j] = q_[0][j];
        for (const int resonance : resonances) {
            for (int j = 0; j < n_; ++j) {
                f_[r1][j] += f_[resonance][j];
                q_[r1][j] += q_[resonance][j];
            }
        }
        q_[r1][r1] = q_[0][0] + readout;
        for (const int resonance : resonances) q_[r1][r1] += q_[resonance][resonance];
        for (int j = 0; j < n_; ++j) q_[j][r1] = q_[r1][j];
        n_ += 2;
        p[r0][r0] = p[r1][r1] = p[0][0] + q_[r1][r1];
        // Interpolated readings have no error of their own; digits have.
        floor = noise.blur_arcsec * noise.blur_arcsec + 1e-8 * (readout + q_[0][0]);
    } else {
        h_[0] = 1.0;
        for (const int resonance : resonances) h_[resonance] = 1.0;
    }
    for (int i = 0; i < n_; ++i) {
        for (int j = 0; j < n_; ++j) {
            if (f_[i][j] != 0.0) nonzero_[i].push_back(j);
        }
    }
    double place = noise.from_phase;
    const double ratio = resampled_ ? interval_s * noise.from_hz : 0.0;
    if (resampled_) {
        ticks_.resize(rows);
        share_.resize(rows);
    }
    double last = -1.0;
    int same = 0;
    for (std::size_t k = 0; k < rows; ++k) {
        if (resampled_) {
            place += ratio;
            const double whole = std::floor(place);
            place -= whole;
            ticks_[k] = static_cast<std::uint8_t>(std::min(whole, 250.0));
            share_[k] = place;
            for (int i = 0; i < ticks_[k]; ++i) step(p);
            h_[n_ - 2] = 1.0 - place;
            h_[n_ - 1] = place;
        } else {
            step(p);
        }
        Vector ph{};
        double s = floor;
        for (int i = 0; i < n_; ++i) {
            for (int j = 0; j < n_; ++j) ph[i] += p[i][j] * h_[j];
        }
        for (int i = 0; i < n_; ++i) s += h_[i] * ph[i];
        Vector gain{};
        for (int i = 0; i < n_; ++i) gain[i] = ph[i] / s;
        for (int i = 0; i < n_; ++i) {
            for (int j = 0; j < n_; ++j) p[i][j] -= gain[i] * ph[j];
        }
        gain_.push_back(gain);
        sd_.push_back(std::sqrt(s));
        if (resampled_) continue;
        same = std::abs(s - last) < 1e-8 * s ? same + 1 : 0;
        last = s;
        if (same > 50) break;
    }
}

void SampleFilter::step(Matrix& p) const {
    Matrix fp{};
    for (int i = 0; i < n_; ++i) {
        for (const int l : nonzero_[i]) {
            for (int j = 0; j < n_; ++j) fp[i][j] += f_[i][l] * p[l][j];
        }
    }
    for (int i = 0; i < n_; ++i) {
        for (int j = 0; j < n_; ++j) {
            double sum = q_[i][j];
            for (const int l : nonzero_[j]) sum += fp[i][l] * f_[j][l];
            p[i][j] = sum;
        }
    }
}

void SampleFilter::advance(Vector& x) const {
    Vector next{};
    for (int i = 0; i < n_; ++i) {
        for (const int l : nonzero_[i]) next[i] += f_[i][l] * x[l];
    }
    x = next;
}

std::vector<double> SampleFilter::apply(std::span<const double> increments) const {
    std::vector<double> out(increments.size());
    Vector x{};
    Vector h = h_;
    double before = 0.0;  // what of the angle has been read is taken off the states, so that nothing grows
    for (std::size_t k = 0; k < increments.size(); ++k) {
        const std::size_t g = std::min(k, gain_.size() - 1);
        if (resampled_) {
            for (int i = 0; i < ticks_[k]; ++i) advance(x);
            h[n_ - 2] = 1.0 - share_[k];
            h[n_ - 1] = share_[k];
        } else {
            advance(x);
        }
        before += increments[k];
        double e = before;
        for (int i = 0; i < n_; ++i) e -= h[i] * x[i];
        for (int i = 0; i < n_; ++i) x[i] += gain_[g][i] * e;
        out[k] = e / sd_[g];
    }
    return out;
}

}  // namespace ringlock::closure
