#pragma once
#include <cstdint>
#include <map>
#include <tuple>
#include <vector>

namespace ringlock::allan {

/// How an estimator differences, filters and strides the phase (Greenhall & Riley 2003, section II).
struct EstimatorShape {
    int differences = 2;      ///< d: 1 first difference, 2 Allan, 3 Hadamard
    bool modified = false;    ///< phase averaged over tau first (F = 1) or not (F = m)
    bool overlapping = true;  ///< stride tau0 (S = m) or tau (S = 1)
};

/// Equivalent degrees of freedom of variances made of finite differences.
///
/// C. Greenhall, W. Riley, "Uncertainty of stability variances based on finite differences", 35th PTTI (2003): with the
/// generalised autocovariance s_z of the differenced phase, 1/edf = sum over all pairs of terms of s_z^2 / (M
/// s_z(0))^2. The sum is done exactly while a tau spans at most `exact_span` strides. Beyond, the record is scaled to
/// that many strides a tau, the number of taus kept, as in their section III; the difference is of the order of
/// 1/exact_span^2 (the tests say how much). White phase noise has d + 1 terms and is always exact.
///
/// An object keeps the tables it has made; it is cheap to make and not for use by two threads at once.
class DegreesOfFreedom {
   public:
    explicit DegreesOfFreedom(EstimatorShape shape, std::int64_t exact_span = 256)
        : shape_(shape), exact_span_(exact_span) {}

    /// \param alpha   power-law exponent, integer, 2 ... -4 with alpha + 2 d > 1
    /// \param m       averaging factor >= 1
    /// \param points  number of phase points; at least one term must fit
    /// \return edf > 0, dimensionless; throws std::domain_error outside that
    double operator()(int alpha, std::int64_t m, std::int64_t points);

   private:
    using Key = std::tuple<int, double, double>;  ///< alpha, strides in a tau, filter F (infinity: the limit)
    const std::vector<double>& squares(int alpha, double strides, double filter);

    EstimatorShape shape_;
    std::int64_t exact_span_;
    std::map<Key, std::vector<double>> tables_;
};

}  // namespace ringlock::allan
