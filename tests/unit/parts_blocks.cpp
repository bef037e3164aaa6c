#include <gmock/gmock.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <span>
#include <vector>

#include "analysis/parts/block_record.hpp"
#include "analysis/study/experiment.hpp"
#include "engine/core/error.hpp"
#include "tests/unit/result_support.hpp"

namespace ringlock::parts {
namespace parts_blocks_test {
namespace {

/// Keeps blocks and samples in memory.
class InMemory final : public study::Store {
   public:
    std::vector<study::FinishedBlock> blocks;
    std::vector<study::SampledAngles> samples;

    std::vector<study::Stretch> take_up(std::span<study::Study> points, std::int64_t first,
                                        std::int64_t last) override {
        std::vector<study::Stretch> gaps;
        for (std::size_t point = 0; point < points.size(); ++point) {
            const auto end = std::min(last, static_cast<std::int64_t>(points[point].gyros.size()));
            gaps.push_back({point, first, end});
        }
        return gaps;
    }
    std::unique_ptr<study::BlockKeeper> keeper(std::size_t, std::int64_t, std::size_t) override {
        class Keeper final : public study::BlockKeeper {
           public:
            explicit Keeper(InMemory& home) : home_(home) {}
            bool wants_samples() const override { return true; }
            void samples(const study::SampledAngles& samples) override {
                const std::lock_guard lock(home_.mutex_);
                home_.samples.push_back(samples);
            }
            void finish(const study::FinishedBlock& block) override {
                const std::lock_guard lock(home_.mutex_);
                home_.blocks.push_back(block);
            }

           private:
            InMemory& home_;
        };
        return std::make_unique<Keeper>(*this);
    }
    void collect(std::span<study::Study>, std::int64_t, std::int64_t) override {}
    double hours_before() const override { return 0.0; }

   private:
    std::mutex mutex_;
};

class BlockRecords : public testing::Test {
   protected:
    BlockRecords() : done_(study::run(study::Experiment(scenario()), 2, kept_, {})) {}
    static scenario::Scenario scenario() {
        scenario::Scenario s = test::small_design(true);
        s.ensemble.gyros = 20;
        return s;
    }
    InMemory kept_;
    study::Experiment done_;
};

TEST_F(BlockRecords, ComeBackToTheByte) {
    ASSERT_GE(kept_.blocks.size(), 4U);
    for (const study::FinishedBlock& block : kept_.blocks) {
        const auto bytes = pack(block);
        EXPECT_EQ(pack(unpack_block(bytes)), bytes);
        EXPECT_EQ(block_of(bytes), (BlockName{block.study, block.first_gyro}));
    }
    ASSERT_FALSE(kept_.samples.empty());
    for (const study::SampledAngles& samples : kept_.samples) {
        const auto bytes = pack(samples);
        EXPECT_EQ(pack(unpack_samples(bytes)), bytes);
        EXPECT_EQ(unpack_samples(bytes).angle_arcsec, samples.angle_arcsec);
        EXPECT_EQ(block_of(bytes), (BlockName{samples.study, samples.first_gyro}));
    }
}

TEST_F(BlockRecords, PutIntoAPlannedStudyMakeItTheOneThatRan) {
    study::Experiment again(scenario());
    for (const study::FinishedBlock& block : kept_.blocks) {
        study::take_up(again.points[block.study], unpack_block(pack(block)));
    }
    for (std::size_t point = 0; point < again.points.size(); ++point) {
        study::Study& a = again.points[point];
        study::Study& b = done_.points[point];
        EXPECT_EQ(a.gyros, b.gyros);
        EXPECT_EQ(a.turns, b.turns);
        EXPECT_EQ(a.tables_remade, b.tables_remade);
        EXPECT_EQ(a.contradictory_readings, b.contradictory_readings);
        EXPECT_EQ(a.turn_map_error_rad, b.turn_map_error_rad);
        for (std::size_t arm = 0; arm < a.arms.size(); ++arm) {
            // The statistics of all gyros, to the byte.
            const auto statistics = [&](study::Study& s) {
                return pack(study::FinishedBlock{0, 0, {}, {s.arms[arm].gyros}});
            };
            EXPECT_EQ(statistics(a), statistics(b));
        }
    }
}

TEST_F(BlockRecords, CutOffAnywhereOrWithMoreAfterThemAreRefused) {
    auto bytes = pack(kept_.blocks.front());
    for (std::size_t length = 0; length < bytes.size(); length += 1 + length / 50) {
        EXPECT_THROW(unpack_block(std::span(bytes).first(length)), InputError) << length;
    }
    bytes.push_back(std::byte{0});
    EXPECT_THROW(unpack_block(bytes), InputError);
}

TEST(FinishedBlockRecord, KeepsEveryFieldOfANoiseFit) {
    study::FinishedBlock block;
    block.gyros.resize(1);
    study::GyroStatistics gyro;
    gyro.noise.sinusoids = {{{1.0, 0.9, 1.1}, {2.0, 1.9, 2.1}, 3.0}};
    gyro.noise.correlated.emplace();
    gyro.noise.correlated->correlation_time_s = {4.0, 3.9, 4.1};
    gyro.noise.correlated->evidence = 5.0;
    gyro.noise.arw_deg_rt_h = {true, 6.0, 5.9, 6.1};
    gyro.noise.reason = "why";
    gyro.noise.goodness.reason = "which test";
    gyro.noise.goodness.p_line = 0.25;
    gyro.noise.pooling.red = true;
    gyro.rate_error_closed_form_deg_h = 7.0;
    block.arms = {{gyro}};
    const study::GyroStatistics back = unpack_block(pack(block)).arms.at(0).at(0);
    ASSERT_EQ(back.noise.sinusoids.size(), 1U);
    EXPECT_EQ(back.noise.sinusoids[0].rate_amplitude_deg_h.hi, 2.1);
    ASSERT_TRUE(back.noise.correlated);
    EXPECT_EQ(back.noise.correlated->correlation_time_s.lo, 3.9);
    EXPECT_EQ(back.noise.correlated->evidence, 5.0);
    EXPECT_TRUE(back.noise.arw_deg_rt_h.resolved);
    EXPECT_EQ(back.noise.arw_deg_rt_h.hi, 6.1);
    EXPECT_EQ(back.noise.reason, "why");
    EXPECT_EQ(back.noise.goodness.reason, "which test");
    EXPECT_EQ(back.noise.goodness.p_line, 0.25);
    EXPECT_TRUE(back.noise.pooling.red);
    EXPECT_EQ(back.rate_error_closed_form_deg_h, 7.0);
}

}  // namespace
}  // namespace parts_blocks_test
}  // namespace ringlock::parts
