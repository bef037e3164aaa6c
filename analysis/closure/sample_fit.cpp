#include "analysis/closure/sample_fit.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <functional>

#include "engine/core/interrupt.hpp"
#include "engine/core/units.hpp"

namespace ringlock::closure {

namespace {

/// Nelder and Mead (Computer Journal 7, 308, 1965): smallest value of a function of a few numbers.
std::vector<double> smallest(const std::function<double(const std::vector<double>&)>& f, std::vector<double> start,
                             double size, int evaluations) {
    const std::size_t n = start.size();
    std::vector<std::pair<double, std::vector<double>>> corners{{f(start), start}};
    for (std::size_t i = 0; i < n; ++i) {
        auto corner = start;
        corner[i] += size;
        corners.emplace_back(f(corner), corner);
    }
    evaluations -= static_cast<int>(n) + 1;
    while (evaluations > 0) {
        std::sort(corners.begin(), corners.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
        if (corners.back().first - corners.front().first < 0.01) break;
        std::vector<double> centre(n, 0.0);
        for (std::size_t c = 0; c < n; ++c) {
            for (std::size_t i = 0; i < n; ++i) centre[i] += corners[c].second[i] / static_cast<double>(n);
        }
        const auto along = [&](double t) {
            std::vector<double> x(n);
            for (std::size_t i = 0; i < n; ++i) x[i] = centre[i] + t * (corners.back().second[i] - centre[i]);
            --evaluations;
            const double value = f(x);
            return std::make_pair(value, x);
        };
        auto reflected = along(-1.0);
        if (reflected.first < corners.front().first) {
            auto expanded = along(-2.0);
            corners.back() = expanded.first < reflected.first ? expanded : reflected;
        } else if (reflected.first < corners[n - 1].first) {
            corners.back() = reflected;
        } else {
            auto contracted = along(reflected.first < corners.back().first ? -0.5 : 0.5);
            if (contracted.first < std::min(reflected.first, corners.back().first)) {
                corners.back() = contracted;
            } else {
                for (std::size_t c = 1; c <= n; ++c) {
                    for (std::size_t i = 0; i < n; ++i) {
                        corners[c].second[i] = 0.5 * (corners[c].second[i] + corners[0].second[i]);
                    }
                    corners[c].first = f(corners[c].second);
                    --evaluations;
                }
            }
        }
    }
    return std::min_element(corners.begin(), corners.end(),
                            [](const auto& a, const auto& b) { return a.first < b.first; })
        ->second;
}

struct Free {
    double* value;
    bool logarithmic;
    double scale = 1.0;  ///< of its steps
};

std::vector<Free> knobs(SampleModel& model) {
    std::vector<Free> all{{&model.noise.angle_arcsec, true}, {&model.noise.rate_arcsec_rt_s, true}};
    if (model.walk) all.push_back({&model.noise.walk_arcsec2_s3, true});
    if (model.flicker) all.push_back({&model.flicker_deg_h, true});
    for (std::size_t k = 0; k < model.resonances.size(); ++k) {
        auto& resonance = model.noise.resonances[k];
        all.push_back({&resonance.arcsec, true});
        if (k > 0 && model.resonances[k] == model.resonances[k - 1]) continue;
        // A wandering line is narrow: its frequency is known to its width.
        all.push_back({&resonance.hz, true, std::min(1.0, resonance.width_hz / resonance.hz)});
        all.push_back({&resonance.width_hz, true});
    }
    if (model.noise.from_hz > 0.0) {
        all.push_back({&model.noise.from_phase, false});
        all.push_back({&model.from_shift, false});
        all.push_back({&model.noise.blur_arcsec, true});
    }
    return all;
}

}  // namespace

std::vector<SampleNoise::Term> flicker_terms(double deg_h, double shortest_s, double longest_s) {
    // As the effect simulates it, B^2/(2 pi f) by Markov rates, two a decade of time: each of the variance
    // (B^2/pi) ln(ratio) ... the integral of the density over the band that it stands for, doubled for both signs.
    std::vector<SampleNoise::Term> terms;
    const double ratio = std::sqrt(10.0);
    for (double t = shortest_s; t < longest_s * ratio && terms.size() < 10; t *= ratio) {
        terms.push_back({t, deg_h * deg_h / units::pi * std::log(ratio)});
    }
    return terms;
}

SampleFit::SampleFit(const SampleSeries& series, SampleModel model, const Rows& rows, bool free_noise)
    : series_(&series), rows_(&rows), model_(std::move(model)) {
    if (model_.columns.empty()) {
        model_.columns.push_back(
            {"", "mean_rate_deg_h", std::make_shared<std::vector<double>>(series.size(), series.interval_s)});
        double mean = 0.0;
        for (const double x : series.increment) mean += x / static_cast<double>(series.size());
        model_.columns[0].value = mean * series.rate_hz;
        double white = 0.0;
        double next = 0.0;
        for (std::size_t i = 1; i < series.size(); ++i) {
            const double a = series.increment[i - 1] - mean;
            const double b = series.increment[i] - mean;
            white += b * b / static_cast<double>(series.size());
            next += a * b / static_cast<double>(series.size());
        }
        const double angle = std::clamp(-next, 1e-3 * white, 0.499 * white);
        model_.noise.angle_arcsec = std::sqrt(angle);
        model_.noise.rate_arcsec_rt_s = std::sqrt((white - 2.0 * angle) * series.rate_hz);
    }
    filter_ = std::make_shared<SampleFilter>(model_.noise, series.size(), series.interval_s);
    take_off();
    if (free_noise) {
        fit_columns();
        fit_noise();
    }
    fit_columns();
    finish();
}

void SampleFit::take_off() {
    rest_ = series_->increment;
    if (!model_.motion.empty()) {
        for (std::size_t i = 0; i < rest_.size(); ++i) rest_[i] -= model_.motion[i];
    }
    for (const SampleColumn& column : model_.columns) {
        const auto& c = *column.series;
        for (std::size_t i = 0; i < rest_.size(); ++i) rest_[i] -= column.value * c[i];
    }
}

double SampleFit::evaluate(const SampleModel& model, std::span<const double> rest) const {
    check_interrupt();
    const SampleFilter filter(model.noise, rest.size(), series_->interval_s);
    const auto e = filter.apply(rest);
    double value = 0.0;
    for (std::size_t i = 0; i < e.size(); ++i) {
        if ((*rows_)[i]) value += 0.5 * e[i] * e[i] + std::log(filter.sd(i));
    }
    return std::isfinite(value) ? value : 1e300;
}

void SampleFit::fit_noise() {
    const double duration_s = series_->interval_s * static_cast<double>(series_->size());
    const double scale =
        std::hypot(model_.noise.angle_arcsec, model_.noise.rate_arcsec_rt_s * std::sqrt(series_->interval_s));
    // What stands at zero begins small, so that it can grow.
    if (model_.noise.angle_arcsec < 1e-4 * scale) model_.noise.angle_arcsec = 1e-2 * scale;
    if (model_.noise.rate_arcsec_rt_s * std::sqrt(series_->interval_s) < 1e-4 * scale) {
        model_.noise.rate_arcsec_rt_s = 1e-2 * scale / std::sqrt(series_->interval_s);
    }
    const auto trial = [&](const std::vector<double>& x) {
        SampleModel model = model_;
        auto free = knobs(model);
        for (std::size_t i = 0; i < free.size(); ++i)
            *free[i].value = free[i].logarithmic ? std::exp(x[i] * free[i].scale) : x[i];
        for (std::size_t k = 0; k < model.resonances.size(); ++k) {
            auto& resonance = model.noise.resonances[k];
            if (k > 0 && model.resonances[k] == model.resonances[k - 1]) {
                resonance.hz = model.noise.resonances[k - 1].hz;
                resonance.width_hz = 3.0 * model.noise.resonances[k - 1].width_hz;
            }
            if (resonance.hz > 0.5 * series_->rate_hz || resonance.width_hz > 3.0 * series_->rate_hz)
                resonance.arcsec = 0.0;
        }
        if (model.noise.from_hz > 0.0) {
            // About the middle of the record, so that rate and place are told apart.
            const double shift_hz = 0.1 * model.from_shift / duration_s;
            model.noise.from_hz += shift_hz;
            model.noise.from_phase -= 0.5 * shift_hz * duration_s;
            model.noise.from_phase -= std::floor(model.noise.from_phase);
            model.from_shift = 0.0;
        }
        if (model.flicker) {
            model.noise.terms = flicker_terms(model.flicker_deg_h, 4.0 * series_->interval_s, duration_s);
        }
        return model;
    };
    std::vector<double> start;
    for (const Free& knob : knobs(model_))
        start.push_back(knob.logarithmic ? std::log(std::max(*knob.value, 1e-300)) / knob.scale : *knob.value);
    // A long record's noise is found on a part, then on all of it.
    const auto on = [&](std::size_t n) {
        return [&, n](const std::vector<double>& x) {
            return evaluate(trial(x), std::span<const double>(rest_.data(), n));
        };
    };
    const std::size_t n = rest_.size();
    const int evaluations = 30 * static_cast<int>(start.size());
    const bool resampled = model_.noise.from_hz > 0.0;
    // What is dear is fitted to a part: a filter of n states takes n^3 operations a row while it settles, and where
    // rows lie between the source's it never does.
    const bool narrow = !model_.resonances.empty();
    const std::size_t part = std::min<std::size_t>(n, resampled ? (narrow ? 6000 : 15000)
                                                      : narrow  ? 20000
                                                                : std::max<std::size_t>(30000, n / 8));
    const bool dear = resampled || narrow;
    // From where it stopped, until that gains nothing: the simplex may have fallen flat.
    const auto again = [&](const std::function<double(const std::vector<double>&)>& f, double size, int times) {
        double value = f(start);
        for (int i = 0; i < times; ++i) {
            start = smallest(f, start, size, evaluations);
            const double now = f(start);
            if (value - now < 0.5) break;
            value = now;
        }
    };
    if (n > part && (dear || (n > 2 * part && !model_.walk && !model_.flicker))) {
        again(on(part), 0.3, dear ? 3 : 5);
        if (!dear) again(on(n), 0.05, 1);
    } else {
        again(on(n), 0.3, 4);
    }
    model_ = trial(start);
    filter_ = std::make_shared<SampleFilter>(model_.noise, n, series_->interval_s);
}

void SampleFit::fit_columns() {
    // rest + columns = what was measured; a correction to each value.
    whitened_.clear();
    for (const SampleColumn& column : model_.columns) whitened_.push_back(filter_->apply(*column.series));
    const auto e = filter_->apply(rest_);
    const auto m = static_cast<Eigen::Index>(whitened_.size());
    Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(m, m);
    Eigen::VectorXd right = Eigen::VectorXd::Zero(m);
    for (Eigen::Index a = 0; a < m; ++a) {
        const auto& wa = whitened_[static_cast<std::size_t>(a)];
        for (Eigen::Index b = 0; b <= a; ++b) {
            const auto& wb = whitened_[static_cast<std::size_t>(b)];
            double sum = 0.0;
            for (std::size_t i = 0; i < e.size(); ++i) {
                if ((*rows_)[i]) sum += wa[i] * wb[i];
            }
            normal(a, b) = normal(b, a) = sum;
        }
        for (std::size_t i = 0; i < e.size(); ++i) {
            if ((*rows_)[i]) right(a) += wa[i] * e[i];
        }
    }
    Eigen::VectorXd scale = normal.diagonal().cwiseMax(1e-300).cwiseSqrt();
    const Eigen::MatrixXd scaled = scale.cwiseInverse().asDiagonal() * normal * scale.cwiseInverse().asDiagonal();
    Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> solver(scaled);
    const Eigen::VectorXd correction =
        scale.cwiseInverse().asDiagonal() * solver.solve(scale.cwiseInverse().asDiagonal() * right);
    const Eigen::MatrixXd covariance = solver.pseudoInverse();
    for (Eigen::Index a = 0; a < m; ++a) {
        auto& column = model_.columns[static_cast<std::size_t>(a)];
        column.value += correction(a);
        column.sd = std::sqrt(std::max(0.0, covariance(a, a))) / scale(a);
    }
    take_off();
}

void SampleFit::finish() {
    innovations_ = filter_->apply(rest_);
    log_likelihood_ = 0.0;
    double count = 0.0;
    for (std::size_t i = 0; i < innovations_.size(); ++i) {
        if (!(*rows_)[i]) continue;
        log_likelihood_ -= 0.5 * innovations_[i] * innovations_[i] + std::log(sd(i));
        count += 1.0;
    }
    // Of a spectrum rate + angle (2 sin)^2 by frequencies: Fisher's information of both variances (Whittle 1953).
    const double r = model_.noise.rate_arcsec_rt_s * model_.noise.rate_arcsec_rt_s * series_->interval_s;
    const double a = model_.noise.angle_arcsec * model_.noise.angle_arcsec;
    double rr = 0.0;
    double ra = 0.0;
    double aa = 0.0;
    constexpr int places = 2000;
    for (int k = 0; k < places; ++k) {
        const double g = 4.0 * std::pow(std::sin(0.5 * units::pi * (k + 0.5) / places), 2);
        const double w = 0.5 * count / places / std::pow(r + a * g, 2);
        rr += w;
        ra += w * g;
        aa += w * g * g;
    }
    const double det = rr * aa - ra * ra;
    rate_sd_ = det > 0.0 ? 0.5 * std::sqrt(aa / det) / std::max(r, 1e-300) * model_.noise.rate_arcsec_rt_s : 0.0;
    angle_sd_ = det > 0.0 ? 0.5 * std::sqrt(rr / det) / std::max(a, 1e-300) * model_.noise.angle_arcsec : 0.0;
}

SampleFit::Score SampleFit::score(const std::vector<std::vector<double>>& series) const {
    std::vector<std::vector<double>> all = whitened_;
    const std::size_t own = all.size();
    for (const auto& s : series) all.push_back(filter_->apply(s));
    const auto m = static_cast<Eigen::Index>(all.size());
    Eigen::MatrixXd normal(m, m);
    Eigen::VectorXd right = Eigen::VectorXd::Zero(m);
    for (Eigen::Index a = 0; a < m; ++a) {
        const auto& wa = all[static_cast<std::size_t>(a)];
        for (Eigen::Index b = 0; b <= a; ++b) {
            const auto& wb = all[static_cast<std::size_t>(b)];
            double sum = 0.0;
            for (std::size_t i = 0; i < wa.size(); ++i) {
                if ((*rows_)[i]) sum += wa[i] * wb[i];
            }
            normal(a, b) = normal(b, a) = sum;
        }
        for (std::size_t i = 0; i < wa.size(); ++i) {
            if ((*rows_)[i]) right(a) += wa[i] * innovations_[i];
        }
    }
    const auto k = static_cast<Eigen::Index>(own);
    const Eigen::MatrixXd base = normal.topLeftCorner(k, k);
    const Eigen::VectorXd scale = normal.diagonal().cwiseMax(1e-300).cwiseSqrt();
    Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> solver(base);
    const Eigen::MatrixXd cross = normal.bottomLeftCorner(m - k, k);
    Eigen::MatrixXd freed = normal.bottomRightCorner(m - k, m - k) - cross * solver.solve(cross.transpose());
    const Eigen::VectorXd target = right.tail(m - k) - cross * solver.solve(right.head(k));
    const Eigen::VectorXd s = scale.tail(m - k);
    freed = s.cwiseInverse().asDiagonal() * freed * s.cwiseInverse().asDiagonal();
    Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> rest;
    rest.setThreshold(1e-8);
    rest.compute(freed);
    const Eigen::VectorXd scaled = s.cwiseInverse().asDiagonal() * target;
    const Eigen::VectorXd solution = rest.solve(scaled);
    Score score;
    score.chi2 = std::max(0.0, scaled.dot(solution));
    score.rank = freed.diagonal().maxCoeff() > 1e-8 ? static_cast<int>(rest.rank()) : 0;
    for (Eigen::Index i = 0; i < m - k; ++i) score.value.push_back(solution(i) / s(i));
    return score;
}

}  // namespace ringlock::closure
