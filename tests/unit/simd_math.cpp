// Elementary functions of the vector code against long double and exact arithmetic, on every instruction set.
//
// Errors are measured in long double (64 bits of mantissa, 5e-20), and in quadruple precision where sums must be exact.
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "engine/core/error.hpp"
#include "engine/simd/target.hpp"
#include "tests/support/simd_probe.hpp"

namespace ringlock::test {
namespace simd_math_test {
namespace {

__extension__ typedef __float128 Quad;
constexpr long double pi = 3.141592653589793238462643383279502884L;
constexpr double infinity = std::numeric_limits<double>::infinity();

using Values = std::vector<double>;

class SimdMath : public testing::Test {
   protected:
    ~SimdMath() override { simd::use_best_target(); }

    /// Runs `check` on each instruction set.
    static void on_every_target(const std::function<void()>& check) {
        for (const std::string& target : simd::available_targets()) {
            SCOPED_TRACE(target);
            simd::use_target(target);
            check();
        }
        simd::use_best_target();
    }
};

class Random {
   public:
    explicit Random(std::uint64_t seed) : engine_(seed) {}
    double uniform(double low, double high) {
        return low + (high - low) * static_cast<double>(engine_() >> 11) * 0x1p-53;
    }
    double sign() { return engine_() % 2 == 0 ? 1.0 : -1.0; }
    /// Any size between 2^low and 2^high is as likely.
    double spread(double low, double high) { return sign() * std::exp2(uniform(low, high)); }

   private:
    std::mt19937_64 engine_;
};

/// x and the `steps` representable numbers to either side.
void add_around(Values& values, double x, int steps = 4) {
    double up = x;
    double down = x;
    values.push_back(x);
    for (int i = 0; i < steps; ++i) {
        up = std::nextafter(up, infinity);
        down = std::nextafter(down, -infinity);
        values.push_back(up);
        values.push_back(down);
    }
}

bool same_bits(double a, double b) { return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b); }

std::size_t differing_bits(const Values& a, const Values& b) {
    std::size_t count = a.size() == b.size() ? 0 : 1;
    for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i) count += same_bits(a[i], b[i]) ? 0 : 1;
    return count;
}

/// Largest error and where.
struct Worst {
    double error = 0.0;
    double at = 0.0;
    void add(long double value, long double exact, double x, long double unit = 1.0L) {
        const auto e = static_cast<double>(std::abs(value - exact) / unit);
        if (!(e <= error)) *this = {e, x};
    }
    void print(const char* what) const { std::printf("%s: worst error %.3g at %.17g\n", what, error, at); }
};

/// Fringes: random, dense and where quadrants meet, up to what sincos promises.
Values fringe_arguments() {
    Values fringes{0.0, -0.0, 0.5, -0.5, 0.25, 0.75, 1.0, 0x1p-1022, 1e-300, -1e-300, 0x1p-52, -0x1p-52};
    for (int eighth = -24; eighth <= 24; ++eighth) add_around(fringes, 0.125 * eighth);
    for (const double size : {0x1p20, 0x1p40, 0x1p44, 0x1p47, 0x1.8p47, 0x1.fffffffffffffp47}) {
        for (const double sign : {1.0, -1.0}) {
            add_around(fringes, sign * size, 20);
            add_around(fringes, sign * (size - 0.25));
            add_around(fringes, sign * (size - 0.5));
        }
    }
    for (double& f : fringes) f = std::clamp(f, -0x1.fffffffffffffp47, 0x1.fffffffffffffp47);
    for (int i = 0; i <= 40000; ++i) fringes.push_back(-2.0 + 1e-4 * i);
    Random random(101);
    for (int i = 0; i < 100000; ++i) fringes.push_back(random.uniform(-1.0, 1.0));
    for (int i = 0; i < 100000; ++i) fringes.push_back(random.spread(-60.0, 48.0));
    return fringes;
}

TEST_F(SimdMath, InstructionSetsCanBeChosen) {
    const auto targets = simd::available_targets();
    ASSERT_FALSE(targets.empty());
    for (const std::string& target : targets) {
        simd::use_target(target);
        EXPECT_EQ(simd::active_target(), target);
    }
    simd::use_best_target();
    EXPECT_EQ(simd::active_target(), targets.front());
    EXPECT_THROW(simd::use_target("abacus"), RunError);
    if (targets.size() == 1) GTEST_SKIP() << "only " << targets.front() << " here: comparisons of bits compare nothing";
}

TEST_F(SimdMath, FusedMultiplyAddRoundsOnce) {
    Random random(102);
    Values a;
    Values b;
    Values c;
    Values product;
    for (int i = 0; i < 50000; ++i) {
        a.push_back(random.spread(-40.0, 40.0));
        b.push_back(random.spread(-40.0, 40.0));
        product.push_back(a.back() * b.back());
        // From where c is everything to where the product is.
        c.push_back(random.spread(-120.0, 120.0));
    }
    on_every_target([&] {
        const Values sum = probe(Operation::fma, a, b, c);
        const Values difference = probe(Operation::fnma, a, b, c);
        Values minus = product;
        for (double& p : minus) p = -p;
        const Values rest = probe(Operation::fma, a, b, minus);
        const Values negative_rest = probe(Operation::fnma, a, b, product);
        std::size_t wrong = 0;
        for (std::size_t i = 0; i < a.size(); ++i) {
            wrong += same_bits(sum[i], std::fma(a[i], b[i], c[i])) ? 0 : 1;
            wrong += same_bits(difference[i], std::fma(-a[i], b[i], c[i])) ? 0 : 1;
            // What rounding took from the product is representable; 106 bits hold the product.
            wrong += Quad(a[i]) * Quad(b[i]) == Quad(product[i]) + Quad(rest[i]) ? 0 : 1;
            wrong += rest[i] == -negative_rest[i] ? 0 : 1;
        }
        EXPECT_EQ(wrong, 0U);
    });
}

TEST_F(SimdMath, PolynomialsAreTheirSums) {
    Random random(103);
    Values x{0.0, -0.0, 1.0, -1.0};
    for (int i = 0; i < 20000; ++i) x.push_back(random.uniform(-1.2, 1.2));
    on_every_target([&] {
        for (std::size_t terms = 2; terms <= 10; ++terms) {
            const Values sums = probe_polynomial(terms, x);
            Worst worst;
            for (std::size_t i = 0; i < x.size(); ++i) {
                long double exact = 0.0L;
                long double size = 0.0L;
                for (std::size_t k = terms; k-- > 0;) {
                    exact = exact * x[i] + static_cast<long double>(probe_coefficient(k));
                    size = size * std::abs(x[i]) + std::abs(probe_coefficient(k));
                }
                worst.add(sums[i], exact, x[i], size);
            }
            // Each term is rounded with x^2, once in each of at most four sums and once in the last.
            EXPECT_LT(worst.error, 6 * 0x1p-53) << terms << " terms at " << worst.at;
        }
    });
}

TEST_F(SimdMath, NearestAndFractionAreExact) {
    Random random(104);
    Values x{0.0, -0.0, 0.5, -0.5, 1.5, 2.5, -1.5, -2.5, 0x1p-1022};
    for (const double size : {1.0, 4096.0, 0x1p47, 0x1p49, 0x1.fffffffffffp49}) {
        for (const double sign : {1.0, -1.0}) {
            add_around(x, sign * size);
            add_around(x, sign * (size + 0.5));
        }
    }
    for (int i = 0; i < 50000; ++i) x.push_back(random.spread(-10.0, 50.0));
    on_every_target([&] {
        const Values whole = probe(Operation::nearest, x);
        const Values rest = probe(Operation::fraction, x);
        std::size_t wrong = 0;
        for (std::size_t i = 0; i < x.size(); ++i) {
            wrong += whole[i] == std::nearbyint(x[i]) ? 0 : 1;  // both: ties to even
            wrong += Quad(whole[i]) + Quad(rest[i]) == Quad(x[i]) ? 0 : 1;
            wrong += std::abs(rest[i]) <= 0.5 ? 0 : 1;
        }
        EXPECT_EQ(wrong, 0U);
    });
}

TEST_F(SimdMath, SineAndCosine) {
    const Values fringes = fringe_arguments();
    on_every_target([&] {
        const Values sine = probe(Operation::sine, fringes);
        const Values cosine = probe(Operation::cosine, fringes);
        Worst worst;
        Worst norm;
        for (std::size_t i = 0; i < fringes.size(); ++i) {
            // Taking whole quarters away is exact, and keeps the reference's own error near its last bit.
            const long double quarters = std::nearbyint(4.0L * fringes[i]);
            const long double x = 2.0L * pi * (fringes[i] - 0.25L * quarters);
            const auto quadrant = static_cast<std::int64_t>(quarters) & 3;
            const long double s = quadrant % 2 == 0 ? std::sin(x) : std::cos(x);
            const long double c = quadrant % 2 == 0 ? std::cos(x) : std::sin(x);
            worst.add(sine[i], quadrant >= 2 ? -s : s, fringes[i]);
            worst.add(cosine[i], quadrant == 1 || quadrant == 2 ? -c : c, fringes[i]);
            norm.add(static_cast<long double>(sine[i]) * sine[i] + static_cast<long double>(cosine[i]) * cosine[i],
                     1.0L, fringes[i]);
        }
        worst.print("sincos");
        EXPECT_LT(worst.error, 2e-16) << "at " << worst.at << " fringes";
        // Twice an error on either axis.
        EXPECT_LT(norm.error, 4e-16) << "at " << norm.at << " fringes";
        // Where the exact value is representable it is met.
        const Values quarter{0.0, 0.25, 0.5, 0.75, 1.0, -0.25, -0.5, 0x1p47, 0x1p47 - 0.25, -0x1p47 + 0.5};
        const Values exact_sine{0.0, 1.0, 0.0, -1.0, 0.0, -1.0, 0.0, 0.0, -1.0, 0.0};
        const Values exact_cosine{1.0, 0.0, -1.0, 0.0, 1.0, 0.0, -1.0, 1.0, 0.0, -1.0};
        const Values s = probe(Operation::sine, quarter);
        const Values c = probe(Operation::cosine, quarter);
        for (std::size_t i = 0; i < quarter.size(); ++i) {
            EXPECT_EQ(s[i], exact_sine[i]) << quarter[i];
            EXPECT_EQ(c[i], exact_cosine[i]) << quarter[i];
        }
    });
}

TEST_F(SimdMath, SineOfSmallAnglesKeepsItsDigits) {
    Random random(105);
    Values fringes;
    for (int i = 0; i < 50000; ++i) fringes.push_back(random.spread(-900.0, -3.0));
    on_every_target([&] {
        const Values sine = probe(Operation::sine, fringes);
        Worst worst;
        for (std::size_t i = 0; i < fringes.size(); ++i) {
            const long double exact = std::sin(2.0L * pi * fringes[i]);
            worst.add(sine[i], exact, fringes[i], std::abs(exact));
        }
        worst.print("sincos, relative");
        // 2 pi and the product with it are rounded, half a unit each; the sum takes another half at most.
        EXPECT_LT(worst.error, 3 * 0x1p-53);
    });
}

TEST_F(SimdMath, ArctangentOfSmallSlopes) {
    const double limit = 0x1.a827999fcef32p-2;  // tan(pi/8)
    Values slopes{0.0, -0.0, limit, -limit, 0x1p-1022, -1e-300, 0x1p-52};
    for (int i = -40000; i <= 40000; ++i) slopes.push_back(limit * i / 40000.0);
    Random random(106);
    for (int i = 0; i < 50000; ++i) slopes.push_back(random.spread(-100.0, -1.28));
    on_every_target([&] {
        const Values angle = probe(Operation::atan_small, slopes);
        Worst worst;
        Worst relative;
        for (std::size_t i = 0; i < slopes.size(); ++i) {
            const long double exact = std::atan(static_cast<long double>(slopes[i]));
            worst.add(angle[i], exact, slopes[i]);
            if (slopes[i] != 0.0) relative.add(angle[i], exact, slopes[i], std::abs(exact));
        }
        worst.print("atan_small");
        relative.print("atan_small, relative");
        EXPECT_LT(worst.error, 1e-16) << "at " << worst.at;
        EXPECT_LT(relative.error, 2.5e-16) << "at " << relative.at;
    });
}

/// Complex numbers of the slopes at which arg and arg_right change their ways, of many sizes, and random ones.
void add_complex(Values& re, Values& im, bool right_only) {
    Random random(107);
    const auto add = [&](double x, double y) {
        // Beyond 3 pi/8 arg_right promises nothing.
        if (right_only && !(x > 0.0 && std::abs(y) <= 2.414213562373095 * x)) return;
        re.push_back(x);
        im.push_back(y);
    };
    Values slopes;
    for (const double slope : {0.0, 0x1p-52, 0x1.a827999fcef32p-2, 1.0, 2.4142135623730949, 1e16}) {
        add_around(slopes, slope);
    }
    for (int i = 0; i <= 20000; ++i) slopes.push_back(2.5 * i / 20000.0);
    for (const double slope : slopes) {
        for (const double size : {1.0, 3.7, 1e-200, 1e200}) {
            for (const double x : {size, -size}) {
                add(x, slope * size);
                add(x, -slope * size);
                add(slope * size, x);
                add(-slope * size, x);
            }
        }
    }
    for (int i = 0; i < 100000; ++i) add(random.uniform(-1.0, 1.0), random.uniform(-1.0, 1.0));
    for (int i = 0; i < 100000; ++i) add(random.spread(-400.0, 400.0), random.spread(-400.0, 400.0));
    for (const double size : {1.0, 0x1p-1000, 0x1p1022}) {
        for (const double x : {size, -size, 0.0, -0.0}) {
            for (const double y : {size, -size, 0.0, -0.0}) add(x, y);
        }
    }
}

Worst worst_angle(const Values& angle, const Values& re, const Values& im) {
    Worst worst;
    for (std::size_t i = 0; i < angle.size(); ++i) {
        // Without im the sign of a zero re is nobody's angle: 0 it is.
        const bool none = re[i] == 0.0 && im[i] == 0.0;
        const long double exact =
            none ? 0.0L : std::atan2(static_cast<long double>(im[i]), static_cast<long double>(re[i]));
        worst.add(angle[i], exact, std::atan2(im[i], re[i]));
    }
    return worst;
}

TEST_F(SimdMath, AngleInTheRightHalfPlane) {
    Values re;
    Values im;
    add_complex(re, im, true);
    on_every_target([&] {
        const Worst worst = worst_angle(probe(Operation::arg_right, re, im), re, im);
        worst.print("arg_right");
        EXPECT_LT(worst.error, 3e-16) << "at " << worst.at << " rad";
    });
}

TEST_F(SimdMath, AngleInAllQuadrants) {
    Values re;
    Values im;
    add_complex(re, im, false);
    on_every_target([&] {
        const Values angle = probe(Operation::arg, re, im);
        const Worst worst = worst_angle(angle, re, im);
        worst.print("arg");
        EXPECT_LT(worst.error, 5e-16) << "at " << worst.at << " rad";
        for (std::size_t i = 0; i < angle.size(); ++i) {
            ASSERT_EQ(std::signbit(angle[i]), std::signbit(im[i])) << re[i] << " + i " << im[i];
            ASSERT_LE(std::abs(angle[i]), 3.141592653589793);
        }
    });
}

TEST_F(SimdMath, ArgumentsAgreeWhereBothAreGood) {
    // arg may stand in for arg_right without a bit changing: the kernel chooses between them by gyros beside.
    Random random(108);
    Values re;
    Values im;
    for (int i = 0; i < 100000; ++i) {
        re.push_back(random.uniform(0.1, 2.0));
        im.push_back(re.back() * random.uniform(-1.0, 1.0));
    }
    on_every_target(
        [&] { EXPECT_EQ(differing_bits(probe(Operation::arg, re, im), probe(Operation::arg_right, re, im)), 0U); });
}

TEST_F(SimdMath, Logarithm) {
    Values x{0x1p-52, 0x1p-1022, 1.0, std::numeric_limits<double>::max()};
    for (int k = -1022; k < 1024; ++k) {
        x.push_back(std::ldexp(1.0, k));
        x.push_back(std::ldexp(1.0 + 0x1p-52, k));
        x.push_back(std::ldexp(2.0 - 0x1p-52, k));
    }
    add_around(x, 1.0, 1000);
    add_around(x, 0.70710678118654757, 100);  // where the exponent changes
    add_around(x, 1.4142135623730951, 100);
    for (int i = 1; i <= 50000; ++i) x.push_back(i / 50000.0);
    Random random(109);
    for (int i = 0; i < 100000; ++i) x.push_back(std::abs(random.spread(-1022.0, 1023.9)));
    on_every_target([&] {
        const Values logarithm = probe(Operation::log, x);
        Worst worst;
        Worst near_one;
        for (std::size_t i = 0; i < x.size(); ++i) {
            const long double exact = std::log(static_cast<long double>(x[i]));
            worst.add(logarithm[i], exact, x[i], 3e-16L + 2e-16L * std::abs(exact));
            if (x[i] != 1.0 && std::abs(x[i] - 1.0) < 0.25) near_one.add(logarithm[i], exact, x[i], std::abs(exact));
        }
        worst.print("log, in terms of what it promises");
        near_one.print("log near 1, relative");
        EXPECT_LT(worst.error, 1.0) << "at " << worst.at;
        // The smallest radii of normal deviates come from here: no digits may be lost to a sum.
        EXPECT_LT(near_one.error, 5e-16) << "at " << near_one.at;
        EXPECT_EQ(probe(Operation::log, {1.0})[0], 0.0);
    });
}

TEST_F(SimdMath, ExponentialIsExact) {
    Values x;
    for (int k = -1000; k <= 1000; ++k) add_around(x, 0.34657359027997264 * k, 20);  // where the power of two changes
    for (int i = -50000; i <= 50000; ++i) x.push_back(i / 50000.0);
    Random random(111);
    for (int i = 0; i < 100000; ++i) x.push_back(random.uniform(-700.0, 700.0));
    for (int i = 0; i < 20000; ++i) x.push_back(random.spread(-60.0, 9.0));
    on_every_target([&] {
        const Values power = probe(Operation::exp, x);
        Worst worst;
        for (std::size_t i = 0; i < x.size(); ++i) {
            const long double exact = std::exp(static_cast<long double>(x[i]));
            worst.add(power[i], exact, x[i], exact);
        }
        worst.print("exp, relative");
        EXPECT_LT(worst.error, 4e-16) << "at " << worst.at;
        EXPECT_EQ(probe(Operation::exp, {0.0})[0], 1.0);
    });
}

TEST_F(SimdMath, EveryInstructionSetHasTheSameBits) {
    const Values fringes = fringe_arguments();
    Values re;
    Values im;
    add_complex(re, im, false);
    Values right_re;
    Values right_im;
    add_complex(right_re, right_im, true);
    Random random(110);
    Values slopes;
    Values positive;
    Values powers;
    for (int i = 0; i < 50000; ++i) {
        powers.push_back(random.uniform(-700.0, 700.0));
        slopes.push_back(random.uniform(-0.41, 0.41));
        positive.push_back(std::abs(random.spread(-1022.0, 1023.9)));
    }
    const auto all = [&] {
        std::vector<Values> results;
        results.push_back(probe(Operation::sine, fringes));
        results.push_back(probe(Operation::cosine, fringes));
        results.push_back(probe(Operation::nearest, fringes));
        results.push_back(probe(Operation::fraction, fringes));
        results.push_back(probe(Operation::arg, re, im));
        results.push_back(probe(Operation::arg_right, right_re, right_im));
        results.push_back(probe(Operation::atan_small, slopes));
        results.push_back(probe(Operation::log, positive));
        results.push_back(probe(Operation::exp, powers));
        for (std::size_t terms = 2; terms <= 10; ++terms) results.push_back(probe_polynomial(terms, slopes));
        return results;
    };
    const auto best = all();
    on_every_target([&] {
        const auto results = all();
        for (std::size_t i = 0; i < best.size(); ++i) {
            EXPECT_EQ(differing_bits(results[i], best[i]), 0U) << "function " << i;
        }
    });
}

}  // namespace
}  // namespace simd_math_test
}  // namespace ringlock::test
