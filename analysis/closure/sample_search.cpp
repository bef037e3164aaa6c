#include "analysis/closure/sample_search.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <complex>
#include <numeric>
#include <unsupported/Eigen/FFT>

#include "analysis/closure/chance.hpp"
#include "engine/core/units.hpp"

namespace ringlock::closure {

namespace {

using Complex = std::complex<double>;

std::size_t power_of_two(std::size_t least) {
    std::size_t n = 1;
    while (n < least) n *= 2;
    return n;
}

std::vector<Complex> transform(const std::vector<Complex>& in, bool back = false) {
    Eigen::FFT<double> fft;
    std::vector<Complex> out;
    if (back) {
        fft.inv(out, in);
    } else {
        fft.fwd(out, in);
    }
    return out;
}

/// Mean level of a periodogram about each bin: of medians, which lines do not move, over stretches of so many bins.
std::vector<double> level_about(const std::vector<double>& power, std::size_t stretch) {
    const std::size_t n = power.size();
    stretch = std::clamp<std::size_t>(stretch, 16, std::max<std::size_t>(16, n));
    std::vector<double> centres;
    std::vector<double> levels;
    for (std::size_t a = 0; a < n; a += stretch) {
        const std::size_t b = n - a < 2 * stretch ? n : a + stretch;
        std::vector<double> part(power.begin() + static_cast<std::ptrdiff_t>(a),
                                 power.begin() + static_cast<std::ptrdiff_t>(b));
        const auto middle = part.begin() + static_cast<std::ptrdiff_t>(part.size() / 2);
        std::nth_element(part.begin(), middle, part.end());
        centres.push_back(0.5 * static_cast<double>(a + b));
        levels.push_back(std::max(*middle / std::log(2.0), 1e-300));
        if (b == n) break;
    }
    std::vector<double> level(n);
    std::size_t c = 0;
    for (std::size_t i = 0; i < n; ++i) {
        const auto x = static_cast<double>(i);
        while (c + 1 < centres.size() && centres[c + 1] < x) ++c;
        if (x <= centres.front() || centres.size() == 1) {
            level[i] = levels.front();
        } else if (c + 1 >= centres.size()) {
            level[i] = levels.back();
        } else {
            const double share = (x - centres[c]) / (centres[c + 1] - centres[c]);
            level[i] = levels[c] * std::pow(levels[c + 1] / levels[c], share);
        }
    }
    return level;
}

}  // namespace

std::vector<double> periodogram(const std::vector<double>& values, std::size_t padded) {
    std::vector<double> in(values);
    in.resize(padded, 0.0);
    std::vector<Complex> out;
    Eigen::FFT<double> fft;
    fft.SetFlag(Eigen::FFT<double>::HalfSpectrum);
    fft.fwd(out, in);
    std::vector<double> power(padded / 2);
    for (std::size_t k = 0; k < power.size(); ++k) power[k] = std::norm(out[k]);
    return power;
}

std::vector<double> line_phase(std::size_t size, double rate_hz, double frequency_hz, double drift_hz_per_s) {
    std::vector<double> phase(size);
    for (std::size_t i = 0; i < size; ++i) {
        const double t = (static_cast<double>(i) - 0.5 * static_cast<double>(size - 1)) / rate_hz;
        const double turns = frequency_hz * t + 0.5 * drift_hz_per_s * t * t;
        phase[i] = units::two_pi * (turns - std::floor(turns));
    }
    return phase;
}

FoundLine find_line(const std::vector<double>& values, double rate_hz, bool drifting,
                    const std::vector<double>& known_hz, double width_hz) {
    const std::size_t n = values.size();
    const auto rows = static_cast<double>(n);
    const double duration_s = rows / rate_hz;
    const auto passed_over = [&](double hz) {
        return std::any_of(known_hz.begin(), known_hz.end(), [&](double k) { return std::abs(hz - k) < width_hz; });
    };
    FoundLine found;
    double searches = 1.0;
    // Lines that keep their frequency and phase.
    const std::size_t padded = power_of_two(2 * n);
    const auto power = periodogram(values, padded);
    const double per_bin = rows / static_cast<double>(padded);  // Fourier frequencies a bin
    const auto level =
        level_about(power, static_cast<std::size_t>(std::min(300.0, std::max(40.0, rows / 100.0)) / per_bin));
    const double bin_hz = rate_hz / static_cast<double>(padded);
    // Below eight cycles a record a line is a drift.
    for (auto k = static_cast<std::size_t>(8.0 / per_bin); k + 4 < power.size(); ++k) {
        const double chi2 = 2.0 * power[k] / level[k];
        if (chi2 <= found.chi2 || passed_over(bin_hz * static_cast<double>(k))) continue;
        found.chi2 = chi2;
        found.frequency_hz = bin_hz * static_cast<double>(k);
    }
    found.searched = 1.5 * 0.5 * rows;
    found.p_value = of_several(chi2_tail(found.chi2, 2), found.searched);
    found.chi2_still = found.chi2;
    if (!drifting) return found;
    // Lines that drift: sums of power along straight tracks over pieces, each so short that the line stays in its bin.
    double coarse_p = 1.0;
    double scattered = 0.0;
    double scattered_hz = 0.0;
    double coarse_hz = 0.0;
    double coarse_drift = 0.0;
    for (const std::size_t pieces : {8U, 64U}) {
        const std::size_t length = n / pieces;
        if (length < 256) continue;
        const std::size_t wide = power_of_two(2 * length);
        const double hz = rate_hz / static_cast<double>(wide);
        std::vector<std::vector<double>> relative;
        for (std::size_t p = 0; p < pieces; ++p) {
            const std::vector<double> part(values.begin() + static_cast<std::ptrdiff_t>(p * length),
                                           values.begin() + static_cast<std::ptrdiff_t>((p + 1) * length));
            auto s = periodogram(part, wide);
            relative.push_back(std::move(s));
        }
        std::vector<double> mean(wide / 2, 0.0);
        double used = 0.0;
        for (const auto& s : relative) {
            const double sum = std::accumulate(s.begin(), s.end(), 0.0);
            if (sum > 0.0) used += 1.0;
            for (std::size_t k = 0; k < mean.size(); ++k) mean[k] += s[k];
        }
        if (used < 3.0) continue;
        // A piece in which a part does not count is as much the less: each by its own level.
        const double bins = static_cast<double>(wide) / static_cast<double>(length);
        for (auto& s : relative) {
            const double sum = std::accumulate(s.begin(), s.end(), 0.0);
            if (sum <= 0.0) continue;
            const auto l =
                level_about(s, static_cast<std::size_t>(std::max(32.0, static_cast<double>(length) / 20.0) * bins));
            for (std::size_t k = 0; k < s.size(); ++k) s[k] *= 2.0 / l[k];
        }
        const auto most = static_cast<int>(pieces);
        double best = 0.0;
        int best_slope = 0;
        std::size_t best_bin = 0;
        const auto least = static_cast<std::ptrdiff_t>(8.0 * bins);
        for (int slope = -most; slope <= most; ++slope) {
            std::vector<std::ptrdiff_t> shift(pieces);
            for (std::size_t p = 0; p < pieces; ++p) {
                const double x = (static_cast<double>(p) + 0.5) / static_cast<double>(pieces) - 0.5;
                shift[p] = static_cast<std::ptrdiff_t>(std::lround(x * slope * bins));
            }
            const auto half = static_cast<std::ptrdiff_t>(wide / 2);
            const auto edge = std::max<std::ptrdiff_t>(std::abs(shift.front()), std::abs(shift.back()));
            for (std::ptrdiff_t k = std::max(least, edge); k < half - edge - 2; ++k) {
                double sum = 0.0;
                for (std::size_t p = 0; p < pieces; ++p) sum += relative[p][static_cast<std::size_t>(k + shift[p])];
                if (sum > best && !passed_over(hz * static_cast<double>(k))) {
                    best = sum;
                    best_slope = slope;
                    best_bin = static_cast<std::size_t>(k);
                }
            }
        }
        const double count = 1.5 * 0.5 * static_cast<double>(length) * (2.0 * most + 1.0);
        searches += count;
        const double p = of_several(chi2_tail(best, static_cast<int>(2.0 * used)), count);
        if (best - 2.0 * used > scattered && p < 1e-6) {
            scattered = best - 2.0 * used;
            scattered_hz = hz * static_cast<double>(best_bin);
        }
        if (p < coarse_p) {
            coarse_p = p;
            coarse_hz = hz * static_cast<double>(best_bin);
            coarse_drift = best_slope * bins * hz / duration_s;
        }
    }
    // About the best of either: the phase followed over the whole record.
    const auto refine = [&](double f0, double d0, double width_bins, FoundLine& line) {
        const std::size_t keep = std::min<std::size_t>(n, 4096);
        const std::size_t step = n / keep;
        const auto phase = line_phase(n, rate_hz, f0, d0);
        std::vector<Complex> low(power_of_two(8 * keep), 0.0);
        for (std::size_t i = 0; i < n; ++i)
            low[std::min(i / step, low.size() - 1)] += values[i] * std::polar(1.0, -phase[i]);
        const std::size_t slow = (n + step - 1) / step;
        const double unit = 2.0 / (duration_s * duration_s);
        const int most = static_cast<int>(std::ceil(0.5 * width_bins)) + 2;
        const double low_rate = rate_hz / static_cast<double>(step);
        const double lvl = level[std::min(level.size() - 1, static_cast<std::size_t>(f0 / bin_hz))];
        for (int quarter = -4 * most; quarter <= 4 * most; ++quarter) {
            const double d = 0.25 * quarter * unit;
            std::vector<Complex> turned(low.size(), 0.0);
            for (std::size_t i = 0; i < slow; ++i) {
                const double t = (static_cast<double>(i * step) + 0.5 * static_cast<double>(step - 1) -
                                  0.5 * static_cast<double>(n - 1)) /
                                 rate_hz;
                turned[i] = low[i] * std::polar(1.0, -units::pi * d * t * t);
            }
            const auto out = transform(turned);
            const auto reach = static_cast<std::ptrdiff_t>((width_bins + 2.0) * static_cast<double>(low.size()) /
                                                           static_cast<double>(slow));
            const auto all = static_cast<std::ptrdiff_t>(low.size());
            for (std::ptrdiff_t k = -std::min(reach, all / 2 - 1); k <= std::min(reach, all / 2 - 1); ++k) {
                const double chi2 = 2.0 * std::norm(out[static_cast<std::size_t>((k + all) % all)]) / lvl;
                if (chi2 > line.chi2) {
                    line.chi2 = chi2;
                    line.frequency_hz = f0 + low_rate * static_cast<double>(k) / static_cast<double>(all);
                    line.drift_hz_per_s = d0 + d;
                }
            }
        }
    };
    const double still_p = found.p_value;
    if (still_p < 1e-3 || coarse_p >= still_p) {
        FoundLine moved = found;
        refine(found.frequency_hz, 0.0, 6.0, moved);
        const double p = of_several(chi2_tail(moved.chi2, 2), found.searched * 30.0);
        if (p < found.p_value) {
            moved.p_value = p;
            moved.searched = found.searched * 30.0;
            found = moved;
        }
    }
    if (coarse_p < found.p_value || coarse_p < 1e-30) {
        FoundLine moved;
        moved.chi2_still = found.chi2_still;
        const double width = static_cast<double>(64);
        refine(coarse_hz, coarse_drift, width, moved);
        moved.searched = found.searched * 130.0;
        const double p = of_several(chi2_tail(moved.chi2, 2), moved.searched);
        if (moved.chi2 > found.chi2) {
            moved.p_value = std::min(p, coarse_p);
            moved.coherent = p <= coarse_p;
            found = moved;
        } else if (coarse_p < found.p_value) {
            found.p_value = coarse_p;
            found.coherent = false;
        }
    }
    found.searched = std::max(found.searched, searches);
    found.scattered = scattered;
    found.scattered_hz = scattered_hz;
    return found;
}

FoundCycle find_cycle(const std::vector<double>& innovations, const Rows& rows, double rate_hz) {
    const std::size_t n = innovations.size();
    FoundCycle found;
    for (const std::size_t lag : {0U, 1U}) {
        std::vector<double> product(n, 0.0);
        double sum = 0.0;
        double count = 0.0;
        // Products of tamed values: a few wild ones would be all that counts.
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
        const FoundLine line = find_line(product, rate_hz, false);
        double p = line.p_value;
        double hz = line.frequency_hz;
        // At half the rate there is one amplitude, not two.
        // The place of the peak to a small part of a cycle over the record.
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
        if (p < 1e-3) {
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
            found.searched = line.searched;
        }
    }
    return found;
}

int witness_lags(double rate_hz) { return std::clamp(static_cast<int>(std::lround(0.25 * rate_hz)), 2, 40); }

FoundWitness find_witness(const std::vector<double>& innovations, const Rows& rows, const SampleSeries& series) {
    const std::size_t n = innovations.size();
    const int lags = witness_lags(series.rate_hz);
    const std::size_t padded = power_of_two(2 * n);
    FoundWitness found;
    found.lags = lags;
    for (std::size_t w = 0; w < series.witnesses.size(); ++w) {
        const auto& raw = series.witnesses[w].second;
        // The witness made white by an autoregression (Levinson and Durbin), so that lags tell one thing each.
        constexpr int order = 24;
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
        // Each lag over its own standard error, whatever goes up and down together (White, Econometrica 48, 817, 1980).
        const auto products = correlation(false);
        const auto weights = correlation(true);
        const auto at = [&](std::ptrdiff_t lag) {
            const auto k = static_cast<std::size_t>((lag + static_cast<std::ptrdiff_t>(padded)) %
                                                    static_cast<std::ptrdiff_t>(padded));
            return products[k].real() / std::sqrt(std::max(weights[k].real(), 1e-300));
        };
        double chi2 = 0.0;
        for (int l = -lags; l <= lags; ++l) chi2 += at(l) * at(l);
        // The same where nothing can be: windows of lags far away tell how it is spread.
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
        if (count < 20.0) continue;
        const double m = sum / count;
        const double v = std::max(square / count - m * m, 2.0 * m * m / (2.0 * lags + 1.0));
        // Gamma of that mean and variance: v/(2 m) times chi-squared of 2 m^2/v
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

WitnessMotion fit_witness(const SampleFit& fit, const std::vector<double>& witness) {
    const std::size_t n = witness.size();
    const int lags = witness_lags(fit.series().rate_hz);
    const int taps = 2 * lags + 1;
    const double mean = std::accumulate(witness.begin(), witness.end(), 0.0) / static_cast<double>(n);
    std::vector<double> centred(n);
    for (std::size_t i = 0; i < n; ++i) centred[i] = witness[i] - mean;
    const auto white = fit.filter().apply(centred);
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
        if (!fit.rows()[i]) continue;
        for (int l = 0; l < taps; ++l)
            block(filled, l) = white[i + static_cast<std::size_t>(lags) - static_cast<std::size_t>(l)];
        target(filled++) = e[i];
        if (filled == block.rows()) flush();
    }
    flush();
    normal = normal.selfadjointView<Eigen::Lower>();
    normal.diagonal() *= 1.0 + 1e-9;
    const Eigen::VectorXd response = normal.ldlt().solve(right);
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
    // Where the angle moves most: increments over (2 sin)^2.
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
