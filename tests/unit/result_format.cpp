// What a result file holds, against the page that describes it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hdf5.h>

#include <map>
#include <set>

#include "analysis/study/result_file.hpp"
#include "tests/unit/format_page.hpp"
#include "tests/unit/result_support.hpp"

namespace ringlock::study {
namespace {

using test::compare;
using test::Entries;
using test::page;
using test::ResultFile;
using test::small;
using test::walk;
using test::write;

std::map<hsize_t, std::string> extents(const Study& study) {
    const std::map<hsize_t, std::string> names = {{study.gyros.size(), "gyros"},
                                                  {static_cast<hsize_t>(study.schedule.samples), "samples"},
                                                  {study.angle_times_s.size(), "times"},
                                                  {study.arms.size(), "arms"},
                                                  {study.factors.size(), "taus"}};
    EXPECT_EQ(names.size(), 5U) << "extents must differ to be told apart";
    return names;
}

constexpr const char* the_page = RINGLOCK_SOURCE_DIR "/results/FORMAT.md";

std::vector<std::string> names_of(const std::vector<scenario::Arm>& arms) {
    std::vector<std::string> names;
    for (const scenario::Arm& arm : arms) names.push_back(arm.name);
    return names;
}

TEST_F(ResultFile, HoldsWhatThePageSays) {
    scenario::Scenario scenario = small(true);
    scenario.effects["quantum_noise"]["deg_rt_h"] = 0.0;  // the drive repeats itself: closed forms, too
    scenario.arms = scenario::parse_arms({"ideal", "uncompensated", "noise_injected", "noise_injected+compensated"});
    scenario.ensemble.gyros = 5;  // no number that stands for anything else
    write(path_, scenario);
    const Entries file = walk(path_, extents(Study(scenario)));
    EXPECT_GT(file.size(), 80U);
    compare(page(the_page, names_of(scenario.arms)), file);
    EXPECT_EQ(left(), std::set<std::string>{"out.h5"});
}

TEST_F(ResultFile, HoldsNoAngleRecordWhereNoneIsWanted) {
    scenario::Scenario scenario = small(false);
    scenario.ensemble.gyros = 5;  // no number that stands for anything else
    write(path_, scenario);
    Entries expected = page(the_page, names_of(scenario.arms));
    EXPECT_EQ(expected.erase("/arms/uncompensated/rate_error_closed_form_deg_h"), 1U) << "there is quantum noise";
    for (const scenario::Arm& arm : scenario.arms) EXPECT_EQ(expected.erase("/arms/" + arm.name + "/angle_arcsec"), 1U);
    // Neither `ideal` nor `noise_injected` is among the arms.
    std::erase_if(expected, [](const auto& entry) {
        return entry.first.starts_with("/arms/ideal") || entry.first.starts_with("/arms/noise_injected/") ||
               entry.first.starts_with("/arms/noise_injected ");
    });
    compare(expected, walk(path_, extents(Study(scenario))));
}

}  // namespace
}  // namespace ringlock::study
