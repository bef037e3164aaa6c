#include <gmock/gmock.h>

#include <cstdint>
#include <random>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "analysis/parts/manifest.hpp"
#include "analysis/parts/shard.hpp"
#include "engine/core/error.hpp"
#include "engine/scenario/scenario.hpp"
#include "tests/support/expect_throw.hpp"

namespace ringlock::parts {
namespace parts_shards_test {
namespace {

using Gyros = std::vector<std::int64_t>;

TEST(Shards, HaveEveryGyroOfEveryPointOnceAndNoneIsEmpty) {
    std::mt19937_64 random(7);
    const auto whole = [&](std::int64_t lo, std::int64_t hi) {
        return std::uniform_int_distribution<std::int64_t>(lo, hi)(random);
    };
    for (int trial = 0; trial < 300; ++trial) {
        Gyros gyros(static_cast<std::size_t>(whole(1, 6)));
        std::int64_t all = 0;
        for (std::int64_t& n : gyros) all += n = whole(1, 70);
        const std::int64_t count = whole(1, std::min<std::int64_t>(all, 20));
        std::set<std::pair<std::size_t, std::int64_t>> seen;
        for (std::int64_t number = 1; number <= count; ++number) {
            const auto stretches = stretches_of({count, number}, gyros);
            EXPECT_FALSE(stretches.empty()) << number << " of " << count;
            for (const study::Stretch& stretch : stretches) {
                ASSERT_LT(stretch.first, stretch.last);
                ASSERT_LE(stretch.last, gyros[stretch.study]);
                for (std::int64_t gyro = stretch.first; gyro < stretch.last; ++gyro) {
                    EXPECT_TRUE(seen.insert({stretch.study, gyro}).second) << "twice: " << gyro;
                }
            }
        }
        EXPECT_EQ(static_cast<std::int64_t>(seen.size()), all);
    }
}

TEST(Shards, OfOneAreTheWholeRun) {
    EXPECT_EQ(stretches_of({1, 1}, Gyros{100, 7}), (std::vector<study::Stretch>{{0, 0, 100}, {1, 0, 7}}));
}

TEST(Shards, AreMadeOfFullBlocksWhereThereAreEnough) {
    for (const study::Stretch& stretch : stretches_of({3, 2}, Gyros{160})) {
        EXPECT_EQ(stretch.first % 16, 0);
        EXPECT_EQ(stretch.last % 16, 0);
    }
}

TEST(Shards, MoreThanThereAreGyrosAreRefused) {
    EXPECT_THAT(test::message_of<InputError>([] { stretches_of({8, 1}, Gyros{3, 4}); }), testing::HasSubstr("7 gyros"));
}

TEST(Shards, TakeOfGapsWhatIsTheirs) {
    const std::vector<study::Stretch> gaps = {{0, 10, 40}, {1, 0, 5}};
    std::int64_t gyros = 0;
    for (const std::int64_t number : {1, 2, 3}) {
        for (const study::Stretch& mine : within(gaps, Gyros{64, 5}, {3, number})) gyros += mine.last - mine.first;
    }
    EXPECT_EQ(gyros, 35);
    EXPECT_THAT(within(gaps, Gyros{64, 5}, {1, 1}), testing::ElementsAreArray(gaps));
}

TEST(Shards, AreNamedByNumberAndCount) {
    EXPECT_EQ(parse_shard("2/7"), (Shard{7, 2}));
    EXPECT_EQ(to_string(Shard{7, 2}), "2/7");
    for (const char* const bad : {"", "2", "/", "2/", "/7", "0/7", "8/7", "-1/7", "1/0", "a/7", "2/7/9", "2 /7",
                                  "1.5/2", "99999999999999999999/7"}) {
        EXPECT_THAT(test::message_of<InputError>([&] { parse_shard(bad); }), testing::HasSubstr("--shard"));
    }
}

TEST(Manifest, ComesBackFromItsText) {
    scenario::Scenario scenario;
    scenario.ensemble.seed = 77;
    scenario.effects["quantum_noise"]["deg_rt_h"] = 0.001;
    for (const auto& shard : {std::optional<Shard>{}, std::optional<Shard>{Shard{7, 2}}}) {
        const Manifest manifest = manifest_of(scenario, shard);
        EXPECT_EQ(parse_manifest(to_json(manifest), "here"), manifest);
        EXPECT_EQ(differences(manifest, manifest), std::vector<std::string>{});
    }
}

TEST(Manifest, TellsEveryDifferenceButTheShard) {
    scenario::Scenario scenario;
    const Manifest before = manifest_of(scenario, Shard{2, 1});
    scenario.ensemble.seed = 77;
    scenario.gyro.lockin_threshold_deg_h = 200.0;
    scenario.design.kind = scenario::DesignKind::list;
    scenario.design.vary = {{.key = "gyro.lockin_threshold_deg_h", .values = {200.0, 300.0}}};
    Manifest now = manifest_of(scenario, Shard{2, 2});
    now.git_hash = "other";
    EXPECT_THAT(differences(before, now),
                testing::UnorderedElementsAre(testing::HasSubstr("ensemble.seed"),
                                              testing::AllOf(testing::HasSubstr("gyro.lockin_threshold_deg_h"),
                                                             testing::HasSubstr("300"), testing::HasSubstr("200")),
                                              testing::HasSubstr("design.kind"), testing::HasSubstr("[[design.vary]]"),
                                              testing::HasSubstr("commit of the program")));
}

TEST(Manifest, IsRefusedWhereItIsNone) {
    for (const char* const bad : {"", "{}", "[1]", "{\"format\": \"other\"}", "null"}) {
        EXPECT_THROW(parse_manifest(bad, "here"), InputError) << bad;
    }
}

}  // namespace
}  // namespace parts_shards_test
}  // namespace ringlock::parts
