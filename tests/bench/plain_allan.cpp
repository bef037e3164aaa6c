#include "tests/bench/plain_allan.hpp"

namespace ringlock::bench {

__attribute__((target_clones("default", "avx2", "avx512f"))) double plain_sum_of_squares(const double* x,
                                                                                         std::size_t points,
                                                                                         std::size_t m) {
    double sum = 0.0;
#pragma omp simd reduction(+ : sum)
    for (std::size_t i = 0; i < points - 2 * m; ++i) {
        const double z = x[i + 2 * m] - 2.0 * x[i + m] + x[i];
        sum += z * z;
    }
    return sum;
}

__attribute__((target_clones("default", "avx2", "avx512f"))) double read_all(const double* x, std::size_t points) {
    double sum = 0.0;
#pragma omp simd reduction(+ : sum)
    for (std::size_t i = 0; i < points; ++i) sum += x[i];
    return sum;
}

}  // namespace ringlock::bench
