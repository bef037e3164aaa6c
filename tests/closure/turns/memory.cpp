// What fits of long records keep, and what they make again or a piece at a time instead: the same numbers.
#include <gtest/gtest.h>
#include <oneapi/tbb/task_arena.h>

#include <atomic>
#include <cmath>
#include <random>
#include <span>
#include <vector>

#include "analysis/closure/turns/fit/fit.hpp"
#include "analysis/closure/turns/model/side_by_side.hpp"
#include "analysis/instrument/simulate.hpp"
#include "engine/scenario/scenario.hpp"

namespace ringlock::test::closure {
namespace turns_memory_test {
namespace {

using namespace ringlock::closure;

/// A short record with noise, longer than a piece, and a fit with an effect of the coupling.
struct ShortFit {
    static record::Record made() {
        scenario::Scenario of;
        of.ensemble.gyros = 1;
        of.ensemble.duration_s = 6.0;
        return instrument::simulate_record(of);
    }
    static TurnParameters start(const JoinedPhase& joined, const TurnSeries& series) {
        TurnParameters p;
        p.readout_sd_rad = joined.readout_sd_rad;
        p.injected_sd_rad = 1.0;
        p.wander_sd_rad = 1e-3;
        p.threshold_deg_h = series.setup.lockin_threshold_deg_h;
        p.effects.push_back({effects::find("lockin_turn_asymmetry"), {{"ratio", 0.05}}});
        return p;
    }
    /// The last sixth is held out.
    static Rows rows(std::size_t turns) {
        Rows rows(turns, 1);
        std::fill(rows.begin() + static_cast<std::ptrdiff_t>(turns / 6 * 5), rows.end(), 0);
        return rows;
    }

    const record::Record record = made();
    const JoinedPhase joined = join(*record.turns, {}, false);
    const TurnSeries series = prepare(record, joined);
    const TurnModel model{series, joined.phase_rad};
    const TurnFit fit{model, start(joined, series), rows(series.size())};
};

TEST(TurnFitMemory, WhatWasPutAwayComesAgainBitForBit) {
    const ShortFit of;
    const std::vector<double> innovations = of.fit.innovations();
    const std::vector<double> sd_rad = of.fit.sd_rad();
    const std::vector<double> phase_rad = of.fit.prediction().phase_rad;
    std::vector<double> ramp = of.series.time_s;
    const TurnFit::Score score = of.fit.score({ramp});
    of.fit.release();
    EXPECT_EQ(of.fit.innovations(), innovations);
    EXPECT_EQ(of.fit.sd_rad(), sd_rad);
    EXPECT_EQ(of.fit.prediction().phase_rad, phase_rad);
    EXPECT_EQ(of.fit.score({ramp}).chi2, score.chi2);
    // The columns are in the standard errors: asked for with those at hand that the fit ended with, and with others.
    const auto again = of.fit.with_noise(of.fit.parameters());
    again->release();
    const ShortFit fresh;
    const auto& before = fresh.fit.estimates();
    const auto& after = again->estimates();
    ASSERT_EQ(before.size(), after.size());
    for (std::size_t k = 0; k < before.size(); ++k) {
        EXPECT_EQ(before[k].value, after[k].value) << before[k].name;
        EXPECT_EQ(before[k].sd, after[k].sd) << before[k].name;
    }
}

TEST(TurnFitMemory, SeriesInPiecesAreThoseInWhole) {
    const ShortFit of;
    const auto& time = of.series.time_s;
    // Ramps from three times on, and one that is the model's own bias, of which nothing may be left.
    const std::size_t count = 4;
    const auto value = [&](std::size_t k, std::size_t i) {
        return k == 3 ? time[i] : std::max(0.0, time[i] - time.back() * static_cast<double>(k + 1) / 5.0);
    };
    std::vector<Regressor> whole;
    for (std::size_t k = 0; k < count; ++k) {
        std::vector<double> series(time.size());
        for (std::size_t i = 0; i < series.size(); ++i) series[i] = value(k, i);
        whole.emplace_back(std::move(series));
    }
    const TurnFit::Products found =
        of.fit.products(count, [&](std::size_t k, std::size_t first, std::span<double> values) {
            for (std::size_t i = 0; i < values.size(); ++i) values[i] = value(k, first + i);
        });
    const Eigen::VectorXd residual = of.fit.residual();
    for (std::size_t a = 0; a < count; ++a) {
        const Eigen::VectorXd x = of.fit.whitened(whole[a]);
        const auto row = static_cast<Eigen::Index>(a);
        for (std::size_t b = 0; b < count; ++b) {
            const Eigen::VectorXd y = of.fit.whitened(whole[b]);
            // Sums of a thousand products in another order.
            const double rounding = 1e-10 * (1.0 + x.norm() * y.norm());
            EXPECT_NEAR(found.squares(row, static_cast<Eigen::Index>(b)), x.dot(y), rounding) << a << " " << b;
        }
        EXPECT_NEAR(found.right(row), x.dot(residual), 1e-10 * (1.0 + x.norm() * residual.norm())) << a;
    }
    EXPECT_GT(found.squares(0, 0), 0.0);
    const TurnFit::Score score = of.fit.score({whole[0], whole[1]});
    const TurnFit::Score pieces =
        of.fit.score_pieces(2, [&](std::size_t k, std::size_t first, std::span<double> values) {
            for (std::size_t i = 0; i < values.size(); ++i) values[i] = value(k, first + i);
        });
    EXPECT_EQ(pieces.rank, score.rank);
    EXPECT_NEAR(pieces.chi2, score.chi2, 1e-9 * (1.0 + score.chi2));
}

TEST(TurnFitMemory, AFilterGoesOnWhereItStopped) {
    std::mt19937_64 random(11);
    std::normal_distribution<double> normal;
    constexpr std::size_t n = 100;
    TurnFrame frame;
    frame.interval_s = 0.004;
    std::vector<double> series(n);
    for (std::size_t i = 0; i < n; ++i) {
        frame.sign.push_back(i % 2 == 0 ? -1.0 : 1.0);
        frame.before_slope.push_back(0.07 * normal(random));
        frame.kick_slope.push_back(0.15 * normal(random));
        series[i] = normal(random);
    }
    TurnNoise noise;
    noise.injected_rad2 = 0.3;
    noise.readout_rad2 = 0.2;
    noise.wander_rad2 = 0.05;
    noise.walk_rad2_per_s3 = 900.0;
    noise.rates = {{0.5, 20.0}};
    const Whitening whitening(frame, noise);
    const std::vector<double> whole = whitening.apply(series);
    std::vector<double> pieces = series;
    FilterState state{};
    for (const auto& [first, count] : {std::pair<std::size_t, std::size_t>{0, 1}, {1, 63}, {64, 36}}) {
        whitening.apply(first, std::span(pieces).subspan(first, count), state);
    }
    EXPECT_EQ(pieces, whole);
    const Whitening::Innovations once = Whitening::innovations(frame, noise, series);
    EXPECT_EQ(once.white, whole);
    EXPECT_EQ(once.sd_rad, whitening.sd_rad());
}

TEST(SideBySide, AWaitingThreadBeginsNothingElse) {
    constexpr int threads = 2;
    oneapi::tbb::task_arena arena(threads);
    std::atomic<int> begun = 0;
    std::atomic<int> most = 0;
    arena.execute([&] {
        side_by_side(64, [&](int) {
            const int now = ++begun;
            int seen = most;
            while (seen < now && !most.compare_exchange_weak(seen, now)) {
            }
            std::atomic<double> sum = 0.0;
            side_by_side(64, [&](int k) { sum = sum + std::sqrt(k); });
            --begun;
        });
    });
    EXPECT_LE(most, threads);
}

}  // namespace
}  // namespace turns_memory_test
}  // namespace ringlock::test::closure
