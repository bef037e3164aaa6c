// Records of one box, whose data chain interpolates all of them from one source clock.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "analysis/closure/chain.hpp"
#include "analysis/closure/closure.hpp"
#include "tests/closure/generator/samples.hpp"

namespace ringlock::test::closure {
namespace chain_records_test {
namespace {

using ringlock::closure::Chain;
using ringlock::closure::ChainRecord;
using ringlock::closure::close_chain;
using ringlock::closure::Closure;
using ringlock::closure::Estimate;
using ringlock::closure::NamedRecord;
using ringlock::closure::Step;

struct Axis {
    double from_hz, white_angle_arcsec, rate_noise_deg_rt_h;
    std::uint64_t seed;
};

Chain chain_of(const std::vector<Axis>& axes, std::size_t size = 10000) {
    std::vector<record::Record> records;
    for (const Axis& axis : axes) {
        SampleTruth truth;
        truth.size = size;
        truth.seed = axis.seed;
        truth.white_angle_arcsec = axis.white_angle_arcsec;
        truth.rates.quantum_noise_deg_rt_h = axis.rate_noise_deg_rt_h;
        truth.resampling.from_hz = axis.from_hz;
        records.push_back(generate_samples(truth));
    }
    std::vector<NamedRecord> named;
    for (std::size_t k = 0; k < records.size(); ++k) named.push_back({std::string(1, "xyz"[k % 3]), &records[k]});
    return close_chain(named);
}

const Estimate* source_of(const Closure& closure) {
    for (const Step& step : closure.steps) {
        if (step.name() == "resampling") return &step.parameters.front();
    }
    return nullptr;
}

// By itself the first record cannot tell 134.33 Hz from 200 - 134.33 Hz, and the last one, whose rate noise hides what
// interpolation leaves, finds no source. Together they name it, and know it better than any of them.
TEST(LongDataChain, TellsOneSourceWhereARecordAloneCannot) {
    const Chain chain = chain_of({{134.33, 0.1, 0.025, 3}, {134.33, 0.1, 0.04, 4}, {134.33, 0.1, 0.15, 12}});
    ASSERT_EQ(chain.records.size(), 3U);
    EXPECT_EQ(chain.records[0].alone_other_hz.size(), 1U);
    EXPECT_FALSE(chain.records[2].alone_hz);
    ASSERT_TRUE(chain.shared);
    EXPECT_NEAR(chain.shared->hz, 134.33, 4.0 * chain.shared->sd_hz);
    EXPECT_TRUE(chain.tied_hz().empty());
    EXPECT_EQ(chain.freedom, 2);
    EXPECT_GT(chain.p_value, 1e-3);  // three standard errors
    for (const ChainRecord& record : chain.records) {
        ASSERT_TRUE(record.near_shared) << record.name;
        EXPECT_LT(chain.shared->sd_hz, record.near_shared->sd_hz);
        const Estimate* from_hz = source_of(record.closure);
        ASSERT_NE(from_hz, nullptr) << record.name;
        EXPECT_NEAR(from_hz->value, chain.shared->hz, 1e-9);
        EXPECT_EQ(from_hz->sd, chain.shared->sd_hz);
        EXPECT_EQ(record.closure.verdict, ringlock::closure::Verdict::closed);
    }
}

// Near twice the record's rate nothing tells rates of one pattern apart, so that two records may be called by two of
// them. They have one name then, and the tie stays.
TEST(LongDataChain, GivesOneNameToWhatStaysATie) {
    const Chain chain = chain_of({{186.87, 0.3, 0.01, 8}, {186.87, 0.3, 0.01, 9}});
    ASSERT_TRUE(chain.records[0].alone_hz && chain.records[1].alone_hz);
    EXPECT_GT(std::abs(*chain.records[0].alone_hz - *chain.records[1].alone_hz), 1.0) << "nothing to be shared";
    ASSERT_TRUE(chain.shared);
    std::vector<double> named = chain.tied_hz();
    EXPECT_FALSE(named.empty());
    named.push_back(chain.shared->hz);
    EXPECT_TRUE(std::any_of(named.begin(), named.end(), [](double hz) { return std::abs(hz - 186.87) < 0.01; }));
    for (const ChainRecord& record : chain.records) {
        const Estimate* from_hz = source_of(record.closure);
        ASSERT_NE(from_hz, nullptr) << record.name;
        EXPECT_NEAR(from_hz->value, chain.shared->hz, 1e-9);
        EXPECT_TRUE(std::isnan(from_hz->sd)) << "other rates are as likely";
    }
}

// Two sources that leave one pattern: what is certain of one record, by the lines that its slow source leaves, is not
// forced upon the others.
TEST(LongDataChain, SaysWhereRecordsContradictEachOther) {
    const Chain chain = chain_of({{134.33, 0.1, 0.025, 3}, {134.33, 0.1, 0.04, 4}, {65.67, 0.1, 0.03, 22}});
    EXPECT_TRUE(chain.contradicted());
    EXPECT_FALSE(chain.shared);
    EXPECT_TRUE(chain.records[1].contradicts);
    EXPECT_LT(chain.records[1].p_alone, 1e-3);
    const double truths_hz[] = {134.33, 134.33, 65.67};
    for (std::size_t k = 0; k < 3; ++k) {
        const Estimate* from_hz = source_of(chain.records[k].closure);
        ASSERT_NE(from_hz, nullptr);
        EXPECT_NEAR(from_hz->value, truths_hz[k], 0.01) << "each report is that of its record alone";
    }
}

// A channel that does not go through the interpolation says nothing of its source, and keeps its own report.
TEST(LongDataChain, KeepsTheReportOfARecordThatShowsNoSource) {
    const Chain chain = chain_of({{134.33, 0.1, 0.04, 4}, {0.0, 0.3, 0.01, 11}});
    EXPECT_FALSE(chain.contradicted());
    ASSERT_TRUE(chain.shared);
    EXPECT_NEAR(chain.shared->hz, 134.33, 4.0 * chain.shared->sd_hz);
    EXPECT_EQ(chain.freedom, 0) << "one rate agrees with itself";
    const ChainRecord& other = chain.records[1];
    EXPECT_FALSE(other.near_shared);
    EXPECT_EQ(other.closure.verdict, ringlock::closure::Verdict::nothing_missing);
    EXPECT_TRUE(other.closure.steps.empty());
    EXPECT_EQ(other.closure.notes.size(), 1U);
}

TEST(LongDataChain, SharesNothingWhereNoRecordShowsASource) {
    const Chain chain = chain_of({{0.0, 0.3, 0.01, 31}, {0.0, 0.3, 0.01, 32}}, 3000);
    EXPECT_EQ(chain.effect, nullptr);
    EXPECT_FALSE(chain.shared);
    EXPECT_FALSE(chain.contradicted());
    EXPECT_TRUE(chain.rates.empty());
    for (const ChainRecord& record : chain.records) {
        EXPECT_EQ(record.closure.verdict, ringlock::closure::Verdict::nothing_missing);
    }
}

}  // namespace
}  // namespace chain_records_test
}  // namespace ringlock::test::closure
