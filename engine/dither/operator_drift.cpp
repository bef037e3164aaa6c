#include "engine/dither/operator_drift.hpp"

#include <Eigen/Sparse>
#include <algorithm>
#include <cmath>
#include <unsupported/Eigen/IterativeSolvers>

#include "engine/dither/transfer_operator.hpp"

namespace ringlock::dither {
namespace {
class Deflated;
}  // namespace
}  // namespace ringlock::dither

namespace Eigen::internal {
/// Eigen's solvers take a matrix that can only be applied for a sparse one.
template <>
struct traits<ringlock::dither::Deflated> : traits<Eigen::SparseMatrix<double>> {};
}  // namespace Eigen::internal

namespace ringlock::dither {

namespace {

/// 1 - T + (mean over the grid), which is regular where 1 - T is not. The solution of x - T x + mean(x) = f has the
/// mean that f has in the stationary state, and x - T x = f - mean(x) is Poisson's equation.
class Deflated : public Eigen::EigenBase<Deflated> {
   public:
    using Scalar = double;
    using RealScalar = double;
    using StorageIndex = int;
    enum { ColsAtCompileTime = Eigen::Dynamic, MaxColsAtCompileTime = Eigen::Dynamic, IsRowMajor = false };

    explicit Deflated(const TransferOperator& transfer) : transfer_(transfer) {}
    Eigen::Index rows() const { return transfer_.rows() * transfer_.columns(); }
    Eigen::Index cols() const { return rows(); }
    template <class Vector>
    Eigen::Product<Deflated, Vector, Eigen::AliasFreeProduct> operator*(const Eigen::MatrixBase<Vector>& x) const {
        return {*this, x.derived()};
    }
    Eigen::VectorXd apply(const Eigen::VectorXd& x) const {
        const TransferOperator::Functions f =
            Eigen::Map<const TransferOperator::Functions>(x.data(), transfer_.rows(), transfer_.columns());
        TransferOperator::Functions result = f - transfer_.expectation(f);
        result.col(0).array() += f.col(0).mean();
        return Eigen::Map<const Eigen::VectorXd>(result.data(), result.size());
    }

   private:
    const TransferOperator& transfer_;
};

}  // namespace

}  // namespace ringlock::dither

namespace Eigen::internal {

template <class Vector>
struct generic_product_impl<ringlock::dither::Deflated, Vector, SparseShape, DenseShape, GemvProduct>
    : generic_product_impl_base<ringlock::dither::Deflated, Vector,
                                generic_product_impl<ringlock::dither::Deflated, Vector>> {
    template <class To>
    static void scaleAndAddTo(To& to, const ringlock::dither::Deflated& a, const Vector& x, double factor) {
        to.noalias() += factor * a.apply(x);
    }
};

}  // namespace Eigen::internal

namespace ringlock::dither {

namespace {

constexpr int restart = 150;

/// Iterations that the time allows: some seconds of two cores for a solution.
int iterations_allowed(const PhaseChain& chain, int harmonics, const TransferOperator& transfer) {
    constexpr double most_work = 1e10;
    constexpr double most = 1500.0;
    const auto unknowns = static_cast<double>(transfer.rows() * transfer.columns());
    const double each = TransferOperator::work(chain, harmonics) + 2.0 * restart * unknowns;
    return static_cast<int>(std::min(most, most_work / each));
}

std::optional<TransferOperator::Functions> solve(const TransferOperator& transfer, const TransferOperator::Functions& f,
                                                 int iterations) {
    const Deflated matrix(transfer);
    Eigen::GMRES<Deflated, Eigen::IdentityPreconditioner> solver;
    solver.set_restart(std::min(restart, iterations));
    solver.setMaxIterations(iterations);
    solver.setTolerance(1e-7);
    solver.compute(matrix);
    const Eigen::VectorXd x = solver.solve(Eigen::Map<const Eigen::VectorXd>(f.data(), f.size()));
    if (solver.info() != Eigen::Success) return std::nullopt;
    return TransferOperator::Functions(
        Eigen::Map<const TransferOperator::Functions>(x.data(), transfer.rows(), transfer.columns()));
}

std::optional<KickDrift> drift(const PhaseChain& chain, int harmonics) {
    // Fewer iterations never solve it, and the operator itself takes as long to make as some applications.
    constexpr double fewest_iterations = 10.0;
    constexpr double most_work_of_one = 1e10 / fewest_iterations;
    if (TransferOperator::work(chain, harmonics) > most_work_of_one) return std::nullopt;
    const TransferOperator transfer(chain, harmonics);
    const int iterations = iterations_allowed(chain, harmonics, transfer);
    const auto turns = static_cast<double>(transfer.turns_per_period());
    const auto potential = solve(transfer, transfer.kicks(), iterations);
    if (!potential) return std::nullopt;
    const double mean = potential->col(0).mean() / turns;
    const auto squares = solve(transfer, transfer.squares(*potential, mean), iterations);
    if (!squares) return std::nullopt;
    return KickDrift{mean, squares->col(0).mean() / turns};
}

}  // namespace

std::optional<KickDrift> operator_drift(const PhaseChain& chain) {
    constexpr double relative = 0.005;
    const double kick_rad = 2.0 * chain.r;
    std::optional<KickDrift> last = drift(chain, 4);
    for (int harmonics = 8; last && harmonics <= 128; harmonics *= 2) {
        const std::optional<KickDrift> next = drift(chain, harmonics);
        if (!next) return std::nullopt;
        const bool stands =
            std::abs(next->variance_rad2 - last->variance_rad2) <= 2.0 * relative * next->variance_rad2 &&
            std::abs(next->mean_kick_rad - last->mean_kick_rad) <= 1e-3 * kick_rad;
        last = next;
        if (stands) return last;
    }
    return std::nullopt;
}

}  // namespace ringlock::dither
