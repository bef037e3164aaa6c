// One rate of the source for several records, by the sum of their log-likelihoods.
#include "analysis/closure/chain/shared_rate.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "analysis/closure/chain.hpp"
#include "engine/core/error.hpp"

namespace ringlock::test::closure {
namespace chain_shared_rate_test {
namespace {

using namespace ringlock::closure;
using testing::DoubleNear;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::UnorderedElementsAre;

// k times the record's rate plus or minus the same difference, from 0.3 to 4.5 times the record's rate.
TEST(SharedRate, IsOneOfThoseThatLeaveTheSamePattern) {
    const std::vector<double> found{275.0001, 125.0};
    const std::vector<double> all = rates_of_patterns(found, 100.0);
    EXPECT_EQ(all.front(), 275.0001);
    const auto near = [](double hz) { return DoubleNear(hz, 1e-3); };
    EXPECT_THAT(all, UnorderedElementsAre(near(75.0), near(125.0), near(175.0), near(225.0), near(275.0), near(325.0),
                                          near(375.0), near(425.0)));
    // A slow source is found by its straight lines and stays, though nothing slower than 0.3 is searched for.
    const std::vector<double> slow = rates_of_patterns(std::vector{12.5}, 100.0);
    EXPECT_EQ(slow.front(), 12.5);
    EXPECT_EQ(slow.size(), 9U);
}

// One clock was once called 125, 275 and 75 Hz by the three axes of one box: alone the second and the third are wrong
// or cannot tell, together they can.
TEST(SharedRate, IsLikeliestOnAllRecordsTogether) {
    const RateTable table{
        100.0, {75.0, 125.0, 275.0}, {{-900.0, -880.0, -883.0}, {-512.0, -504.0, -503.0}, {-301.0, -302.0, -310.0}}};
    const std::vector<ChainRate> rates = ranked(table);
    ASSERT_EQ(rates.size(), 3U);
    EXPECT_EQ(rates[0].hz, 125.0);
    EXPECT_EQ(rates[1].hz, 275.0);
    EXPECT_EQ(rates[2].hz, 75.0);
    // -3 + 1 - 8, and -20 - 8 + 1
    EXPECT_DOUBLE_EQ(rates[1].sum, -10.0);
    EXPECT_THAT(rates[1].log_likelihood, ElementsAre(-3.0, 1.0, -8.0));
    EXPECT_DOUBLE_EQ(rates[2].sum, -27.0);
    for (const ChainRate& rate : rates) EXPECT_FALSE(rate.tied) << rate.hz;
}

TEST(SharedRate, IsTiedWhereTheSumTellsNothing) {
    const RateTable table{100.0, {75.0, 125.0, 275.0}, {{-20.0, 0.0, -1.0}, {-20.0, 0.0, -2.5}}};
    const std::vector<ChainRate> rates = ranked(table);
    EXPECT_FALSE(rates[0].tied) << "the likeliest is tied to nothing";
    EXPECT_TRUE(rates[1].tied) << "3.5 is less than 4";
    EXPECT_FALSE(rates[2].tied);
}

// Interpolated readings that no sample lies between are not seen: whatever the sum says, rates above twice the
// record's that leave the same pattern are not told apart. Those of another pattern are.
TEST(SharedRate, IsNeverToldAboveTwiceTheRecordsRate) {
    const RateTable table{100.0, {125.0, 275.0, 325.0, 331.0}, {{-60.0, 0.0, -50.0, -50.0}}};
    for (const ChainRate& rate : ranked(table)) EXPECT_EQ(rate.tied, rate.hz == 325.0) << rate.hz;
}

TEST(SharedRate, IsTheMeanByInformation) {
    // Weights 1 and 4: (1 * 0 + 4 * 5)/5 = 4, of a standard error 1/sqrt(5); 4^2/1 + 1^2/(1/4) = 20 of chi-squared.
    const double unit_hz = 1e-6;
    const SharedRate shared =
        shared_of(std::vector<RateEstimate>{{125.0, unit_hz}, {125.0 + 5.0 * unit_hz, 0.5 * unit_hz}});
    EXPECT_NEAR(shared.mean.hz, 125.0 + 4.0 * unit_hz, 1e-6 * unit_hz);
    EXPECT_NEAR(shared.mean.sd_hz, unit_hz / std::sqrt(5.0), 1e-9 * unit_hz);
    EXPECT_NEAR(shared.chi2, 20.0, 1e-4);  // digits of 125 Hz
    EXPECT_EQ(shared.freedom, 1);
    EXPECT_NEAR(shared.p_value, 7.744e-6, 1e-8);
    EXPECT_EQ(shared_of(std::vector<RateEstimate>{{125.0, unit_hz}}).p_value, 1.0);
}

record::Record samples(double rate_hz) {
    record::Record record;
    record.samples.emplace();
    record.samples->rate_hz = rate_hz;
    record.samples->values.assign(2000, 0.0);
    return record;
}

std::string refused(const std::vector<NamedRecord>& records) {
    try {
        refuse_no_chain(records);
    } catch (const InputError& error) {
        return error.what();
    }
    return "";
}

TEST(DataChain, IsOfRecordsOfSamplesAtOneRate) {
    const record::Record a = samples(100.0);
    const record::Record b = samples(200.0);
    record::Record turns;
    turns.turns.emplace();
    EXPECT_EQ(refused({{"a.csv", &a}, {"c.csv", &a}}), "");
    EXPECT_THAT(refused({{"a.csv", &a}}), HasSubstr("two or more records"));
    EXPECT_THAT(refused({{"a.csv", &a}, {"b.csv", &b}}),
                HasSubstr("b.csv: has 200 samples a second and a.csv has 100"));
    EXPECT_THAT(refused({{"a.csv", &a}, {"t.h5", &turns}}), HasSubstr("t.h5: is a record of turns"));
}

}  // namespace
}  // namespace chain_shared_rate_test
}  // namespace ringlock::test::closure
