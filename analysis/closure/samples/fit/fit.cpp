#include "analysis/closure/samples/fit/fit.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "analysis/closure/options.hpp"
#include "analysis/closure/stats/column_regression.hpp"
#include "engine/core/dense.hpp"

namespace ringlock::closure {

namespace {

SampleSource source_of(const SampleNoise& noise) { return {noise.from_hz, noise.from_phase}; }

}  // namespace

SampleFit::SampleFit(const SampleSeries& series, SampleModel model, const Rows& rows, Noise noise)
    : series_(&series), rows_(&rows), model_(std::move(model)), searched_(noise == Noise::near) {
    if (model_.columns.empty()) {
        model_.columns.push_back(
            {nullptr, "mean_rate_deg_h", std::make_shared<std::vector<double>>(series.size(), series.interval_s)});
        take_off();
        double mean = 0.0;
        for (const double x : rest_) mean += x / static_cast<double>(series.size());
        model_.columns[0].value = mean * series.rate_hz;
        take_whites(model_.noise);
    }
    filter_by(model_.noise);
    take_off();
    if (noise == Noise::near || noise == Noise::free) {
        fit_columns();
        fit_noise();
    }
    fit_columns(noise == Noise::all_held);
    finish();
}

std::vector<double> SampleFit::as_taken(const std::vector<double>& increments) const {
    return closure::as_taken(source_of(model_.noise), increments, series_->interval_s);
}

std::vector<std::vector<double>> SampleFit::line(const FrequencyTrack& track) const {
    return line_as_taken(source_of(model_.noise), series_->size(), series_->rate_hz, track);
}

std::vector<double> SampleFit::taken(const SampleColumn& column) const {
    if (column.as_recorded || !(model_.noise.from_hz > 0.0)) return *column.series;
    if (column.track.hz == 0.0) return as_taken(*column.series);
    return line(column.track)[column.name == "cosine" ? 0 : 1];
}

std::vector<SampleFit::Shared> SampleFit::taken_by(const SampleModel& model) const {
    const SampleSource source = source_of(model.noise);
    const auto share = [](std::vector<double> series) {
        return std::make_shared<const std::vector<double>>(std::move(series));
    };
    std::vector<Shared> all;
    while (all.size() < model.columns.size()) {
        const SampleColumn& column = model.columns[all.size()];
        if (column.as_recorded || !(source.from_hz > 0.0)) {
            all.push_back(column.series);
        } else if (column.track.hz == 0.0) {
            all.push_back(share(closure::as_taken(source, *column.series, series_->interval_s)));
        } else {
            // A cosine, and the sine that follows it.
            for (auto& taken : line_as_taken(source, series_->size(), series_->rate_hz, column.track)) {
                all.push_back(share(std::move(taken)));
            }
        }
    }
    return all;
}

std::vector<double> SampleFit::determined() const { return determined_by(model_); }

std::vector<double> SampleFit::determined_by(const SampleModel& model) const {
    std::vector<double> sum(series_->size(), 0.0);
    const auto add = [&](double value, const std::vector<double>& series) {
        for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += value * series[i];
    };
    const SampleSource source = source_of(model.noise);
    if (!series_->input_rate_deg_h.empty()) {
        // The known input without its mean, which is a part of the mean rate.
        const auto& input = series_->input_rate_deg_h;
        const double mean = std::accumulate(input.begin(), input.end(), 0.0) / static_cast<double>(input.size());
        std::vector<double> known(sum.size());
        for (std::size_t i = 0; i < known.size(); ++i) known[i] = (input[i] - mean) * series_->interval_s;
        add(1.0, closure::as_taken(source, known, series_->interval_s));
    }
    if (!model.motion.empty()) add(1.0, closure::as_taken(source, model.motion, series_->interval_s));
    const auto taken = taken_by(model);
    for (std::size_t k = 0; k < taken.size(); ++k) add(model.columns[k].value, *taken[k]);
    return sum;
}

std::vector<double> SampleFit::rest_of(const SampleModel& model) const {
    std::vector<double> rest = determined_by(model);
    for (std::size_t i = 0; i < rest.size(); ++i) rest[i] = series_->increment[i] - rest[i];
    return rest;
}

void SampleFit::filter_by(const SampleNoise& noise) {
    filter_ = std::make_shared<SampleFilter>(noise, series_->size(), series_->interval_s);
    find_deterministic(noise);
}

/// The values of the digits are unknown: a row is informative if its prediction would be as uncertain with other
/// digits.
void SampleFit::find_deterministic(SampleNoise noise) {
    const SampleFitOptions& by = options.samples.fit;
    const std::size_t n = series_->size();
    deterministic_.assign(n, 0);
    informative_ = *rows_;
    if (!(noise.from_hz > 0.0)) return;
    SampleNoise blurred = noise;
    noise.digits_arcsec *= by.coarser_digits;
    blurred.blur_arcsec *= by.coarser_digits;
    const SampleFilter with_coarser_digits(noise, n, series_->interval_s);
    const SampleFilter with_blur(blurred, n, series_->interval_s);
    double largest = 0.0;
    for (std::size_t i = 0; i < n; ++i) largest = std::max(largest, sd(i));
    std::vector<std::size_t> mostly_blur;
    std::size_t others = 0;
    for (std::size_t i = 0; i < n; ++i) {
        if (sd(i) > by.deterministic_sd * largest && with_coarser_digits.sd(i) < by.deterministic_growth * sd(i)) {
            const bool blur = with_blur.sd(i) > by.blurred_growth * sd(i);
            if (blur) mostly_blur.push_back(i);
            others += blur ? 0 : 1;
            continue;
        }
        deterministic_[i] = 1;
        informative_[i] = 0;
    }
    // A few rows mostly determine the blur and are excluded; where most rows do, the blur is the noise of the record.
    if (mostly_blur.size() > others) return;
    for (const std::size_t i : mostly_blur) {
        deterministic_[i] = 1;
        informative_[i] = 0;
    }
}

/// Values of the columns, unless they are held, and their standard errors.
void SampleFit::fit_columns(bool held) {
    // rest + columns = measured increments; the regression gives a correction to each value.
    take_off();
    whitened_.clear();
    for (const Shared& taken : taken_by(model_)) whitened_.push_back(filter_->apply(*taken));
    const ColumnRegression regression(whitened_, informative_);
    const Eigen::VectorXd correction = regression.of(filter_->apply(rest_));
    covariance_ = regression.covariance();
    for (std::size_t k = 0; k < model_.columns.size(); ++k) {
        const auto at = static_cast<Eigen::Index>(k);
        if (!held) model_.columns[k].value += correction(at);
        model_.columns[k].sd = std::sqrt(std::max(0.0, covariance_(at, at)));
    }
    take_off();
}

void SampleFit::finish() {
    innovations_ = filter_->apply(rest_);
    log_likelihood_ = 0.0;
    double variance = 0.0;
    double count = 0.0;
    for (std::size_t i = 0; i < innovations_.size(); ++i) {
        if (!(*rows_)[i]) continue;
        log_likelihood_ -= 0.5 * innovations_[i] * innovations_[i] + std::log(sd(i));
        variance += sd(i) * sd(i);
        count += 1.0;
    }
    typical_sd_ = count > 0.0 ? std::sqrt(variance / count) : sd(innovations_.size() / 2);
}

double SampleFit::gain_over(const SampleFit& other) const {
    if (!(model_.noise.from_hz > 0.0) || !(other.model_.noise.from_hz > 0.0)) {
        return log_likelihood_ - other.log_likelihood_;
    }
    double gain = 0.0;
    for (std::size_t i = 0; i < innovations_.size(); ++i) {
        if (!informative_[i] || !other.informative_[i]) continue;
        const double e = innovations_[i];
        const double f = other.innovations_[i];
        gain += 0.5 * (f * f - e * e) + std::log(other.sd(i) / sd(i));
    }
    return gain;
}

Eigen::MatrixXd SampleFit::normal_with(const std::vector<std::vector<double>>& series, Eigen::VectorXd& right) const {
    std::vector<std::vector<double>> more;
    for (const auto& s : series) more.push_back(filter_->apply(s));
    std::vector<const std::vector<double>*> all;
    for (const auto& w : whitened_) all.push_back(&w);
    for (const auto& w : more) all.push_back(&w);
    right = products(all, innovations_, informative_);
    return products(all, informative_);
}

Eigen::MatrixXd SampleFit::joint_covariance(const std::vector<std::vector<double>>& series) const {
    std::vector<std::vector<double>> all = whitened_;
    for (const auto& s : series) all.push_back(filter_->apply(s));
    return ColumnRegression(all, informative_).covariance();
}

SampleFit::Score SampleFit::score(const std::vector<std::vector<double>>& series) const {
    const std::size_t own = whitened_.size();
    Eigen::VectorXd right;
    const Eigen::MatrixXd normal = normal_with(series, right);
    const Eigen::Index m = normal.rows();
    const auto k = static_cast<Eigen::Index>(own);
    const Eigen::MatrixXd base = normal.topLeftCorner(k, k);
    const Eigen::VectorXd scale = normal.diagonal().cwiseMax(1e-300).cwiseSqrt();
    const dense::MinimumNorm solver(base);
    const Eigen::MatrixXd cross = normal.bottomLeftCorner(m - k, k);
    Eigen::MatrixXd freed =
        normal.bottomRightCorner(m - k, m - k) - cross * solver.solve(Eigen::MatrixXd(cross.transpose()));
    const Eigen::VectorXd target = right.tail(m - k) - cross * solver.solve(Eigen::VectorXd(right.head(k)));
    const Eigen::VectorXd s = scale.tail(m - k);
    freed = s.cwiseInverse().asDiagonal() * freed * s.cwiseInverse().asDiagonal();
    const dense::MinimumNorm rest(freed, options.samples.fit.least_independent_share);
    const Eigen::VectorXd scaled = s.cwiseInverse().asDiagonal() * target;
    const Eigen::VectorXd solution = rest.solve(scaled);
    Score score;
    score.chi2 = std::max(0.0, scaled.dot(solution));
    score.rank =
        freed.diagonal().maxCoeff() > options.samples.fit.least_independent_share ? static_cast<int>(rest.rank()) : 0;
    for (Eigen::Index i = 0; i < m - k; ++i) score.value.push_back(solution(i) / s(i));
    score.covariance = s.cwiseInverse().asDiagonal() * rest.pseudo_inverse() * s.cwiseInverse().asDiagonal();
    return score;
}

}  // namespace ringlock::closure
