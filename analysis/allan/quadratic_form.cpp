#include "analysis/allan/quadratic_form.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <boost/math/tools/toms748_solve.hpp>
#include <cmath>
#include <complex>
#include <numbers>
#include <stdexcept>

#include "analysis/allan/interval.hpp"
#include "analysis/allan/statistics/power_law.hpp"
#include "engine/core/dense.hpp"

namespace ringlock::allan {
namespace {

using Matrix = Eigen::MatrixXd;
using Row = Eigen::RowVectorXd;

/// Binomial coefficients with alternating signs, the last one positive.
std::vector<double> difference_weights(int order) {
    if (order == 2) return {1.0, -2.0, 1.0};
    return {-1.0, 3.0, -3.0, 1.0};
}

/// One term at the first start, of `size` points: sampled or means over m.
Row term_row(int order, bool means, std::int64_t m, std::int64_t size) {
    Row row = Row::Zero(size);
    const std::vector<double> weights = difference_weights(order);
    for (std::size_t k = 0; k < weights.size(); ++k) {
        const std::int64_t at = static_cast<std::int64_t>(k) * m;
        for (std::int64_t j = 0; j < (means ? m : 1); ++j)
            row(at + j) = weights[k] / static_cast<double>(means ? m : 1);
    }
    return row;
}

/// Adds row^T row from its first point that counts on.
void add_square(const Row& row, Matrix& form) { form.noalias() += row.transpose() * row; }

Matrix form_of_differences(const Traits& t, std::int64_t m, std::int64_t points) {
    const bool means = t.family == Family::modified;
    const std::int64_t span = span_of(t.estimator, m);
    const Row term = term_row(t.differences, means, m, span);
    const Matrix square = term.transpose() * term;
    Matrix form = Matrix::Zero(points, points);
    for (std::int64_t i = 0; i + span <= points; i += t.overlapping ? 1 : m) form.block(i, i, span, span) += square;
    return form;
}

/// Adds point i of the record continued by its mirror images, times a weight: i from -(points - 1) on.
void add_reflected(std::int64_t i, double weight, std::int64_t points, Row& row) {
    const std::int64_t last = points - 1;
    if (i < 0) {
        row(0) += 2.0 * weight;
        row(-i) -= weight;
    } else if (i > last) {
        row(last) += 2.0 * weight;
        row(2 * last - i) -= weight;
    } else {
        row(i) += weight;
    }
}

Matrix form_of_total(std::int64_t m, std::int64_t points) {
    Matrix form = Matrix::Zero(points, points);
    for (std::int64_t c = 1; c + 1 < points; ++c) {
        Row row = Row::Zero(points);
        add_reflected(c - m, 1.0, points, row);
        add_reflected(c, -2.0, points, row);
        add_reflected(c + m, 1.0, points, row);
        add_square(row, form);
    }
    return form;
}

/// The matrix that removes from a piece the line through the means of its halves.
Matrix without_line(std::int64_t size) {
    Row slope = Row::Zero(size);
    const std::int64_t half = size / 2;
    const double weight = 1.0 / static_cast<double>(half * (size - half));
    for (std::int64_t i = 0; i < half; ++i) {
        slope(i) -= weight;
        slope(size - 1 - i) += weight;
    }
    Matrix out = Matrix::Identity(size, size);
    for (std::int64_t i = 0; i < size; ++i) out.row(i) -= static_cast<double>(i) * slope;
    return out;
}

/// Mean square of the differences of one piece of 3m samples.
Matrix form_of_piece(std::int64_t m) {
    const std::int64_t size = 3 * m;
    Matrix form = Matrix::Zero(size, size);
    const Row term = term_row(2, true, m, size);
    for (std::int64_t start = 0; start < 2 * size; ++start) {
        Row row = Row::Zero(size);
        for (std::int64_t j = 0; j < size; ++j) {
            const std::int64_t at = (start + j) % (2 * size);
            row(at < size ? at : 2 * size - 1 - at) += term(j);
        }
        add_square(row, form);
    }
    const Matrix line = without_line(size);
    return line.transpose() * form * line / static_cast<double>(2 * size);
}

Matrix form_of_pieces(std::int64_t m, std::int64_t samples) {
    const std::int64_t size = 3 * m;
    const Matrix piece = form_of_piece(m);
    Matrix form = Matrix::Zero(samples, samples);
    for (std::int64_t i = 0; i + size <= samples; ++i) form.block(i, i, size, size) += piece;
    return form;
}

/// The quadratic form of pieces of the frequency, in terms of the phase.
Matrix form_of_frequency_pieces(std::int64_t m, std::int64_t points) {
    Matrix step = Matrix::Zero(points - 1, points);
    for (std::int64_t i = 0; i + 1 < points; ++i) {
        step(i, i) = -1.0;
        step(i, i + 1) = 1.0;
    }
    // A mean of m frequencies is a step of the phase over m: the same scale as a difference of phase by m.
    const auto scale = static_cast<double>(m * m);
    return scale * step.transpose() * form_of_pieces(m, points - 1) * step;
}

/// x^T B x, the sum over terms.
Matrix form_of(const Traits& t, std::int64_t m, std::int64_t points) {
    switch (t.family) {
        case Family::difference:
        case Family::modified:
            return form_of_differences(t, m, points);
        case Family::total:
            return form_of_total(m, points);
        case Family::modified_total:
            return form_of_pieces(m, points);
        case Family::hadamard_total:
            if (m == 1) return form_of_differences(traits(Estimator::ohdev), m, points);
            return form_of_frequency_pieces(m, points);
        case Family::interval_error:
            break;
    }
    throw std::domain_error("quadratic form: an estimator without an interval");
}

Matrix covariance(int alpha, std::int64_t m, std::int64_t points) {
    if (alpha == 2) return Matrix::Identity(points, points);
    const auto tau = static_cast<double>(m);
    Matrix c(points, points);
    for (std::int64_t i = 0; i < points; ++i) {
        for (std::int64_t j = 0; j < points; ++j) {
            c(i, j) = phase_autocovariance(static_cast<double>(i - j) / tau, alpha <= 0 ? sampled : tau, alpha);
        }
    }
    return c;
}

}  // namespace

WeightedSquares::WeightedSquares(std::vector<Share> shares) : shares_(std::move(shares)) {
    for (const Share& s : shares_) mean_ += s.count * s.weight;
    double squares = 0.0;
    for (Share& s : shares_) {
        s.weight /= mean_;
        squares += s.count * s.weight * s.weight;
    }
    degrees_ = 1.0 / squares;
    std::sort(shares_.begin(), shares_.end(), [](const Share& a, const Share& b) { return a.weight < b.weight; });
    double sum = 0.0;
    for (const Share& s : shares_) {
        sum += s.count * s.weight;
        common_weight_ = s.weight;
        if (sum >= 0.2) break;
    }
}

double WeightedSquares::saddle_point(double x) const {
    double largest = 0.0;
    for (const Share& s : shares_) largest = std::max(largest, s.weight);
    double low = -1.0;
    while (cumulants(low).first > x) low *= 4.0;
    double high = 0.5 / largest;
    double t = 0.0;
    for (int i = 0; i < 100 && high - low > 1e-6 * (1.0 + std::abs(t)); ++i) {
        t = 0.5 * (low + high);
        (cumulants(t).first > x ? high : low) = t;
    }
    return t;
}

WeightedSquares::Cumulants WeightedSquares::cumulants(double t) const {
    Cumulants k;
    for (const auto& [weight, count] : shares_) {
        const double share = weight / (1.0 - 2.0 * weight * t);
        k.first += count * share;
        k.second += 2.0 * count * share * share;
    }
    return k;
}

double WeightedSquares::probability_below(double x) const {
    double t = saddle_point(x);
    // Away from the pole at zero, which stands for the whole probability.
    const double nearest = 0.5 / std::sqrt(cumulants(0.0).second);
    if (std::abs(t) < nearest) t = -nearest;
    const Cumulants k = cumulants(t);
    const double step = 0.15 / std::sqrt(k.second);
    const double bend = 2.0 / 3.0 * common_weight_ / (1.0 - 2.0 * common_weight_ * t);
    // Trapezoids; the path is a mirror image of itself below the real axis.
    double sum = 0.0;
    double largest = 0.0;
    for (int i = 0; i < 2000; ++i) {
        const double y = step * i;
        const std::complex<double> s(t + bend * y * y, y);
        std::complex<double> exponent = -s * x;
        for (const auto& [weight, count] : shares_) exponent -= 0.5 * count * std::log(1.0 - 2.0 * weight * s);
        const std::complex<double> value = std::exp(exponent) / s * std::complex<double>(2.0 * bend * y, 1.0);
        sum += (i == 0 ? 0.5 : 1.0) * value.imag();
        largest = std::max(largest, std::abs(value));
        if (std::abs(value) < 1e-8 * largest) break;
    }
    const double integral = sum * step / std::numbers::pi;
    return std::clamp(t < 0.0 ? -integral : 1.0 - integral, 0.0, 1.0);
}

double WeightedSquares::quantile(double probability) const {
    // Near that of the chi-squared with as many degrees of freedom.
    const double near = relative_chi_squared_quantile(degrees_, probability);
    double low = 0.8 * near;
    double high = 1.2 * near;
    while (probability_below(low) > probability && low > 1e-12) low *= 0.25;
    while (probability_below(high) < probability && high < 1e6) high *= 2.0;
    const auto distance = [&](double log_x) { return probability_below(std::exp(log_x)) - probability; };
    std::uintmax_t steps = 60;
    const auto [a, b] = boost::math::tools::toms748_solve(distance, std::log(low), std::log(high),
                                                          boost::math::tools::eps_tolerance<double>(20), steps);
    return std::exp(0.5 * (a + b));
}

WeightedSquares distribution_of(Estimator estimator, int alpha, std::int64_t m, std::int64_t points) {
    const Traits& t = traits(estimator);
    if (!t.has_interval || alpha > 2 || alpha + 2 * t.differences <= 1 || points < span_of(estimator, m)) {
        throw std::domain_error("quadratic form: no such statistic");
    }
    const bool means = t.family == Family::modified || t.family == Family::modified_total;
    const Matrix c = covariance(alpha, m, points);
    const std::int64_t base_span = means ? 3 * m : t.differences * m + 1;

    const dense::SymmetricEigen form = dense::symmetric_eigen(form_of(t, m, points));
    const double largest = form.values.tail(1)(0);
    std::vector<std::int64_t> kept;
    for (std::int64_t i = 0; i < points; ++i) {
        if (form.values(i) > 1e-10 * largest) kept.push_back(i);
    }
    Matrix root(static_cast<std::int64_t>(kept.size()), points);
    for (std::size_t r = 0; r < kept.size(); ++r) {
        root.row(static_cast<std::int64_t>(r)) =
            std::sqrt(form.values(kept[r])) * form.vectors.col(kept[r]).transpose();
    }
    const Matrix weights_of = root * c * root.transpose();
    const Eigen::VectorXd eigenvalues = dense::symmetric_eigenvalues(weights_of);

    // The variance of a plain term, of which the mean square is the true variance.
    const Row term = term_row(t.differences, means, m, base_span);
    Matrix near = covariance(alpha, m, base_span);
    const double truth = (term * near * term.transpose())(0, 0);
    const auto terms = static_cast<double>(term_count(estimator, m, points));
    std::vector<WeightedSquares::Share> weights;
    for (std::int64_t i = 0; i < eigenvalues.size(); ++i) {
        if (eigenvalues(i) > 1e-9 * eigenvalues.maxCoeff()) weights.push_back({eigenvalues(i) / (terms * truth)});
    }
    return WeightedSquares(std::move(weights));
}

}  // namespace ringlock::allan
