#include "analysis/closure/samples/fit/repeats_and_witness.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <complex>
#include <numeric>

#include "analysis/closure/options.hpp"
#include "analysis/closure/samples/fit/line_search.hpp"
#include "analysis/closure/stats/p_values.hpp"
#include "engine/core/dense.hpp"
#include "engine/core/units.hpp"

namespace ringlock::closure {

namespace {

using Complex = std::complex<double>;

}  // namespace

FoundCycle find_cycle(const std::vector<double>& innovations, const Rows& rows, double rate_hz) {
    const std::size_t n = innovations.size();
    FoundCycle found;
    for (const std::size_t lag : {0U, 1U}) {
        std::vector<double> product(n, 0.0);
        double sum = 0.0;
        double count = 0.0;
        // Products of clamped values: otherwise a few outliers would dominate.
        const auto tame = [](double e) { return std::clamp(e, -4.0, 4.0); };
        for (std::size_t i = lag; i < n; ++i) {
            if (!rows[i] || !rows[i - lag]) continue;
            product[i] = tame(innovations[i]) * tame(innovations[i - lag]);
            sum += product[i];
            count += 1.0;
        }
        for (std::size_t i = lag; i < n; ++i) {
            if (rows[i] && rows[i - lag]) product[i] -= sum / count;
        }
        const FoundLine line = find_still_line(product, rate_hz);
        double p = line.p_value;
        double hz = line.frequency_hz;
        // At half the rate there is one amplitude, not two.
        // The frequency of the maximum to a small part of a cycle over the record.
        const auto power_at = [&](double f) {
            const std::complex<double> turn = std::polar(1.0, units::two_pi * f / rate_hz);
            std::complex<double> total = 0.0;
            std::complex<double> phase = 1.0;
            for (std::size_t i = 0; i < n; ++i) {
                total += product[i] * phase;
                phase *= turn;
                if (i % 1024 == 0) phase /= std::abs(phase);
            }
            return std::norm(total);
        };
        if (p < options.samples.fit.refined_cycle_p) {
            double top = power_at(hz);
            for (double d = 0.25 * rate_hz / static_cast<double>(n); d > 0.004 * rate_hz / static_cast<double>(n);
                 d *= 0.5) {
                for (const double f : {hz - d, hz + d}) {
                    const double value = power_at(f);
                    if (value > top) {
                        top = value;
                        hz = f;
                    }
                }
            }
        }
        double alternating = 0.0;
        double squares = 0.0;
        for (std::size_t i = 0; i < n; ++i) {
            alternating += i % 2 == 0 ? product[i] : -product[i];
            squares += product[i] * product[i];
        }
        const double p_half = chi2_tail(alternating * alternating / squares, 1);
        if (p_half < p) {
            p = p_half;
            hz = 0.5 * rate_hz;
        }
        p = of_several(p, 4.0);
        if (p < found.p_value) {
            found.p_value = p;
            found.frequency_hz = hz;
            found.look_elsewhere = line.look_elsewhere;
        }
    }
    return found;
}

int witness_lags(double rate_hz) {
    const SampleFitOptions& fit = options.samples.fit;
    return std::clamp(static_cast<int>(std::lround(fit.witness_lag_s * rate_hz)), fit.fewest_witness_lags,
                      fit.most_witness_lags);
}

FoundWitness find_witness(const std::vector<double>& innovations, const Rows& rows, const SampleSeries& series) {
    const std::size_t n = innovations.size();
    const int lags = witness_lags(series.rate_hz);
    const std::size_t padded = power_of_two(2 * n);
    FoundWitness found;
    found.lags = lags;
    for (std::size_t w = 0; w < series.witnesses.size(); ++w) {
        const auto& raw = series.witnesses[w].second;
        // The witness is whitened by an autoregression (Levinson and Durbin), so that its lags are independent.
        constexpr int order = options.samples.fit.witness_order;
        const double mean = std::accumulate(raw.begin(), raw.end(), 0.0) / static_cast<double>(n);
        std::vector<double> r(order + 1, 0.0);
        for (int k = 0; k <= order; ++k) {
            for (std::size_t i = static_cast<std::size_t>(k); i < n; ++i)
                r[static_cast<std::size_t>(k)] += (raw[i] - mean) * (raw[i - static_cast<std::size_t>(k)] - mean);
        }
        if (r[0] <= 0.0) continue;
        r[0] *= 1.0 + 1e-6;
        std::vector<double> a(order + 1, 0.0);
        double error = r[0];
        for (int k = 1; k <= order; ++k) {
            double sum = r[static_cast<std::size_t>(k)];
            for (int j = 1; j < k; ++j) sum -= a[static_cast<std::size_t>(j)] * r[static_cast<std::size_t>(k - j)];
            const double reflection = sum / error;
            auto next = a;
            next[static_cast<std::size_t>(k)] = reflection;
            for (int j = 1; j < k; ++j)
                next[static_cast<std::size_t>(j)] =
                    a[static_cast<std::size_t>(j)] - reflection * a[static_cast<std::size_t>(k - j)];
            a = next;
            error *= 1.0 - reflection * reflection;
        }
        std::vector<double> white(n, 0.0);
        for (std::size_t i = order; i < n; ++i) {
            white[i] = raw[i] - mean;
            for (int j = 1; j <= order; ++j)
                white[i] -= a[static_cast<std::size_t>(j)] * (raw[i - static_cast<std::size_t>(j)] - mean);
        }
        const auto correlation = [&](bool squares) {
            std::vector<Complex> x(padded, 0.0);
            std::vector<Complex> y(padded, 0.0);
            for (std::size_t i = 0; i < n; ++i) {
                const double e = rows[i] ? innovations[i] : 0.0;
                x[i] = squares ? e * e : e;
                y[i] = squares ? white[i] * white[i] : white[i];
            }
            const auto fx = transform(x);
            auto fy = transform(y);
            for (std::size_t k = 0; k < padded; ++k) fy[k] = fx[k] * std::conj(fy[k]);
            return transform(fy, true);
        };
        // Each lag over its own standard error, which allows for common changes of variance (White, Econometrica 48,
        // 817, 1980).
        const auto products = correlation(false);
        const auto weights = correlation(true);
        const auto at = [&](std::ptrdiff_t lag) {
            const auto k = static_cast<std::size_t>((lag + static_cast<std::ptrdiff_t>(padded)) %
                                                    static_cast<std::ptrdiff_t>(padded));
            return products[k].real() / std::sqrt(std::max(weights[k].real(), 1e-300));
        };
        double chi2 = 0.0;
        for (int l = -lags; l <= lags; ++l) chi2 += at(l) * at(l);
        // The same in windows of lags so far away that there is no correlation: they give the distribution of chi2.
        double sum = 0.0;
        double square = 0.0;
        double count = 0.0;
        const auto far = static_cast<std::ptrdiff_t>(n / 2);
        for (std::ptrdiff_t centre = 12 * lags; centre < far; centre += 2 * lags + 1) {
            for (const int sign : {-1, 1}) {
                double q = 0.0;
                for (int l = -lags; l <= lags; ++l) q += at(sign * centre + l) * at(sign * centre + l);
                sum += q;
                square += q * q;
                count += 1.0;
            }
        }
        if (count < options.samples.fit.fewest_far_windows) continue;
        const double m = sum / count;
        const double v = std::max(square / count - m * m, 2.0 * m * m / (2.0 * lags + 1.0));
        // Gamma distribution with that mean and variance: v/(2 m) times chi-squared of 2 m^2/v
        const double p = chi2_tail(chi2 * 2.0 * m / v, std::max(1, static_cast<int>(std::lround(2.0 * m * m / v))));
        const double corrected = of_several(p, static_cast<double>(series.witnesses.size()));
        if (corrected < found.p_value || (found.name.empty())) {
            if (corrected == found.p_value && chi2 < found.chi2) continue;
            found.p_value = corrected;
            found.chi2 = chi2;
            found.name = series.witnesses[w].first;
            found.index = w;
        } else if (corrected == found.p_value && chi2 > found.chi2) {
            found.chi2 = chi2;
            found.name = series.witnesses[w].first;
            found.index = w;
        }
    }
    return found;
}

namespace {

/// The filtered witness at delays and advances of up to `lags` rows. The filter of a resampled record changes from row
/// to row: each lag is filtered by itself there, as the source would have sampled it.
class WitnessAtLags {
   public:
    WitnessAtLags(const SampleFit& fit, const std::vector<double>& witness, int lags)
        : lags_(lags), each_(fit.model().noise.from_hz > 0.0) {
        if (!each_) {
            same_ = fit.filter().apply(witness);
            return;
        }
        const auto n = static_cast<std::ptrdiff_t>(witness.size());
        for (int l = 0; l <= 2 * lags; ++l) {
            std::vector<double> late(witness.size(), 0.0);
            for (std::ptrdiff_t i = 0; i < n; ++i) {
                const std::ptrdiff_t j = i + lags - l;
                if (j >= 0 && j < n) late[static_cast<std::size_t>(i)] = witness[static_cast<std::size_t>(j)];
            }
            const auto white = fit.filter().apply(fit.as_taken(late));
            of_lag_.emplace_back(white.begin(), white.end());
        }
    }
    double at(std::size_t row, int lag) const {
        if (each_) return static_cast<double>(of_lag_[static_cast<std::size_t>(lag)][row]);
        return same_[row + static_cast<std::size_t>(lags_) - static_cast<std::size_t>(lag)];
    }

   private:
    int lags_;
    bool each_;
    std::vector<double> same_;
    std::vector<std::vector<float>> of_lag_;  ///< single precision: half as large
};

}  // namespace

WitnessMotion fit_witness(const SampleFit& fit, const std::vector<double>& witness) {
    const std::size_t n = witness.size();
    const int lags = witness_lags(fit.series().rate_hz);
    const int taps = 2 * lags + 1;
    const double mean = std::accumulate(witness.begin(), witness.end(), 0.0) / static_cast<double>(n);
    std::vector<double> centred(n);
    for (std::size_t i = 0; i < n; ++i) centred[i] = witness[i] - mean;
    const WitnessAtLags white(fit, centred, lags);
    const auto& e = fit.innovations();
    Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(taps, taps);
    Eigen::VectorXd right = Eigen::VectorXd::Zero(taps);
    Eigen::MatrixXd block(512, taps);
    Eigen::VectorXd target(512);
    Eigen::Index filled = 0;
    const auto flush = [&] {
        normal.selfadjointView<Eigen::Lower>().rankUpdate(block.topRows(filled).transpose());
        right += block.topRows(filled).transpose() * target.head(filled);
        filled = 0;
    };
    for (std::size_t i = static_cast<std::size_t>(lags); i + static_cast<std::size_t>(lags) < n; ++i) {
        if (!fit.informative()[i]) continue;
        for (int l = 0; l < taps; ++l) block(filled, l) = white.at(i, l);
        target(filled++) = e[i];
        if (filled == block.rows()) flush();
    }
    flush();
    normal = normal.selfadjointView<Eigen::Lower>();
    normal.diagonal() *= 1.0 + 1e-9;
    const Eigen::VectorXd response = dense::solve_symmetric(normal, right);
    WitnessMotion motion;
    motion.increments.assign(n, 0.0);
    for (std::size_t i = 0; i < n; ++i) {
        for (int l = 0; l < taps; ++l) {
            const auto j = static_cast<std::ptrdiff_t>(i) + lags - l;
            if (j >= 0 && j < static_cast<std::ptrdiff_t>(n))
                motion.increments[i] += response(l) * centred[static_cast<std::size_t>(j)];
        }
    }
    // Coherence of the increments with the motion, in bands: cross-spectra over pieces.
    const std::size_t length = std::min<std::size_t>(power_of_two(n / 64 + 1), 1024);
    std::vector<Complex> cross(length / 2, 0.0);
    std::vector<double> xx(length / 2, 0.0);
    std::vector<double> yy(length / 2, 0.0);
    double pieces = 0.0;
    for (std::size_t a = 0; a + length <= n; a += length) {
        std::vector<Complex> x(length);
        std::vector<Complex> y(length);
        for (std::size_t i = 0; i < length; ++i) {
            const double window =
                std::pow(std::sin(units::pi * (static_cast<double>(i) + 0.5) / static_cast<double>(length)), 2);
            x[i] = window * (fit.rest()[a + i] + (fit.model().motion.empty() ? 0.0 : fit.model().motion[a + i]));
            y[i] = window * motion.increments[a + i];
        }
        x = transform(x);
        y = transform(y);
        for (std::size_t k = 0; k < length / 2; ++k) {
            cross[k] += x[k] * std::conj(y[k]);
            xx[k] += std::norm(x[k]);
            yy[k] += std::norm(y[k]);
        }
        pieces += 1.0;
    }
    // Frequency at which the angle moves most: increments over (2 sin)^2.
    double most = 0.0;
    double angle2 = 0.0;
    const double window_power = 0.375 * static_cast<double>(length) * static_cast<double>(length);
    for (std::size_t k = 2; k + 1 < length / 2; ++k) {
        const double s = 2.0 * std::sin(units::pi * static_cast<double>(k) / static_cast<double>(length));
        const double angle = (yy[k - 1] + yy[k] + yy[k + 1]) / 3.0 / (s * s);
        angle2 += 2.0 * yy[k] / (s * s) / window_power / std::max(1.0, pieces);
        if (yy[k - 1] + yy[k] + yy[k + 1] > most && angle > 0.0) {
            most = yy[k - 1] + yy[k] + yy[k + 1];
            const Complex c = cross[k - 1] + cross[k] + cross[k + 1];
            motion.coherence = std::norm(c) / ((xx[k - 1] + xx[k] + xx[k + 1]) * most);
            motion.centre_hz = fit.series().rate_hz * static_cast<double>(k) / static_cast<double>(length);
        }
    }
    motion.rms_arcsec = std::sqrt(angle2);
    return motion;
}

}  // namespace ringlock::closure
