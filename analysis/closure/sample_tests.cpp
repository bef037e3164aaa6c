#include "analysis/closure/sample_tests.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <numeric>

#include "analysis/closure/chance.hpp"
#include "analysis/closure/decision.hpp"
#include "analysis/closure/normality.hpp"
#include "analysis/closure/sample_line_search.hpp"
#include "analysis/closure/sample_lines.hpp"
#include "analysis/closure/sample_search.hpp"
#include "analysis/closure/two_levels.hpp"

namespace ringlock::closure {

namespace {

using Views = std::vector<View>;
using Columns = std::vector<std::vector<double>>;

std::vector<Regressor> regressors(const Columns& columns) { return {columns.begin(), columns.end()}; }

void test_correlation(const SampleFit& fit, Views& views) {
    views.push_back({correlations_of(fit.innovations(), fit.telling())
                         .test(Where::time, "correlation with the 24 samples before")});
}

void test_spectrum(const SampleFit& fit, Views& views) {
    const std::size_t n = fit.innovations().size();
    std::vector<double> e(n, 0.0);
    double count = 0.0;
    for (std::size_t i = 0; i < n; ++i) {
        if (!fit.telling()[i]) continue;
        e[i] = fit.innovations()[i];
        count += 1.0;
    }
    std::size_t padded = 1;
    while (padded < n) padded *= 2;
    padded *= 2;
    const auto power = periodogram(e, padded);
    double square = 0.0;
    for (const double x : e) square += x * x;
    // Frequencies that the rows that count can tell apart, a bin
    const double independent = count / static_cast<double>(padded);
    double chi2 = 0.0;
    double worst = 0.0;
    double worst_ratio = 1.0;
    double worst_hz = 0.0;
    int bands = 0;
    // Doubling from below, then 32 of equal width.
    double from = 1.0 / independent;
    const double widest = static_cast<double>(power.size()) / 32.0;
    while (from < static_cast<double>(power.size()) - 1.0) {
        const double to = std::min(static_cast<double>(power.size()), std::min(2.0 * from, from + widest));
        const auto a = static_cast<std::size_t>(from);
        const auto b = static_cast<std::size_t>(to);
        from = to;
        if (b <= a + 1) continue;
        const double ratio = std::accumulate(power.begin() + static_cast<std::ptrdiff_t>(a),
                                             power.begin() + static_cast<std::ptrdiff_t>(b), 0.0) /
                             (static_cast<double>(b - a) * square);
        const double freedom = 2.0 * static_cast<double>(b - a) * independent;
        // Wilson and Hilferty: the cube root of chi-squared is nearly normal.
        const double z = (std::cbrt(ratio) - 1.0 + 2.0 / (9.0 * freedom)) / std::sqrt(2.0 / (9.0 * freedom));
        chi2 += z * z;
        ++bands;
        if (std::abs(z) > worst) {
            worst = std::abs(z);
            worst_ratio = ratio;
            worst_hz = 0.5 * static_cast<double>(a + b) * fit.series().rate_hz / static_cast<double>(padded);
        }
    }
    views.push_back({{Where::frequency, "spectrum in bands", chi2_tail(chi2, bands),
                      fmt::format("most at {:.4g} Hz, {:.3g} times the mean", worst_hz, worst_ratio)}});
    const FoundLines lines = find_lines(e, fit.series().rate_hz);
    const FoundLine line = lines.likeliest();
    const double cost = 3.0 + std::log(line.searched);
    // A line whose power is scattered explains as much as follows it from stretch to stretch.
    const double gain = 0.5 * std::max(line.chi2, lines.scattered);
    const bool coherent = line.chi2 >= lines.scattered;
    double p = line.p_value;
    if (coherent && p < 0.01) {
        // The level about a line is itself a random number: what the regression says counts as well.
        const SampleLine refined =
            refine_line(fit, {line.frequency_hz, line.drift_hz_per_s, line.drift_hz_per_s != 0.0});
        p = std::max(p, of_several(chi2_tail(refined.chi2, 2), line.searched));
    }
    View view{{Where::frequency, "lines, still and drifting", p,
               fmt::format("at {:.6g} Hz", coherent ? line.frequency_hz : lines.scattered_hz), gain - cost},
              cost};
    if (coherent) {
        view.columns = [n, rate_hz = fit.series().rate_hz, line] {
            return regressors(line_columns(n, rate_hz, line.frequency_hz, line.drift_hz_per_s));
        };
    }
    views.push_back(std::move(view));
}

/// A variance that goes up and down at a frequency.
struct Swing {
    double cos = 0.0, sin = 0.0;  ///< of its logarithm
    double gain = 0.0;            ///< of the log-likelihood
};

/// Of the innovations: fitted by Newton's method.
Swing swing_of_variance(const SampleFit& fit, double hz) {
    const auto& e = fit.innovations();
    const auto phase = line_phase(e.size(), fit.series().rate_hz, hz, 0.0);
    Swing swing;
    double mean = 0.0;
    for (int round = 0; round < 8; ++round) {
        Eigen::Matrix3d curvature = Eigen::Matrix3d::Zero();
        Eigen::Vector3d slope = Eigen::Vector3d::Zero();
        swing.gain = 0.0;
        for (std::size_t i = 0; i < e.size(); ++i) {
            if (!fit.telling()[i]) continue;
            const Eigen::Vector3d x(1.0, std::cos(phase[i]), std::sin(phase[i]));
            const double log_variance = mean * x(0) + swing.cos * x(1) + swing.sin * x(2);
            const double ratio = e[i] * e[i] * std::exp(-log_variance);
            swing.gain += 0.5 * (e[i] * e[i] - ratio - log_variance);
            slope += 0.5 * (ratio - 1.0) * x;
            curvature += 0.5 * x * x.transpose();
        }
        const Eigen::Vector3d step = curvature.ldlt().solve(slope);
        mean += step(0);
        swing.cos += step(1);
        swing.sin += step(2);
        if (step.norm() < 1e-5) break;
    }
    return swing;
}

/// Gain where it is the readings' errors whose variance does: the noise fitted anew with it. An innovation has the
/// errors of the readings before as well, and shows less.
double gain_of_swinging_errors(const SampleFit& fit, double hz, const Swing& seen) {
    SampleModel model = fit.model();
    const auto phase = line_phase(1, fit.series().rate_hz, hz, 0.0)[0];
    // From the phase of the innovations to one that begins with the record.
    model.noise.swing_hz = hz;
    model.noise.swing_cos = seen.cos * std::cos(phase) + seen.sin * std::sin(phase);
    model.noise.swing_sin = seen.sin * std::cos(phase) - seen.cos * std::sin(phase);
    return SampleFit(fit.series(), std::move(model), fit.rows(), SampleFit::Noise::near).gain_over(fit);
}

void test_size(const SampleFit& fit, Views& views) {
    const auto& e = fit.innovations();
    const Rows& rows = fit.telling();
    const std::size_t n = e.size();
    const auto [mean, variance] = squares_of(e, rows);
    views.push_back({size_over_time(e, rows, 40, 20.0)});
    // Patterns of the place in the record: mean and size for each remainder.
    double least = 1.0;
    std::size_t at = 0;
    for (std::size_t m = 2; m <= 16; ++m) {
        double means = 0.0;
        double sizes = 0.0;
        std::vector<double> sum(m, 0.0);
        std::vector<double> squares(m, 0.0);
        std::vector<double> k(m, 0.0);
        for (std::size_t i = 0; i < n; ++i) {
            if (!rows[i]) continue;
            sum[i % m] += e[i];
            squares[i % m] += e[i] * e[i] - mean;
            k[i % m] += 1.0;
        }
        for (std::size_t j = 0; j < m; ++j) {
            if (k[j] < 20.0) continue;
            means += sum[j] * sum[j] / (k[j] * mean);
            sizes += squares[j] * squares[j] / (k[j] * variance);
        }
        const double p = std::min(chi2_tail(means, static_cast<int>(m)), chi2_tail(sizes, static_cast<int>(m) - 1));
        if (p < least) {
            least = p;
            at = m;
        }
    }
    views.push_back(
        {{Where::time, "place in the record modulo 2 to 16", of_several(least, 30.0), fmt::format("modulo {}", at)}});
    const FoundCycle cycle = find_cycle(e, rows, fit.series().rate_hz);
    const double cost = 2.0 + std::log(cycle.searched);
    const Swing swing = swing_of_variance(fit, cycle.frequency_hz);
    View view{{Where::time, std::string(repeating_variance), cycle.p_value,
               fmt::format("{:.6g} times a second", cycle.frequency_hz), swing.gain - cost}};
    view.refitted = [&fit, hz = cycle.frequency_hz, swing, cost] {
        return gain_of_swinging_errors(fit, hz, swing) - cost;
    };
    views.push_back(std::move(view));
}

void test_rates(const SampleFit& fit, Views& views) {
    const SampleSeries& series = fit.series();
    const std::size_t n = series.size();
    const auto against = [&](Where where, std::string view, Columns columns) {
        Columns taken;
        for (const auto& column : columns) taken.push_back(fit.as_taken(column));
        const auto score = fit.score(taken);
        if (score.rank == 0) return;
        const double cost = score.rank;
        views.push_back(
            {{where, std::move(view), chi2_tail(score.chi2, score.rank), "", 0.5 * score.chi2 - cost},
             cost,
             [columns = std::make_shared<const Columns>(std::move(columns))] { return regressors(*columns); }});
    };
    if (!series.temperature_change_k.empty()) {
        const auto& t = series.temperature_change_k;
        std::vector<double> square(n);
        std::vector<double> slope(n, 0.0);
        const std::size_t apart = std::max<std::size_t>(1, n / 200);
        for (std::size_t i = 0; i < n; ++i) {
            square[i] = t[i] * t[i];
            const std::size_t a = i > apart ? i - apart : 0;
            const std::size_t b = std::min(n - 1, i + apart);
            slope[i] = (t[b] - t[a]) / static_cast<double>(b - a);
        }
        against(Where::temperature, "rates that follow temperature, its square and its slope", {t, square, slope});
    }
    if (!series.input_rate_deg_h.empty()) {
        const auto& x = series.input_rate_deg_h;
        const auto [low, high] = std::minmax_element(x.begin(), x.end());
        if (*high > *low) {
            const double most = std::max(std::abs(*high), std::abs(*low));
            std::vector<double> one(n), square(n), cube(n);
            for (std::size_t i = 0; i < n; ++i) {
                one[i] = x[i] / most;
                square[i] = one[i] * one[i];
                cube[i] = one[i] * square[i];
            }
            against(Where::rate, "rates that follow the input rate, its square and its cube", {one, square, cube});
        }
    }
    std::vector<std::vector<double>> powers;
    for (int k = 1; k <= 6; ++k) {
        std::vector<double> rate(n);
        for (std::size_t i = 0; i < n; ++i) {
            rate[i] = std::cos(
                k * std::acos(std::clamp(2.0 * static_cast<double>(i) / static_cast<double>(n - 1) - 1.0, -1.0, 1.0)));
        }
        powers.push_back(std::move(rate));
    }
    against(Where::time, "rates that are polynomials of time", std::move(powers));
    std::vector<double> roots;
    double best = 0.0;
    std::size_t at = 0;
    constexpr std::size_t places = 40;
    const auto step_at = [n](std::size_t row) {
        std::vector<double> step(n, 0.0);
        std::fill(step.begin() + static_cast<std::ptrdiff_t>(row), step.end(), 1.0);
        return step;
    };
    for (std::size_t k = 1; k < places; ++k) {
        const auto score = fit.score({fit.as_taken(step_at(n * k / places))});
        const double root = score.rank > 0 ? std::copysign(std::sqrt(score.chi2), score.value[0]) : 0.0;
        roots.push_back(root);
        if (std::abs(root) > best) {
            best = std::abs(root);
            at = n * k / places;
        }
    }
    const double cost = 2.0 + std::log(davies_places(best * best, roots));
    views.push_back({{Where::time, "steps of the rate", davies_bound(best * best, roots),
                      fmt::format("at {:.6g} s", series.time_s[at]), 0.5 * best * best - cost},
                     cost,
                     [step_at, at] { return regressors({step_at(at)}); }});
}

/// A rate of one where the shape of stretches is, of zero elsewhere, with the jumps moved to where they explain most.
std::vector<double> two_level_rate(const SampleFit& fit, const Eigen::VectorXd& shape) {
    const std::size_t n = fit.series().size();
    const auto stretches = static_cast<std::size_t>(shape.size());
    std::vector<std::size_t> jumps;
    for (Eigen::Index k = 1; k < shape.size(); ++k) {
        if (shape(k) != shape(k - 1)) jumps.push_back(n * static_cast<std::size_t>(k) / stretches);
    }
    const auto rate = [&] {
        std::vector<double> out(n);
        std::size_t next = 0;
        double on = shape(0);
        for (std::size_t i = 0; i < n; ++i) {
            for (; next < jumps.size() && jumps[next] <= i; ++next) on = 1.0 - on;
            out[i] = on;
        }
        return out;
    };
    double best = fit.score({fit.as_taken(rate())}).chi2;
    const std::size_t length = std::max<std::size_t>(1, n / stretches);
    for (std::size_t step = length / 2; step > length / 50; step /= 2) {
        for (std::size_t& jump : jumps) {
            for (const bool later : {false, true}) {
                const std::size_t from = jump;
                jump = later ? std::min(n, jump + step) : jump - std::min(jump, step);
                const double chi2 =
                    std::is_sorted(jumps.begin(), jumps.end()) ? fit.score({fit.as_taken(rate())}).chi2 : 0.0;
                if (chi2 > best) {
                    best = chi2;
                } else {
                    jump = from;
                }
            }
        }
    }
    return rate();
}

/// Rates of stretches of the record, for a rate that jumps to and fro.
void test_levels(const SampleFit& fit, Views& views) {
    constexpr std::size_t stretches = 120;
    const std::size_t n = fit.series().size();
    // The filter forgets: of each stretch's series only what is not negligible.
    struct Response {
        std::size_t from = 0;
        std::vector<float> values;
    };
    std::vector<Response> responses(stretches);
    const auto& own = fit.whitened();
    const auto m = static_cast<Eigen::Index>(own.size());
    const auto k = static_cast<Eigen::Index>(stretches);
    Eigen::MatrixXd cross(m, k);
    Eigen::VectorXd right(k);
    for (std::size_t s = 0; s < stretches; ++s) {
        std::vector<double> column(n, 0.0);
        std::fill(column.begin() + static_cast<std::ptrdiff_t>(n * s / stretches),
                  column.begin() + static_cast<std::ptrdiff_t>(n * (s + 1) / stretches), fit.series().interval_s);
        column = fit.filter().apply(fit.as_taken(column));
        double most = 0.0;
        for (const double x : column) most = std::max(most, std::abs(x));
        std::size_t last = n;
        while (last > 0 && std::abs(column[last - 1]) < 1e-5 * most) --last;
        // Of a resampled record it begins with the source's interval before.
        responses[s].from = n * s / stretches - std::min<std::size_t>(n * s / stretches, 4);
        double sum = 0.0;
        for (std::size_t i = responses[s].from; i < last; ++i) {
            if (!fit.telling()[i]) column[i] = 0.0;
            responses[s].values.push_back(static_cast<float>(column[i]));
            sum += column[i] * fit.innovations()[i];
        }
        right(static_cast<Eigen::Index>(s)) = sum;
        for (Eigen::Index c = 0; c < m; ++c) {
            double product = 0.0;
            const auto& w = own[static_cast<std::size_t>(c)];
            for (std::size_t i = responses[s].from; i < last; ++i) product += column[i] * w[i];
            cross(c, static_cast<Eigen::Index>(s)) = product;
        }
    }
    Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(k, k);
    for (std::size_t a = 0; a < stretches; ++a) {
        for (std::size_t b = a; b < stretches; ++b) {
            const Response& x = responses[a];
            const Response& y = responses[b];
            const std::size_t last = std::min(x.from + x.values.size(), y.from + y.values.size());
            double sum = 0.0;
            for (std::size_t i = y.from; i < last; ++i)
                sum += static_cast<double>(x.values[i - x.from]) * static_cast<double>(y.values[i - y.from]);
            normal(static_cast<Eigen::Index>(a), static_cast<Eigen::Index>(b)) = sum;
            normal(static_cast<Eigen::Index>(b), static_cast<Eigen::Index>(a)) = sum;
        }
    }
    normal -= cross.transpose() * fit.covariance() * cross;
    const TwoLevels found = two_levels(normal, right);
    // Jumps do not wait for the end of a stretch.
    constexpr double of_places = 2.0;
    const double cost = found.cost + of_places * found.changes;
    views.push_back({{Where::time, "a rate that jumps between two levels", found.p_value,
                      fmt::format("{} jumps", found.changes), found.merit},
                     cost,
                     [&fit, found] { return regressors({two_level_rate(fit, found.shape)}); },
                     std::numeric_limits<double>::infinity(),
                     true});
}

/// A line that is not what it was: its amplitudes in stretches. By chance, of the cosine in that column.
double line_over_time(const SampleFit& fit, std::size_t cosine) {
    constexpr std::size_t stretches = 20;
    const std::size_t n = fit.innovations().size();
    const auto& columns = fit.model().columns;
    const auto x = fit.filter().apply(*columns[cosine].series);
    const auto y = fit.filter().apply(*columns[cosine + 1].series);
    double chi2 = 0.0;
    int freedom = -2;
    for (std::size_t s = 0; s < stretches; ++s) {
        double xx = 0.0, xy = 0.0, yy = 0.0, xe = 0.0, ye = 0.0;
        for (std::size_t i = n * s / stretches; i < n * (s + 1) / stretches; ++i) {
            if (!fit.rows()[i]) continue;
            const double e = fit.innovations()[i];
            xx += x[i] * x[i];
            xy += x[i] * y[i];
            yy += y[i] * y[i];
            xe += x[i] * e;
            ye += y[i] * e;
        }
        const double det = xx * yy - xy * xy;
        if (!(det > 1e-6 * xx * yy)) continue;
        chi2 += (yy * xe * xe - 2.0 * xy * xe * ye + xx * ye * ye) / det;
        freedom += 2;
    }
    return freedom > 0 ? chi2_tail(chi2, freedom) : 1.0;
}

void test_lines(const SampleFit& fit, Views& views) {
    const auto& columns = fit.model().columns;
    const auto lines = std::count_if(columns.begin(), columns.end(), [](const auto& c) { return c.name == "cosine"; });
    if (lines == 0) return;
    views.push_back({{Where::amplitude, "amplitude and phase of the lines over time", unsteady_line(fit).p_value, ""}});
}

void test_jumps(const SampleFit& fit, Views& views) {
    if (!fit.model().walk && !fit.model().flicker) return;
    const std::size_t n = fit.innovations().size();
    std::vector<double> step(n, 0.0);
    std::fill(step.begin() + static_cast<std::ptrdiff_t>(n / 2), step.end(), fit.series().interval_s);
    if (const auto test = jumps_of_rate(fit.innovations(), fit.rows(), fit.filter().apply(step))) {
        views.push_back({*test});
    }
}

void test_distribution(const SampleFit& fit, double lattice_arcsec, Views& views) {
    const auto& e = fit.innovations();
    const std::size_t n = e.size();
    // Steps that are not small are no normal noise; sums of them are.
    const bool steps = lattice_arcsec > 0.2 * fit.sd(n / 2);
    if (const auto test = fourth_moments(e, fit.telling(), steps ? 16 : 1)) views.push_back({*test});
    if (lattice_arcsec == 0.0) {
        // No two values of so many digits are the same by chance, the largest least of all.
        const auto& x = fit.series().increment;
        const double high = *std::max_element(x.begin(), x.end());
        const double low = *std::min_element(x.begin(), x.end());
        const double tolerance = 1e-9 * (high - low);
        const auto ties =
            std::count_if(x.begin(), x.end(), [&](double v) { return v > high - tolerance || v < low + tolerance; });
        if (ties > 4) {
            views.push_back(
                {{Where::amplitude, "values at the end of their range", 0.0, fmt::format("{} of them", ties)}});
        }
    }
}

}  // namespace

Disturbed find_disturbed(const SampleFit& fit) {
    const auto& e = fit.innovations();
    const std::size_t n = e.size();
    const std::size_t length = std::max<std::size_t>(50, n / 500);
    const std::size_t windows = n / length;
    std::vector<double> power(windows, 0.0);
    for (std::size_t w = 0; w < windows; ++w) {
        // About their mean: a rate that is another than elsewhere disturbs nothing.
        double sum = 0.0;
        double squares = 0.0;
        double count = 0.0;
        for (std::size_t i = w * length; i < (w + 1) * length; ++i) {
            if (fit.filter().settled(i)) continue;
            sum += e[i];
            squares += e[i] * e[i];
            count += 1.0;
        }
        if (count > 1.0) power[w] = (squares - sum * sum / count) / (count - 1.0);
    }
    auto sorted = power;
    const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(windows / 2);
    std::nth_element(sorted.begin(), middle, sorted.end());
    const double usual = std::max(*middle, 1e-300);
    Disturbed disturbed;
    disturbed.rows.assign(n, 0);
    disturbed.length_s = static_cast<double>(length) * fit.series().interval_s;
    double count = 0.0;
    for (std::size_t w = 0; w < windows; ++w) {
        const double ratio = power[w] / usual;
        const double p = of_several(chi2_tail(ratio * static_cast<double>(length), static_cast<int>(length)),
                                    static_cast<double>(windows));
        if (ratio > disturbed.worst) {
            disturbed.worst = ratio;
            disturbed.at_s = fit.series().time_s[w * length];
            disturbed.p_value = p;
        }
        if (ratio < 2.0 || p > 1e-6) continue;
        // What comes up and goes down reaches into its neighbours.
        const std::size_t a = w > 0 ? (w - 1) * length : 0;
        const std::size_t b = w + 2 < windows ? (w + 2) * length : n;
        for (std::size_t i = a; i < b; ++i) disturbed.rows[i] = 1;
    }
    for (const auto row : disturbed.rows) count += row;
    disturbed.share = count / static_cast<double>(n);
    return disturbed;
}

UnsteadyLine unsteady_line(const SampleFit& fit) {
    UnsteadyLine least;
    double lines = 0.0;
    const auto& columns = fit.model().columns;
    for (std::size_t c = 0; c + 1 < columns.size(); ++c) {
        if (columns[c].name != "cosine") continue;
        lines += 1.0;
        const double p = line_over_time(fit, c);
        if (least.step >= 0 && p >= least.p_value) continue;
        least = {columns[c].step, columns[c].hz, p, false};
    }
    least.p_value = of_several(least.p_value, std::max(lines, 1.0));
    if (least.step < 0) return least;
    std::vector<double> e(fit.innovations().size(), 0.0);
    for (std::size_t i = 0; i < e.size(); ++i) {
        if (fit.telling()[i]) e[i] = fit.innovations()[i];
    }
    const FoundLines left = find_lines(e, fit.series().rate_hz);
    const FoundLine line = left.likeliest();
    constexpr double near_hz = 1.0;
    const double hz = line.chi2 >= left.scattered ? line.frequency_hz : left.scattered_hz;
    least.beside = line.p_value < level_of_residual && std::abs(hz - least.hz) < near_hz;
    return least;
}

double refitted_merit(const SampleFit& fit, const View& view, double of_a_coefficient) {
    SampleModel model = fit.model();
    const auto columns = view.columns();
    for (const auto& column : columns) {
        model.columns.push_back({"", "view", std::make_shared<const std::vector<double>>(column.series)});
        model.columns.back().of_rate = view.test.where != Where::frequency;
    }
    const SampleFit with(fit.series(), std::move(model), fit.rows(), SampleFit::Noise::near);
    return with.gain_over(fit) - view.cost - of_a_coefficient * static_cast<double>(columns.size());
}

std::vector<View> view_samples(const SampleFit& fit, double lattice_arcsec) {
    Views views;
    test_correlation(fit, views);
    test_spectrum(fit, views);
    test_size(fit, views);
    test_rates(fit, views);
    test_levels(fit, views);
    test_lines(fit, views);
    test_jumps(fit, views);
    test_distribution(fit, lattice_arcsec, views);
    if (!fit.series().witnesses.empty()) {
        const FoundWitness witness = find_witness(fit.innovations(), fit.telling(), fit.series());
        if (witness.lags > 0 && !witness.name.empty()) {
            views.push_back(
                {{Where::frequency, "witnesses at lags up to a quarter of a second", witness.p_value, witness.name}});
        }
    }
    return views;
}

}  // namespace ringlock::closure
