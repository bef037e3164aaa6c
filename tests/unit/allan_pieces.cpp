#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <random>
#include <utility>
#include <vector>

#include "analysis/allan/sums/piece_sums.hpp"
#include "tests/support/allan_oracle.hpp"

/// The sums of the modified and the Hadamard total deviation: all pieces together, against each on its own.
namespace allan_pieces_test {
namespace {

using namespace ringlock;

double relative(double mine, test::Quad truth) {
    return std::abs(static_cast<double>((static_cast<test::Quad>(mine) - truth) / truth));
}

struct Series {
    const char* name;
    std::vector<double> x;
};

/// What may lose digits in another way each.
std::vector<Series> all_series(std::size_t n) {
    std::mt19937_64 random(11);
    std::normal_distribution<double> normal;
    std::vector<Series> out;
    const auto add = [&](const char* name, const std::function<double(double)>& next) {
        Series s{name, {}};
        for (std::size_t i = 0; i < n; ++i) s.x.push_back(next(static_cast<double>(i)));
        out.push_back(std::move(s));
    };
    const auto length = static_cast<double>(n);
    double frequency = 0.0;
    double phase = 0.0;
    add("white phase", [&](double) { return normal(random); });
    add("random walk of phase", [&](double) { return phase += normal(random); });
    add("random walk of frequency", [&](double) { return phase += frequency += normal(random); });
    add("cubic", [&](double i) { return std::pow(i / length, 3); });
    add("exponential", [&](double i) { return std::exp(20.0 * i / length); });
    add("white phase on a drift", [&](double i) { return 1e9 + 3.7 * i + 1e-3 * i * i + normal(random); });
    add("white phase on a steep line", [&](double i) { return 1e7 / 3.0 * i + normal(random); });
    add("wave of 40 samples", [&](double i) { return std::cos(std::numbers::pi * i / 20.0) + 1e-5 * normal(random); });
    add("wild first sample", [&](double i) { return i == 0.0 ? 1e9 : normal(random); });
    add("jump", [&](double i) { return (i < length / 3.0 ? 0.0 : 1e6) + normal(random); });
    add("loud second half", [&](double i) { return (i < length / 2.0 ? 1.0 : 1e8) * normal(random); });
    return out;
}

// Quadruple precision, difference by difference. Rounding of a sum of squares: some 1e-16 times the root of its terms.
TEST(AllanPieces, EveryFactorAgreesWithTheDefinition) {
    for (const Series& s : all_series(90)) {
        const std::vector<test::Quad> exact(s.x.begin(), s.x.end());
        for (std::size_t m = 1; 3 * m <= s.x.size(); ++m) {
            const allan::SquareMean sum = allan::sum_of_pieces(s.x, m);
            const auto pieces = static_cast<std::int64_t>(s.x.size() - 3 * m + 1);
            const auto n = static_cast<double>(m);
            EXPECT_EQ(sum.terms, pieces);
            const test::Quad mean = test::piece_mean_square(exact, static_cast<std::int64_t>(m)) / (n * n);
            EXPECT_LE(relative(sum.sum, mean * pieces), 1e-14) << s.name << ", m = " << m;
        }
    }
}

// Blocks of every length beside blocks cut short by the end of the record; waves of a whole tau among them.
TEST(AllanPieces, TogetherTheyAreWhatTheyAreOneByOne) {
    for (const Series& s : all_series(701)) {
        for (std::size_t m = 1; 3 * m <= s.x.size(); ++m) {
            const double single = allan::sum_of_single_pieces(s.x, m).sum;
            EXPECT_LE(relative(allan::sum_of_pieces(s.x, m).sum, single), 3e-14) << s.name << ", m = " << m;
        }
    }
}

TEST(LongAllanPieces, LongPiecesKeepTheirDigits) {
    for (const Series& s : all_series(15'011)) {
        for (const std::size_t m : {1000U, 2503U, 4990U}) {
            const double single = allan::sum_of_single_pieces(s.x, m).sum;
            EXPECT_LE(relative(allan::sum_of_pieces(s.x, m).sum, single), 3e-14) << s.name << ", m = " << m;
        }
    }
}

// Such a wave shows in none of the differences of a piece that begins with its crest, and little in the next ones: sums
// of all pieces together would lose four digits.
TEST(AllanPieces, AWaveOfATauInFewPiecesKeepsItsDigits) {
    constexpr std::size_t m = 2000;
    std::mt19937_64 random(12);
    std::normal_distribution<double> normal;
    for (const std::size_t pieces : {1U, 2U, 17U, 31U, 101U, 501U}) {
        std::vector<double> x;
        for (std::size_t i = 0; i < 3 * m + pieces - 1; ++i) {
            x.push_back(std::cos(std::numbers::pi * (2.0 * static_cast<double>(i) + 1.0) / m) + 1e-3 * normal(random));
        }
        const double single = allan::sum_of_single_pieces(x, m).sum;
        EXPECT_LE(relative(allan::sum_of_pieces(x, m).sum, single), 3e-14) << pieces;
    }
}

// What differences are blind to leaves nothing: whole numbers not even rounding, and no sum is below zero.
TEST(AllanPieces, ALineLeavesNothing) {
    std::vector<double> whole;
    std::vector<double> tenths;
    for (int i = 0; i < 500; ++i) {
        whole.push_back(7.0 * i - 3.0);
        tenths.push_back(0.1 * i);
    }
    for (const std::size_t m : {1U, 7U, 9U, 40U, 150U, 166U}) {
        EXPECT_EQ(allan::sum_of_pieces(whole, m).sum, 0.0) << m;
        const double rest = allan::sum_of_pieces(tenths, m).sum;
        EXPECT_GE(rest, 0.0) << m;
        // 500 pieces of which each sample is rounded by up to 2^-48 (numbers below 64).
        EXPECT_LE(rest, 500 * std::pow(2.0, -96)) << m;
    }
}

TEST(AllanPieces, ShorterThanOnePieceHasNone) {
    const std::vector<double> x(29, 1.0);
    EXPECT_EQ(allan::sum_of_pieces(x, 10).terms, 0);
    EXPECT_EQ(allan::sum_of_pieces(x, 0).terms, 0);
    EXPECT_EQ(allan::sum_of_pieces(x, 9).terms, 3);
}

}  // namespace
}  // namespace allan_pieces_test
