#pragma once
#include <Eigen/Dense>
#include <vector>

#include "analysis/closure/types.hpp"
#include "engine/core/dense.hpp"

namespace ringlock::closure {

/// Sums of the products of each two columns over the rows that count.
Eigen::MatrixXd products(const std::vector<const std::vector<double>*>& columns, const Rows& rows);
/// Sums of the products of each column with another one.
Eigen::VectorXd products(const std::vector<const std::vector<double>*>& columns, const std::vector<double>& other,
                         const Rows& rows);

/// Least squares of white values of unit variance on columns, in the rows that count. If columns are linearly
/// dependent, the shortest solution.
class ColumnRegression {
   public:
    /// Columns and rows must outlive it.
    ColumnRegression(const std::vector<std::vector<double>>& columns, const Rows& rows);
    Eigen::VectorXd of(const std::vector<double>& values) const;
    /// The values with the columns projected off.
    std::vector<double> freed(std::vector<double> values) const;
    Eigen::MatrixXd covariance() const;

   private:
    std::vector<const std::vector<double>*> columns_;
    const Rows& rows_;
    Eigen::VectorXd over_;  ///< one over the length of each column
    dense::MinimumNorm solver_;
};

}  // namespace ringlock::closure
