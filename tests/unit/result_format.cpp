// What a result file holds, against the page that describes it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hdf5.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>
#include <map>
#include <regex>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "analysis/study/replay.hpp"
#include "analysis/study/result/replay_file.hpp"
#include "analysis/study/result/result_file.hpp"
#include "tests/support/open_file.hpp"
#include "tests/unit/format_page.hpp"
#include "tests/unit/result_support.hpp"

namespace ringlock::study {
namespace result_format_test {
namespace {

using test::compare;
using test::Entries;
using test::page;
using test::ResultFile;
using test::small;
using test::small_design;
using test::unit_of_name;
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
constexpr const char* of_results = "The result file of `ringlock run`";
constexpr const char* of_replays = "The file of `ringlock replay`";

/// The page of results, for those arms; what only studies have whose arms are read is left out.
Entries page_of_results(const std::vector<std::string>& arms) {
    Entries entries = page(the_page, arms, of_results);
    const auto erased = std::erase_if(entries, [](const auto& entry) { return entry.first.starts_with("/reader"); });
    EXPECT_EQ(erased, 14U);
    return entries;
}

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
    compare(page_of_results(names_of(scenario.arms)), file);
    EXPECT_EQ(left(), std::set<std::string>{"out.h5"});
}

TEST_F(ResultFile, HoldsNoAngleRecordWhereNoneIsWanted) {
    scenario::Scenario scenario = small(false);
    scenario.ensemble.gyros = 5;  // no number that stands for anything else
    write(path_, scenario);
    Entries expected = page_of_results(names_of(scenario.arms));
    EXPECT_EQ(expected.erase("/arms/uncompensated/rate_error_closed_form_deg_h"), 1U) << "there is quantum noise";
    for (const scenario::Arm& arm : scenario.arms) EXPECT_EQ(expected.erase("/arms/" + arm.name + "/angle_arcsec"), 1U);
    // Neither `ideal` nor `noise_injected` is among the arms.
    std::erase_if(expected, [](const auto& entry) {
        return entry.first.starts_with("/arms/ideal") || entry.first.starts_with("/arms/noise_injected/") ||
               entry.first.starts_with("/arms/noise_injected ");
    });
    compare(expected, walk(path_, extents(Study(scenario))));
}

/// Its arms are read.
scenario::Scenario small_and_read() {
    scenario::Scenario scenario = small(true);
    scenario.reader.output_hz = 20.0;
    scenario.reader.latch_hz = 100.0;
    scenario.reader.stripping = reader::Stripping::reference_fir;
    scenario.reader.fir_order = 20;
    scenario.ensemble.gyros = 5;  // no number that stands for anything else
    scenario.ensemble.duration_s = 42.0;
    return scenario;
}

TEST_F(ResultFile, HoldsTheReaderThatThePageTells) {
    const scenario::Scenario scenario = small_and_read();
    write(path_, scenario);
    Entries expected = page(the_page, names_of(scenario.arms), of_results);
    std::erase_if(expected, [](const auto& entry) {
        return !entry.first.starts_with("/reader") && !entry.first.starts_with("/arms/uncompensated/a");
    });
    EXPECT_EQ(expected.erase("/arms/uncompensated/arw_reason"), 0U);
    const Entries file = walk(path_, extents(Study(scenario)));
    for (const auto& [name, entry] : expected) {
        ASSERT_TRUE(file.contains(name)) << name;
        EXPECT_EQ(file.at(name), entry) << name;
    }
    const store::File result = test::open_file(path_);
    const store::Group reader = result.group("reader");
    EXPECT_EQ(reader.double_attribute("output_hz"), 20.0);
    EXPECT_EQ(reader.string_attribute("stripping"), "reference+fir");
    EXPECT_EQ(reader.int_attribute("fir_order"), 20);
    EXPECT_DOUBLE_EQ(reader.double_attribute("delay_s"), 0.1);
    EXPECT_EQ(reader.double_attribute("residue_relative"), 0.0);
    EXPECT_DOUBLE_EQ(reader.double_attribute("warm_up_s"), 0.25);
    // It is read like any other result, and sums up to the same.
    const Summary summary = summarise(read_result(path_).points.front());
    const Summary again = summarise(run(Study(scenario), 1));
    ASSERT_EQ(summary.arms.size(), again.arms.size());
    for (std::size_t i = 0; i < again.arms.size(); ++i) {
        EXPECT_EQ(summary.arms[i].rate_error_deg_h.mean, again.arms[i].rate_error_deg_h.mean);
        EXPECT_EQ(summary.arms[i].arw_deg_rt_h.median, again.arms[i].arw_deg_rt_h.median);
        EXPECT_EQ(summary.arms[i].arw_deg_rt_h.hi, again.arms[i].arw_deg_rt_h.hi);
        EXPECT_EQ(summary.arms[i].allan.front().tau_s, 0.05);
    }
}

TEST_F(ResultFile, OfADesignHoldsTheReadersOfItsPoints) {
    scenario::Scenario scenario = small_and_read();
    scenario.output.angle_record = false;
    scenario.design.kind = scenario::DesignKind::list;
    scenario.design.vary = {{.key = "reader.output_hz", .values = {0.0, 20.0}}};
    write(path_, scenario);
    const store::File result = test::open_file(path_);
    const store::Group reader = result.group("reader");
    EXPECT_EQ(reader.dataset("output_hz").read<double>(), (std::vector<double>{0.0, 20.0}));
    EXPECT_EQ(reader.dataset("output_hz").shape(), (store::Shape{2}));
    EXPECT_EQ(reader.dataset("latch_hz").read<double>(), (std::vector<double>{100.0, 100.0}));
    EXPECT_EQ(reader.dataset("warm_up_s").read<double>().front(), 0.0);
    EXPECT_EQ(reader.dataset("stripping").read<std::string>().back(), "reference+fir");
    EXPECT_EQ(read_result(path_).points[1].factors.size(), Experiment(scenario).points[1].factors.size());
}

/// The page's section on designs.
std::string section_on_designs() {
    std::ifstream in(the_page);
    std::string text{std::istreambuf_iterator<char>(in), {}};
    const std::size_t begin = text.find("\n## Designs\n");
    EXPECT_NE(begin, std::string::npos);
    text.erase(0, begin + 1);
    return text.substr(0, text.find("\n## "));
}

/// Names in the section's quotes that begin so, with the type in brackets that follows them.
std::map<std::string, std::string> told(const std::string& section, const std::string& beginning) {
    std::map<std::string, std::string> found;
    std::vector<std::string> without_type;
    const std::regex token("`([^`]+)`|\\((i64|f64)\\)");
    for (std::sregex_iterator i(section.begin(), section.end(), token), end; i != end; ++i) {
        if ((*i)[2].matched) {
            for (const std::string& name : without_type) found[name] = (*i)[2];
            without_type.clear();
        } else if ((*i)[1].str().starts_with(beginning)) {
            without_type.push_back((*i)[1]);
        }
    }
    return found;
}

/// What the page says of the file of a design: its tables, with the differences of the section on designs.
Entries page_of_design(const scenario::Scenario& scenario, const std::map<std::string, std::string>& keys) {
    const std::string section = section_on_designs();
    const auto says = [&](const char* text) { EXPECT_NE(section.find(text), std::string::npos) << text; };
    Entries out;
    for (const auto& [name, entry] : page_of_results(names_of(scenario.arms))) {
        const std::size_t at = name.find(" @");
        const std::string object = name.substr(0, at);
        const std::string attribute = at == std::string::npos ? "" : name.substr(at + 2);
        const std::set<std::string> of_the_arm{"ideal", "noise_injected", "compensator"};
        if (object.starts_with("/arms/") && std::count(object.begin(), object.end(), '/') == 2 && !attribute.empty() &&
            !of_the_arm.contains(attribute)) {
            const std::string unit = entry.type == "string" ? "" : unit_of_name(attribute);
            out[object + "/points/" + attribute] = {entry.type, "points", unit};
            out[object + "/points @"] = {};
        } else {
            out[name] = entry;
        }
    }
    says(
        "`/arms/ARM/points/NAME`, P: without a design these are the attributes of `/arms/ARM` from "
        "`arw_deg_rt_h_median` on");

    out["/design @"] = {};
    says("`/design/KEY`, f64, P: ");
    for (const auto& [key, unit] : keys) out["/design/" + key] = {"f64", "points", unit};
    const auto totals = told(section.substr(section.find("`/design/turns`")), "/design/");
    EXPECT_EQ(totals.size(), 7U);
    const std::set<std::string> kept{"turns", "tables_remade", "contradictory_readings"};
    says("`/` keeps the sums `turns`, `tables_remade` and\n  `contradictory_readings`");
    for (const auto& [path, type] : totals) {
        const std::string name = path.substr(std::string_view("/design/").size());
        out[path] = {type, "points", unit_of_name(name)};
        EXPECT_TRUE(out.contains("/ @" + name)) << name;
        if (!kept.contains(name)) out.erase("/ @" + name);
    }

    says("`tau_s`, `averaging_factor`, `terms` and the four `ensemble_` datasets in `/arms/ARM/allan` are P x taus");
    says("`angle_error_after_s` is P x times");
    says("`/pairs/arw_ratio` and the others there have the rows of all points below each other: P arms x arms");
    for (auto& [name, entry] : out) {
        if (entry.shape == "taus" || entry.shape == "times") entry.shape = "points x " + entry.shape;
        if (name.starts_with("/pairs/")) entry.shape = "points arms x arms";
    }
    return out;
}

std::map<hsize_t, std::string> extents(const Experiment& plan) {
    const Study& first = plan.points.front();
    std::size_t taus = 0;
    for (const Study& point : plan.points) taus = std::max(taus, point.factors.size());
    const std::map<hsize_t, std::string> names = {{static_cast<hsize_t>(plan.gyros()), "gyros"},
                                                  {static_cast<hsize_t>(first.schedule.samples), "samples"},
                                                  {first.angle_times_s.size(), "times"},
                                                  {first.arms.size(), "arms"},
                                                  {taus, "taus"},
                                                  {plan.points.size(), "points"},
                                                  {plan.points.size() * first.arms.size(), "points arms"}};
    EXPECT_EQ(names.size(), 7U) << "extents must differ to be told apart";
    return names;
}

TEST_F(ResultFile, OfADesignHoldsWhatThePageSays) {
    scenario::Scenario scenario = small_design(true);
    scenario.effects["quantum_noise"]["deg_rt_h"] = 0.0;  // the drive repeats itself: closed forms, too
    scenario.arms = scenario::parse_arms({"ideal", "uncompensated", "noise_injected", "noise_injected+compensated"});
    scenario.ensemble.gyros = 5;  // no number that stands for anything else
    scenario.design.vary.push_back({.key = "ensemble.lockin_threshold_sd_relative", .values = {0.0, 1e-4}});
    write(path_, scenario);
    const Entries file = walk(path_, extents(Experiment(scenario)));
    compare(page_of_design(scenario,
                           {{"gyro.lockin_threshold_deg_h", "deg/h"}, {"ensemble.lockin_threshold_sd_relative", "1"}}),
            file);
    EXPECT_EQ(left(), std::set<std::string>{"out.h5"});
}

TEST_F(ResultFile, OfADesignEndsWithNothingWhereAPointHasFewerAveragingTimes) {
    scenario::Scenario scenario = small_design(false);
    scenario.design.vary = {{.key = "dither.frequency_hz", .values = {120.0, 250.0}}};
    write(path_, scenario);
    const Experiment plan(scenario);
    const std::size_t taus = plan.points[1].factors.size();
    const std::size_t fewer = plan.points[0].factors.size();
    ASSERT_LT(fewer, taus);
    const store::File file = test::open_file(path_);
    const store::Group allan = file.group("arms").group("uncompensated").group("allan");
    for (const char* name : {"tau_s", "ensemble_deviation_deg_h", "ensemble_edf"}) {
        const store::Dataset dataset = allan.dataset(name);
        ASSERT_EQ(dataset.shape(), (store::Shape{2, taus})) << name;
        const auto values = dataset.read<double>();
        for (std::size_t t = 0; t < 2 * taus; ++t) {
            EXPECT_EQ(std::isnan(values[t]), t >= fewer && t < taus) << name << " " << t;
        }
    }
    for (const char* name : {"averaging_factor", "terms"}) {
        const auto values = allan.dataset(name).read<std::int64_t>();
        ASSERT_EQ(values.size(), 2 * taus) << name;
        for (std::size_t t = 0; t < 2 * taus; ++t)
            EXPECT_EQ(values[t] == 0, t >= fewer && t < taus) << name << " " << t;
    }
    // Three gyros a point.
    const auto deviations = allan.dataset("deviation_deg_h").read<double>();
    ASSERT_EQ(deviations.size(), 6 * taus);
    for (std::size_t i = 0; i < deviations.size(); ++i) {
        EXPECT_EQ(std::isnan(deviations[i]), i / taus < 3 && i % taus >= fewer) << i;
    }
}

// Replays.

/// Replays a gyro of the result, and writes the file.
void replay(const std::filesystem::path& result, const std::string& arm, const std::filesystem::path& out) {
    const Experiment experiment = read_result(result);
    const auto& arms = experiment.scenario.arms;
    GyroOfResult of{result, experiment};
    of.arm = static_cast<std::size_t>(
        std::find_if(arms.begin(), arms.end(), [&](const auto& a) { return a.name == arm; }) - arms.begin());
    of.gyro = 1;
    StoredGyro stored(of);
    GyroReplay replay(of.study().scenario, arms.at(of.arm), of.gyro);
    const GyroReplay::Range range = replay.turns_between(-0.5, 30.0);
    ReplayWriter writer(out, of, replay, range);
    const ReplayFigures figures =
        replay.run(range, writer, [&](std::int64_t i, double angle) { stored.check_sample(i, angle); }, {});
    writer.finish(figures, stored.has_record(), store::collect_provenance({}, 1, result.string()));
}

TEST_F(ResultFile, AReplayHoldsWhatThePageSays) {
    scenario::Scenario scenario = small(true);
    scenario.ensemble.settle_s = 1.0;
    scenario.readout.model = scenario::ReadoutModel::instrument;
    write(path_, scenario);
    const std::filesystem::path out = directory_ / "replay.h5";
    replay(path_, "noise_injected+compensated", out);
    const Entries expected = page(the_page, {}, of_replays);
    EXPECT_GT(expected.size(), 60U);
    const auto turns = test::open_file(out).dataset("turns/time_s").shape().at(0);
    EXPECT_GT(turns, 7000U);
    compare(expected, walk(out, {{turns, "turns"}, {readout::kept_pulses, "pulses"}}));
    EXPECT_EQ(left(), (std::set<std::string>{"out.h5", "replay.h5"}));
}

TEST_F(ResultFile, AReplayHoldsNoPulsesWhereNoneAreTimed) {
    scenario::Scenario scenario = small(false);
    scenario.readout.model = scenario::ReadoutModel::latched;
    write(path_, scenario);
    const std::filesystem::path out = directory_ / "replay.h5";
    replay(path_, "uncompensated", out);
    Entries expected = page(the_page, {}, of_replays);
    EXPECT_EQ(expected.erase("/readings/pulses_before_s"), 1U);
    EXPECT_EQ(expected.erase("/readings/pulses_after_s"), 1U);
    const auto turns = test::open_file(out).dataset("turns/time_s").shape().at(0);
    compare(expected, walk(out, {{turns, "turns"}}));
}

}  // namespace
}  // namespace result_format_test
}  // namespace ringlock::study
