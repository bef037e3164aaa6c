#include "analysis/closure/sample_filter.hpp"

#include <algorithm>
#include <cmath>
#include <type_traits>
#include <utility>

#include "analysis/closure/gauss_markov.hpp"
#include "engine/core/units.hpp"

namespace ringlock::closure {

namespace {

/// Calls `with` with the number of states as a constant.
template <int D = 1, class With>
void for_states(int states, With&& with) {
    if constexpr (D <= SampleFilter::most) {
        if (states == D) return with(std::integral_constant<int, D>{});
        for_states<D + 1>(states, with);
    }
}

}  // namespace

void SampleFilter::set_up(const SampleNoise& noise, double interval_s) {
    resampled_ = noise.from_hz > 0.0;
    const double dt = resampled_ ? 1.0 / noise.from_hz : interval_s;
    // States: angle, rates, resonances (two each), readings (two)
    n_ = 1;
    f_[0][0] = 1.0;
    q_[0][0] = noise.rate_arcsec_rt_s * noise.rate_arcsec_rt_s * dt;
    Matrix& p = start_;
    if (noise.walk_arcsec2_s3 > 0.0) {
        f_[0][n_] = dt;
        f_[n_][n_] = 1.0;
        q_[n_][n_] = noise.walk_arcsec2_s3 * dt;
        q_[0][n_] = q_[n_][0] = 0.5 * q_[n_][n_] * dt;
        q_[0][0] += q_[n_][n_] * dt * dt / 3.0;
        p[n_][n_] = q_[n_][n_];
        ++n_;
    }
    for (const auto& term : noise.terms) {
        if (n_ >= most - 5) break;
        const GaussMarkovStep step(term.time_s, dt);
        const double variance = term.variance_arcsec2_s2;
        f_[0][n_] = step.gain_s;
        f_[n_][n_] = step.decay;
        q_[n_][n_] = variance * step.rate_variance;
        q_[0][n_] = q_[n_][0] = variance * step.covariance_s;
        q_[0][0] += variance * step.angle_variance_s2;
        p[n_][n_] = variance;
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
    p[0][0] = readout;
    floor_ = readout;
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
        // Interpolated readings have no error of their own; digits have. They do not go with the noise: rows that are
        // settled by others would count for a smaller one.
        floor_ = noise.blur_arcsec * noise.blur_arcsec + noise.digits_arcsec * noise.digits_arcsec;
        ratio_ = interval_s * noise.from_hz;
        first_place_ = noise.from_phase;
    } else {
        h_[0] = 1.0;
        for (const int resonance : resonances) h_[resonance] = 1.0;
        swings_ = noise.swing_hz > 0.0;
        swing_by_row_ = units::two_pi * noise.swing_hz * interval_s;
        swing_cos_ = noise.swing_cos;
        swing_sin_ = noise.swing_sin;
    }
    for (int i = 0; i < n_; ++i) {
        auto& terms = nonzero_[i];
        for (int j = 0; j < n_; ++j) {
            if (f_[i][j] != 0.0) terms.at[terms.count++] = j;
        }
    }
}

template <int D>
void SampleFilter::advance(const SampleFilter& filter, std::array<double, D>& x) {
    std::array<double, D> next{};
    for (int i = 0; i < D; ++i) {
        const Terms& terms = filter.nonzero_[i];
        for (int k = 0; k < terms.count; ++k) next[i] += filter.f_[i][terms.at[k]] * x[terms.at[k]];
    }
    x = next;
}

/// Covariances and gains, row after row: row(ticks, share, variance, gain) says whether to go on.
template <int D, class Row>
void SampleFilter::run(std::size_t rows, Row&& row) const {
    using Line = std::array<double, D>;
    std::array<Line, D> p;
    std::array<Line, D> q;
    Line h;
    for (int i = 0; i < D; ++i) {
        for (int j = 0; j < D; ++j) {
            p[i][j] = start_[i][j];
            q[i][j] = q_[i][j];
        }
        h[i] = h_[i];
    }
    // P <- F (F P)' + Q, P being symmetric
    const auto step = [&] {
        std::array<Line, D> turned;
        for (int i = 0; i < D; ++i) {
            Line fp{};
            const Terms& terms = nonzero_[i];
            for (int k = 0; k < terms.count; ++k) {
                const int l = terms.at[k];
                const double f = f_[i][l];
                for (int j = 0; j < D; ++j) fp[j] += f * p[l][j];
            }
            for (int j = 0; j < D; ++j) turned[j][i] = fp[j];
        }
        for (int i = 0; i < D; ++i) {
            Line sum = q[i];
            const Terms& terms = nonzero_[i];
            for (int k = 0; k < terms.count; ++k) {
                const int l = terms.at[k];
                const double f = f_[i][l];
                for (int j = 0; j < D; ++j) sum[j] += f * turned[l][j];
            }
            p[i] = sum;
        }
    };
    double place = first_place_;
    for (std::size_t r = 0; r < rows; ++r) {
        int ticks = 1;
        if (resampled_) {
            place += ratio_;
            const double whole = std::floor(place);
            place -= whole;
            ticks = static_cast<int>(std::min(whole, 250.0));
            if constexpr (D >= 2) {
                h[D - 2] = 1.0 - place;
                h[D - 1] = place;
            }
        }
        for (int i = 0; i < ticks; ++i) step();
        Line ph{};
        for (int j = 0; j < D; ++j) {
            if (h[j] == 0.0) continue;
            for (int i = 0; i < D; ++i) ph[i] += p[j][i] * h[j];
        }
        double s = floor_;
        if (swings_) {
            const double phase = swing_by_row_ * static_cast<double>(r);
            s *= std::exp(swing_cos_ * std::cos(phase) + swing_sin_ * std::sin(phase));
        }
        for (int i = 0; i < D; ++i) s += h[i] * ph[i];
        Line gain;
        for (int i = 0; i < D; ++i) gain[i] = ph[i] / s;
        for (int i = 0; i < D; ++i) {
            for (int j = 0; j < D; ++j) p[i][j] -= gain[i] * ph[j];
        }
        if (!row(ticks, place, s, gain)) return;
    }
}

namespace {

/// Whether gains have stopped changing: each, since those of slow rates settle long after the variance has.
template <int D>
class Settling {
   public:
    bool operator()(const std::array<double, D>& gain) {
        bool same = true;
        for (int i = 0; i < D; ++i) {
            if (std::abs(gain[i] - last_[i]) > 1e-9 * std::abs(gain[i])) same = false;
        }
        last_ = gain;
        count_ = same ? count_ + 1 : 0;
        return count_ > 50;
    }

   private:
    std::array<double, D> last_{};
    int count_ = 0;
};

}  // namespace

SampleFilter::SampleFilter(const SampleNoise& noise, std::size_t rows, double interval_s) {
    set_up(noise, interval_s);
    for_states(n_, [&](auto d) {
        constexpr int D = decltype(d)::value;
        Settling<D> settled;
        run<D>(rows, [&](int ticks, double share, double variance, const std::array<double, D>& gain) {
            gain_.insert(gain_.end(), gain.begin(), gain.end());
            sd_.push_back(std::sqrt(variance));
            if (resampled_) {
                ticks_.push_back(static_cast<std::uint8_t>(ticks));
                share_.push_back(share);
            }
            return resampled_ || swings_ || !settled(gain);
        });
    });
}

SampleFilter::Many::Many(const SampleFilter& filter, std::span<const double> readings)
    : filter_(filter),
      count_(readings.size()),
      x_(static_cast<std::size_t>(filter.n_) * count_, 0.0),
      next_(x_.size()) {
    std::copy(readings.begin(), readings.end(), x_.begin());
}

void SampleFilter::Many::foretell(std::span<double> readings) {
    const std::size_t count = count_;
    std::fill(readings.begin(), readings.end(), 0.0);
    for (int i = 0; i < filter_.n_; ++i) {
        double* to = next_.data() + static_cast<std::size_t>(i) * count;
        const Terms& terms = filter_.nonzero_[i];
        std::fill_n(to, count, 0.0);
        for (int k = 0; k < terms.count; ++k) {
            const double f = filter_.f_[i][terms.at[k]];
            const double* from = x_.data() + static_cast<std::size_t>(terms.at[k]) * count;
            for (std::size_t p = 0; p < count; ++p) to[p] += f * from[p];
        }
        if (filter_.h_[i] == 0.0) continue;
        for (std::size_t p = 0; p < count; ++p) readings[p] += filter_.h_[i] * to[p];
    }
    x_.swap(next_);
}

void SampleFilter::Many::take(std::size_t row, std::span<const double> innovations) {
    const auto n = static_cast<std::size_t>(filter_.n_);
    const double* gain = filter_.gain_.data() + std::min(row, filter_.sd_.size() - 1) * n;
    for (std::size_t i = 0; i < n; ++i) {
        double* x = x_.data() + i * count_;
        for (std::size_t p = 0; p < count_; ++p) x[p] += gain[i] * innovations[p];
    }
}

void SampleFilter::Many::continue_from(std::span<const std::uint8_t> others) {
    for (std::size_t i = 0; i < static_cast<std::size_t>(filter_.n_); ++i) {
        const double* from = x_.data() + i * count_;
        double* to = next_.data() + i * count_;
        for (std::size_t p = 0; p < count_; ++p) to[p] = from[others[p]];
    }
    x_.swap(next_);
}

std::vector<double> SampleFilter::apply(std::span<const double> increments) const {
    std::vector<double> out(increments.size());
    for_states(n_, [&](auto d) {
        constexpr int D = decltype(d)::value;
        std::array<double, D> x{};
        std::array<double, D> h;
        for (int i = 0; i < D; ++i) h[i] = h_[i];
        double before = 0.0;
        const std::size_t rows = sd_.size();
        for (std::size_t k = 0; k < increments.size(); ++k) {
            const std::size_t g = std::min(k, rows - 1);
            const int ticks = resampled_ ? ticks_[k] : 1;
            for (int i = 0; i < ticks; ++i) advance<D>(*this, x);
            if constexpr (D >= 2) {
                if (resampled_) {
                    h[D - 2] = 1.0 - share_[k];
                    h[D - 1] = share_[k];
                }
            }
            before += increments[k];
            double e = before;
            for (int i = 0; i < D; ++i) e -= h[i] * x[i];
            const double* gain = gain_.data() + g * D;
            for (int i = 0; i < D; ++i) x[i] += gain[i] * e;
            out[k] = e / sd_[g];
        }
    });
    return out;
}

double SampleFilter::minus_log_likelihood(const SampleNoise& noise, double interval_s,
                                          std::span<const double> increments, std::span<const std::uint8_t> rows) {
    SampleFilter filter;
    filter.set_up(noise, interval_s);
    double sum = 0.0;
    double product = 1.0;  // of variances, whose logarithms cost more than all the rest
    for_states(filter.n_, [&](auto d) {
        constexpr int D = decltype(d)::value;
        std::array<double, D> x{};
        std::array<double, D> h;
        for (int i = 0; i < D; ++i) h[i] = filter.h_[i];
        double before = 0.0;
        std::size_t k = 0;
        std::array<double, D> kept{};
        double variance_kept = 1.0;
        const auto take = [&](int ticks, double share, double variance, const std::array<double, D>& gain) {
            for (int i = 0; i < ticks; ++i) advance<D>(filter, x);
            if constexpr (D >= 2) {
                if (filter.resampled_) {
                    h[D - 2] = 1.0 - share;
                    h[D - 1] = share;
                }
            }
            before += increments[k];
            double e = before;
            for (int i = 0; i < D; ++i) e -= h[i] * x[i];
            for (int i = 0; i < D; ++i) x[i] += gain[i] * e;
            if (rows[k]) {
                sum += 0.5 * e * e / variance;
                product *= variance;
                if (!(product > 1e-200 && product < 1e200)) {
                    sum += 0.5 * std::log(product);
                    product = 1.0;
                }
            }
            ++k;
        };
        Settling<D> settled;
        filter.run<D>(increments.size(),
                      [&](int ticks, double share, double variance, const std::array<double, D>& gain) {
                          take(ticks, share, variance, gain);
                          kept = gain;
                          variance_kept = variance;
                          return filter.resampled_ || filter.swings_ || !settled(gain);
                      });
        while (k < increments.size()) take(1, 0.0, variance_kept, kept);
    });
    return sum + 0.5 * std::log(product);
}

}  // namespace ringlock::closure
