#pragma once
#include <cstdint>
#include <limits>
#include <vector>

#include "analysis/allan/estimator.hpp"

/// Every estimator straight from its definition, one number after the other, in quadruple precision.
namespace ringlock::test {

__extension__ using Quad = __float128;

inline Quad square(Quad x) { return x * x; }

/// Second difference of the sums over m of x from i on.
inline Quad sums_differenced(const std::vector<Quad>& x, std::int64_t i, std::int64_t m) {
    Quad z = 0;
    for (std::int64_t j = 0; j < m; ++j) z += x[i + j] - 2 * x[i + m + j] + x[i + 2 * m + j];
    return z;
}

/// Mean over the pieces of 3m samples of the mean square of what each has, in units of (sample)^2 m^2.
inline Quad piece_mean_square(const std::vector<Quad>& x, std::int64_t m) {
    const std::int64_t size = 3 * m;
    const std::int64_t pieces = static_cast<std::int64_t>(x.size()) - size + 1;
    Quad total = 0;
    for (std::int64_t n = 0; n < pieces; ++n) {
        const std::int64_t half = size / 2;
        Quad first = 0;
        Quad second = 0;
        for (std::int64_t i = 0; i < half; ++i) {
            first += x[n + i];
            second += x[n + size - 1 - i];
        }
        const Quad slope = (second - first) / half / (size - half);
        std::vector<Quad> extended(3 * size);
        for (std::int64_t i = 0; i < size; ++i) {
            const Quad v = x[n + i] - slope * i;
            extended[size - 1 - i] = extended[size + i] = extended[3 * size - 1 - i] = v;
        }
        Quad squares = 0;
        for (std::int64_t i = 0; i < 2 * size; ++i) squares += square(sums_differenced(extended, i, m));
        total += squares / (2 * size);
    }
    return total / pieces;
}

/// Variance (mtie: square of the error) of whole phase without gaps, bias not corrected; tau0 = 1.
inline Quad oracle_variance(allan::Estimator e, const std::vector<Quad>& x, std::int64_t m) {
    using allan::Estimator;
    const auto n = static_cast<std::int64_t>(x.size());
    const Quad mm = static_cast<Quad>(m) * m;
    const auto differences = [&](int order, std::int64_t stride) {
        Quad sum = 0;
        std::int64_t terms = 0;
        for (std::int64_t i = 0; i + order * m < n; i += stride, ++terms) {
            const Quad z = order == 1   ? x[i + m] - x[i]
                           : order == 2 ? x[i + 2 * m] - 2 * x[i + m] + x[i]
                                        : x[i + 3 * m] - 3 * x[i + 2 * m] + 3 * x[i + m] - x[i];
            sum += square(z);
        }
        return sum / terms;
    };
    const auto modified = [&] {
        std::vector<Quad> before = {0};  // of counts exact: 113 bits hold them all
        for (const Quad v : x) before.push_back(before.back() + v);
        Quad sum = 0;
        for (std::int64_t i = 0; i + 3 * m <= n; ++i) {
            sum += square(before[i + 3 * m] - 3 * before[i + 2 * m] + 3 * before[i + m] - before[i]);
        }
        return sum / (n - 3 * m + 1) / (2 * mm * mm);
    };
    switch (e) {
        case Estimator::adev:
            return differences(2, m) / (2 * mm);
        case Estimator::oadev:
            return differences(2, 1) / (2 * mm);
        case Estimator::hdev:
            return differences(3, m) / (6 * mm);
        case Estimator::ohdev:
            return differences(3, 1) / (6 * mm);
        case Estimator::tierms:
            return differences(1, 1);
        case Estimator::mdev:
            return modified();
        case Estimator::tdev:
            return modified() * mm / 3;
        case Estimator::totdev: {
            const auto reflected = [&](std::int64_t i) {
                return i < 0 ? 2 * x[0] - x[-i] : i >= n ? 2 * x[n - 1] - x[2 * (n - 1) - i] : x[i];
            };
            Quad sum = 0;
            for (std::int64_t i = 1; i + 1 < n; ++i) sum += square(reflected(i - m) - 2 * x[i] + reflected(i + m));
            return sum / (n - 2) / (2 * mm);
        }
        case Estimator::mtotdev:
            return piece_mean_square(x, m) / (2 * mm * mm);
        case Estimator::ttotdev:
            return piece_mean_square(x, m) / (2 * mm * mm) * mm / 3;
        case Estimator::htotdev: {
            if (m == 1) return differences(3, 1) / 6;
            std::vector<Quad> y;
            for (std::int64_t i = 0; i + 1 < n; ++i) y.push_back(x[i + 1] - x[i]);
            return piece_mean_square(y, m) / (6 * mm);
        }
        case Estimator::mtie: {
            Quad largest = 0;
            for (std::int64_t i = 0; i + m < n; ++i) {
                Quad low = x[i];
                Quad high = x[i];
                for (std::int64_t j = 1; j <= m; ++j) {
                    if (x[i + j] < low) low = x[i + j];
                    if (x[i + j] > high) high = x[i + j];
                }
                if (high - low > largest) largest = high - low;
            }
            return square(largest);
        }
    }
    return 0;
}

}  // namespace ringlock::test
