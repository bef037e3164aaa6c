// Fixed point of the angle output.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "engine/ensemble/output_counts.hpp"

namespace ringlock::test {
namespace ensemble_output_counts_test {
namespace {

using simd::lanes;

struct Piece {
    readout::LaneAngles angles;
    compensate::LaneErrors errors;
};

/// Random angles of up to `fringes` whole ones.
Piece random_piece(std::size_t turns, double fringes, std::uint64_t seed) {
    std::mt19937_64 engine(seed);
    std::uniform_real_distribution<double> small(-3.0, 3.0);
    std::uniform_real_distribution<double> large(-fringes, fringes);
    Piece piece;
    piece.angles.resize(turns);
    piece.errors.fringes.resize(turns);
    for (std::size_t g = 0; g < lanes; ++g) {
        piece.errors.whole[g] = std::nearbyint(0.1 * large(engine));
        for (std::size_t i = 0; i < turns; ++i) {
            piece.angles.angle_fringes[i][g] = small(engine);
            piece.angles.angle_whole[i][g] = std::nearbyint(large(engine));
            piece.errors.fringes[i][g] = small(engine);
        }
    }
    return piece;
}

/// The angle in counts by long double, whose 64 bits hold 2^30 fringes and their fraction.
long double exact_counts(const Piece& piece, bool corrected, std::size_t i, std::size_t g) {
    long double fringes = static_cast<long double>(piece.angles.angle_whole[i][g]) + piece.angles.angle_fringes[i][g];
    if (corrected) fringes -= static_cast<long double>(piece.errors.whole[g]) + piece.errors.fringes[i][g];
    return fringes * static_cast<long double>(ensemble::counts_per_fringe);
}

TEST(OutputCounts, AreTheAngleToHalfACount) {
    for (const std::size_t turns : {1U, 2U, 63U, 64U}) {
        const Piece piece = random_piece(turns, 1e8, 701);
        for (const bool corrected : {false, true}) {
            std::vector<simd::LaneCounts> counts;
            ensemble::output_counts(piece.angles, corrected ? &piece.errors : nullptr, turns, counts);
            ASSERT_EQ(counts.size(), (turns + 1) / 2);
            for (std::size_t i = 0; i < turns; i += 2) {
                for (std::size_t g = 0; g < lanes; ++g) {
                    const long double off =
                        static_cast<long double>(counts[i / 2][g]) - exact_counts(piece, corrected, i, g);
                    // And the rounding of a difference of some fringes, 4e-16 of them or 4e-6 counts.
                    ASSERT_LE(std::abs(off), 0.5L + 1e-5L);
                }
            }
        }
    }
}

TEST(OutputCounts, OfEveryTurnAreThoseOfTheMinimaAndMore) {
    const Piece piece = random_piece(63, 1e8, 703);
    std::vector<simd::LaneCounts> minima, turns;
    ensemble::output_counts(piece.angles, &piece.errors, 63, minima);
    ensemble::output_counts(piece.angles, &piece.errors, 63, turns, 1);
    ASSERT_EQ(turns.size(), 63U);
    for (std::size_t i = 0; i < 63; ++i) {
        for (std::size_t g = 0; g < lanes; ++g) {
            if (i % 2 == 0) {
                EXPECT_EQ(turns[i][g], minima[i / 2][g]);
            }
            const long double off = static_cast<long double>(turns[i][g]) - exact_counts(piece, true, i, g);
            ASSERT_LE(std::abs(off), 0.5L + 1e-5L);
        }
    }
}

TEST(OutputCounts, WrapRoundAndKeepDifferences) {
    // 2^31 fringes are 2^63 counts. What was counted beyond comes round from the other end.
    Piece piece = random_piece(64, 1.0, 702);
    std::vector<simd::LaneCounts> near_zero;
    ensemble::output_counts(piece.angles, &piece.errors, 64, near_zero);
    for (const double offset : {0x1p31 - 2.0, -0x1p31 + 2.0, 0x1p31, 0x1p33 + 12345.0, -0x1p40}) {
        Piece far = piece;
        for (std::size_t i = 0; i < 64; ++i) {
            for (std::size_t g = 0; g < lanes; ++g) far.angles.angle_whole[i][g] += offset;
        }
        std::vector<simd::LaneCounts> counts;
        ensemble::output_counts(far.angles, &far.errors, 64, counts);
        for (std::size_t i = 1; i < counts.size(); ++i) {
            for (std::size_t g = 0; g < lanes; ++g) {
                const auto difference = [&](const std::vector<simd::LaneCounts>& of) {
                    return static_cast<std::int64_t>(static_cast<std::uint64_t>(of[i][g]) -
                                                     static_cast<std::uint64_t>(of[i - 1][g]));
                };
                ASSERT_EQ(difference(counts), difference(near_zero)) << offset;
            }
        }
        // Somewhere the counts themselves have come round.
        if (std::abs(offset) >= 0x1p31) continue;
        bool positive = false;
        bool negative = false;
        for (const auto& row : counts) {
            for (std::size_t g = 0; g < lanes; ++g) (row[g] > 0 ? positive : negative) = true;
        }
        EXPECT_TRUE(positive && negative) << offset;
    }
}

TEST(OutputCounts, OfOneAngleAreThoseOfTheAngleToHalfACount) {
    std::mt19937_64 engine(702);
    std::uniform_real_distribution<double> fringes(-2.1e9, 2.1e9);
    for (int i = 0; i < 1000; ++i) {
        const double angle = fringes(engine);
        const long double exact = static_cast<long double>(angle) * ensemble::counts_per_fringe;
        EXPECT_LE(std::abs(static_cast<long double>(ensemble::counts_of(angle)) - exact), 0.5L) << angle;
    }
    // They wrap round, and differences hold.
    const double before = 2147483647.75;
    const double after = 2147483649.5;
    const auto difference = static_cast<std::uint64_t>(ensemble::counts_of(after)) -
                            static_cast<std::uint64_t>(ensemble::counts_of(before));
    EXPECT_LT(ensemble::counts_of(after), 0);
    EXPECT_EQ(static_cast<double>(difference), 1.75 * ensemble::counts_per_fringe);
}

}  // namespace
}  // namespace ensemble_output_counts_test
}  // namespace ringlock::test
