#include "engine/core/dense.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>

namespace ringlock::dense {

Eigen::VectorXd solve_symmetric(const Eigen::MatrixXd& a, const Eigen::VectorXd& b) { return a.ldlt().solve(b); }

Eigen::MatrixXd inverse_of_symmetric(const Eigen::MatrixXd& a) {
    return a.ldlt().solve(Eigen::MatrixXd::Identity(a.rows(), a.cols()));
}

bool is_positive(const Eigen::MatrixXd& a) { return a.ldlt().isPositive(); }

std::optional<Eigen::MatrixXd> cholesky(const Eigen::MatrixXd& a) {
    const Eigen::LLT<Eigen::MatrixXd> factors(a);
    if (factors.info() != Eigen::Success) return std::nullopt;
    return factors.matrixL();
}

Eigen::VectorXd solve_transposed(const Eigen::MatrixXd& l, const Eigen::VectorXd& b) {
    return l.transpose().triangularView<Eigen::Upper>().solve(b);
}

Eigen::MatrixXd inverse(const Eigen::MatrixXd& a) { return a.inverse(); }

Eigen::MatrixXd least_squares(const Eigen::MatrixXd& x, const Eigen::MatrixXd& y) {
    return x.colPivHouseholderQr().solve(y);
}

Eigen::MatrixXd orthonormal_basis(Eigen::MatrixXd x) {
    const Eigen::HouseholderQR<Eigen::Ref<Eigen::MatrixXd>> qr(x);  // in place
    return qr.householderQ() * Eigen::MatrixXd::Identity(x.rows(), x.cols());
}

Eigen::MatrixXd orthonormal_basis_of_rank(const Eigen::MatrixXd& x) {
    const auto qr = x.colPivHouseholderQr();
    return qr.householderQ() * Eigen::MatrixXd::Identity(x.rows(), qr.rank());
}

SymmetricEigen symmetric_eigen(const Eigen::MatrixXd& a) {
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(a);
    return {solver.eigenvalues(), solver.eigenvectors()};
}

Eigen::VectorXd symmetric_eigenvalues(const Eigen::MatrixXd& a) {
    return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(a, Eigen::EigenvaluesOnly).eigenvalues();
}

double spectral_radius(const Eigen::MatrixXd& a) { return a.eigenvalues().cwiseAbs().maxCoeff(); }

struct MinimumNorm::Decomposition {
    Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> of;
};

MinimumNorm::MinimumNorm(const Eigen::MatrixXd& a, double threshold) : decomposition_(new Decomposition) {
    if (threshold > 0.0) decomposition_->of.setThreshold(threshold);
    decomposition_->of.compute(a);
}
MinimumNorm::~MinimumNorm() = default;
MinimumNorm::MinimumNorm(MinimumNorm&&) noexcept = default;
MinimumNorm& MinimumNorm::operator=(MinimumNorm&&) noexcept = default;

Eigen::VectorXd MinimumNorm::solve(const Eigen::VectorXd& b) const { return decomposition_->of.solve(b); }
Eigen::MatrixXd MinimumNorm::solve(const Eigen::MatrixXd& b) const { return decomposition_->of.solve(b); }
Eigen::MatrixXd MinimumNorm::pseudo_inverse() const { return decomposition_->of.pseudoInverse(); }
Eigen::Index MinimumNorm::rank() const { return decomposition_->of.rank(); }

}  // namespace ringlock::dense
