#include "analysis/closure/stats/column_regression.hpp"

namespace ringlock::closure {

namespace {

double product(const std::vector<double>& a, const std::vector<double>& b, const Rows& rows) {
    double sum = 0.0;
    for (std::size_t i = 0; i < a.size(); ++i) {
        if (rows[i]) sum += a[i] * b[i];
    }
    return sum;
}

std::vector<const std::vector<double>*> pointers(const std::vector<std::vector<double>>& columns) {
    std::vector<const std::vector<double>*> out;
    for (const auto& column : columns) out.push_back(&column);
    return out;
}

/// Scales a matrix of products to a unit diagonal; `over` becomes one over the length of each column.
Eigen::MatrixXd scaled(const Eigen::MatrixXd& normal, Eigen::VectorXd& over) {
    over = normal.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
    return over.asDiagonal() * normal * over.asDiagonal();
}

}  // namespace

Eigen::MatrixXd products(const std::vector<const std::vector<double>*>& columns, const Rows& rows) {
    const auto m = static_cast<Eigen::Index>(columns.size());
    Eigen::MatrixXd sums(m, m);
    for (Eigen::Index a = 0; a < m; ++a) {
        for (Eigen::Index b = 0; b <= a; ++b) {
            sums(a, b) = sums(b, a) =
                product(*columns[static_cast<std::size_t>(a)], *columns[static_cast<std::size_t>(b)], rows);
        }
    }
    return sums;
}

Eigen::VectorXd products(const std::vector<const std::vector<double>*>& columns, const std::vector<double>& other,
                         const Rows& rows) {
    Eigen::VectorXd sums(static_cast<Eigen::Index>(columns.size()));
    for (std::size_t k = 0; k < columns.size(); ++k) {
        sums(static_cast<Eigen::Index>(k)) = product(*columns[k], other, rows);
    }
    return sums;
}

ColumnRegression::ColumnRegression(const std::vector<std::vector<double>>& columns, const Rows& rows)
    : columns_(pointers(columns)), rows_(rows), solver_(scaled(products(columns_, rows_), over_)) {}

Eigen::VectorXd ColumnRegression::of(const std::vector<double>& values) const {
    const Eigen::VectorXd right = over_.asDiagonal() * products(columns_, values, rows_);
    return over_.asDiagonal() * solver_.solve(right);
}

std::vector<double> ColumnRegression::freed(std::vector<double> values) const {
    const Eigen::VectorXd taken = of(values);
    for (std::size_t k = 0; k < columns_.size(); ++k) {
        const double value = taken(static_cast<Eigen::Index>(k));
        for (std::size_t i = 0; i < values.size(); ++i) values[i] -= value * (*columns_[k])[i];
    }
    return values;
}

Eigen::MatrixXd ColumnRegression::covariance() const {
    return over_.asDiagonal() * solver_.pseudo_inverse() * over_.asDiagonal();
}

}  // namespace ringlock::closure
