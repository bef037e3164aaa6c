#pragma once
#include <Eigen/Core>
#include <memory>
#include <optional>

/// Decompositions of dense matrices by Eigen, compiled once: each of them takes seconds of compilation in a source that
/// uses it directly. Matrices of a fixed small size, in loops where an allocation counts, call Eigen themselves.
namespace ringlock::dense {

/// Solution of a x = b for a symmetric positive semidefinite a, of which the lower triangle is read (LDL^T with
/// pivots).
Eigen::VectorXd solve_symmetric(const Eigen::MatrixXd& a, const Eigen::VectorXd& b);
Eigen::MatrixXd inverse_of_symmetric(const Eigen::MatrixXd& a);
/// Whether the symmetric matrix has no negative eigenvalue, by the pivots of its LDL^T decomposition.
bool is_positive(const Eigen::MatrixXd& a);

/// Lower factor L of a symmetric positive definite a = L L^T; nothing where a is not positive definite.
std::optional<Eigen::MatrixXd> cholesky(const Eigen::MatrixXd& a);
/// Solution of l^T x = b for a regular lower triangular l.
Eigen::VectorXd solve_transposed(const Eigen::MatrixXd& l, const Eigen::VectorXd& b);

/// Inverse of a regular matrix (LU with row pivots).
Eigen::MatrixXd inverse(const Eigen::MatrixXd& a);

/// Minimises |x c - y| for x with at least as many rows as columns (QR with column pivots), for each column of y.
Eigen::MatrixXd least_squares(const Eigen::MatrixXd& x, const Eigen::MatrixXd& y);

/// Orthonormal basis of the space of the columns of x, with as many columns as x has (QR without pivots).
Eigen::MatrixXd orthonormal_basis(Eigen::MatrixXd x);
/// Likewise with only as many columns as the rank of x (QR with column pivots).
Eigen::MatrixXd orthonormal_basis_of_rank(const Eigen::MatrixXd& x);

/// Eigenvalues in increasing order and the orthonormal eigenvectors as columns.
struct SymmetricEigen {
    Eigen::VectorXd values;
    Eigen::MatrixXd vectors;
};
/// Of a symmetric matrix, of which the lower triangle is read.
SymmetricEigen symmetric_eigen(const Eigen::MatrixXd& a);
Eigen::VectorXd symmetric_eigenvalues(const Eigen::MatrixXd& a);

/// The largest absolute value of the eigenvalues of a square matrix.
double spectral_radius(const Eigen::MatrixXd& a);

/// Least squares of any rank (complete orthogonal decomposition): of all solutions the shortest.
class MinimumNorm {
   public:
    /// Pivots below `threshold` times the largest count as zero; 0 takes Eigen's own, the rounding error of a double
    /// times the smaller dimension.
    explicit MinimumNorm(const Eigen::MatrixXd& a, double threshold = 0.0);
    ~MinimumNorm();
    MinimumNorm(MinimumNorm&&) noexcept;
    MinimumNorm& operator=(MinimumNorm&&) noexcept;

    Eigen::VectorXd solve(const Eigen::VectorXd& b) const;
    Eigen::MatrixXd solve(const Eigen::MatrixXd& b) const;
    Eigen::MatrixXd pseudo_inverse() const;
    Eigen::Index rank() const;

   private:
    struct Decomposition;
    std::unique_ptr<Decomposition> decomposition_;
};

}  // namespace ringlock::dense
