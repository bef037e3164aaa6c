#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hdf5.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <set>
#include <sstream>

#include "analysis/study/result_file.hpp"
#include "engine/core/error.hpp"
#include "engine/scenario/parse.hpp"

namespace ringlock::study {
namespace {

using testing::AllOf;
using testing::HasSubstr;
namespace fs = std::filesystem;

/// Two arms, few gyros, few seconds; no two of the symbolic extents are alike.
scenario::Scenario small(bool angle_record, std::uint64_t seed = 5) {
    scenario::Scenario scenario;
    scenario.ensemble.gyros = 3;
    scenario.ensemble.duration_s = 45.0;
    scenario.ensemble.seed = seed;
    scenario.ensemble.lockin_threshold_sd_relative = 0.01;
    scenario.output.angle_record = angle_record;
    scenario.arms = {"uncompensated", "noise_injected+compensated"};
    scenario.effects["quantum_noise"]["deg_rt_h"] = 0.001;
    return scenario;
}

void write(const fs::path& path, const scenario::Scenario& scenario) {
    ResultWriter writer(path, Study(scenario));
    const Study study = run(scenario, 2, [&](const SampledAngles& samples) { writer.write_samples(samples); });
    writer.finish(study, summarise(study), store::collect_provenance({}, 2, "small.toml"));
}

std::string bytes(const fs::path& path) {
    std::ifstream in(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
}

class ResultFile : public testing::Test {
   protected:
    void SetUp() override {
        const auto* info = testing::UnitTest::GetInstance()->current_test_info();
        directory_ = fs::temp_directory_path() /
                     ("ringlock-result-" + std::string(info->name()) + "-" + std::to_string(::getpid()));
        fs::create_directories(directory_);
        path_ = directory_ / "out.h5";
    }
    void TearDown() override { fs::remove_all(directory_); }

    /// Names of what the directory holds.
    std::set<std::string> left() const {
        std::set<std::string> names;
        for (const auto& entry : fs::directory_iterator(directory_)) names.insert(entry.path().filename().string());
        return names;
    }
    static std::string complaint_of(const fs::path& path) {
        try {
            (void)summarise(read_result(path));
        } catch (const InputError& error) {
            return error.what();
        }
        return "(accepted)";
    }

    fs::path directory_;
    fs::path path_;
};

// The page and the file.

/// What the page says, or the file shows, of one dataset or attribute.
struct Entry {
    std::string type;
    std::string shape;
    std::string unit;
    bool operator==(const Entry&) const = default;
    friend std::ostream& operator<<(std::ostream& out, const Entry& e) {
        return out << e.type << " [" << e.shape << "] '" << e.unit << "'";
    }
};
/// Datasets by their path; attributes as "OBJECT @NAME"; groups as "OBJECT @".
using Entries = std::map<std::string, Entry>;

std::vector<std::string> cells(const std::string& line) {
    std::vector<std::string> out;
    std::istringstream in(line.substr(1));
    for (std::string cell; std::getline(in, cell, '|');) {
        cell.erase(std::remove(cell.begin(), cell.end(), '`'), cell.end());
        cell.erase(0, cell.find_first_not_of(' '));
        cell.erase(cell.find_last_not_of(' ') + 1);
        out.push_back(cell);
    }
    return out;
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
    if (const auto at = text.find(from); at != std::string::npos) text.replace(at, from.size(), to);
    return text;
}

/// Unit that a name ends in.
std::string unit_of_name(const std::string& name) {
    static const std::vector<std::pair<std::string, std::string>> units = {{"_per_s", "1/s"},
                                                                           {"deg_h_rt_h", "deg/h/sqrt(h)"},
                                                                           {"deg_rt_h", "deg/sqrt(h)"},
                                                                           {"deg_h", "deg/h"},
                                                                           {"_rad", "rad"},
                                                                           {"_s", "s"}};
    for (const auto& [part, unit] : units) {
        if (name.find(part + "_") != std::string::npos || name.ends_with(part)) return unit;
    }
    return "1";
}

Entries page(const std::vector<std::string>& arms) {
    std::ifstream in(RINGLOCK_SOURCE_DIR "/results/FORMAT.md");
    Entries out;
    std::string header;
    const auto add = [&](const std::string& name, const Entry& entry) {
        EXPECT_TRUE(out.emplace(name, entry).second) << "stands twice: " << name;
    };
    for (std::string line; std::getline(in, line);) {
        if (!line.starts_with('|')) {
            header.clear();
            continue;
        }
        const auto row = cells(line);
        if (header.empty()) {
            header = row[0];
            continue;
        }
        if (row[0].starts_with("---") || !row[0].starts_with('/')) continue;
        EXPECT_EQ(row.size(), 5U) << line;
        EXPECT_FALSE(row.back().empty()) << "no meaning: " << line;
        for (const std::string& arm : row[0].find("/ARM") == std::string::npos ? std::vector<std::string>{""} : arms) {
            const std::string object = replaced(row[0], "ARM", arm);
            if (header == "dataset") {
                add(object, {row[1], row[2], row[3]});
            } else if (row[1].empty()) {
                add(object + " @", {});
            } else {
                EXPECT_EQ(row[3], row[2] == "string" ? "-" : unit_of_name(row[1])) << line;
                add(object + " @" + row[1], {row[2], "", ""});
            }
        }
    }
    return out;
}

std::string type_name(hid_t type) {
    const std::size_t size = H5Tget_size(type);
    switch (H5Tget_class(type)) {
        case H5T_STRING:
            return H5Tis_variable_str(type) > 0 && H5Tget_cset(type) == H5T_CSET_UTF8 ? "string" : "other string";
        case H5T_FLOAT:
            return H5Tequal(type, H5T_IEEE_F64LE) > 0 ? "f64" : "other float";
        case H5T_INTEGER:
            if (H5Tget_order(type) == H5T_ORDER_BE) return "big-endian";
            return (H5Tget_sign(type) == H5T_SGN_NONE ? "u" : "i") + std::to_string(8 * size);
        default:
            return "other";
    }
}

struct Walk {
    hid_t file;
    std::map<hsize_t, std::string> extents;
    Entries found;
};

std::string text_attribute(hid_t object, const char* name) {
    if (H5Aexists(object, name) <= 0) return "(none)";
    const hid_t attribute = H5Aopen(object, name, H5P_DEFAULT);
    const hid_t type = H5Aget_type(attribute);
    char* value = nullptr;
    H5Aread(attribute, type, &value);
    std::string text = value;
    H5free_memory(value);
    H5Tclose(type);
    H5Aclose(attribute);
    return text;
}

std::vector<std::string> attribute_names(hid_t object) {
    std::vector<std::string> names;
    H5Aiterate2(
        object, H5_INDEX_NAME, H5_ITER_INC, nullptr,
        [](hid_t, const char* name, const H5A_info_t*, void* out) -> herr_t {
            static_cast<std::vector<std::string>*>(out)->emplace_back(name);
            return 0;
        },
        &names);
    return names;
}

void note_dataset(Walk& walk, const std::string& path, hid_t dataset) {
    const hid_t type = H5Dget_type(dataset);
    const hid_t space = H5Dget_space(dataset);
    std::vector<hsize_t> extent(static_cast<std::size_t>(H5Sget_simple_extent_ndims(space)));
    H5Sget_simple_extent_dims(space, extent.data(), nullptr);
    std::string shape;
    for (const hsize_t n : extent) {
        const auto name = walk.extents.find(n);
        shape += (shape.empty() ? "" : " x ") + (name == walk.extents.end() ? std::to_string(n) : name->second);
    }
    walk.found[path] = {type_name(type), shape, text_attribute(dataset, "unit")};
    EXPECT_THAT(attribute_names(dataset), testing::ElementsAre("description", "unit")) << path;
    EXPECT_NE(text_attribute(dataset, "description"), "") << path;
    H5Sclose(space);
    H5Tclose(type);
}

void note_group(Walk& walk, const std::string& path, hid_t group) {
    const auto names = attribute_names(group);
    if (names.empty()) walk.found[path + " @"] = {};
    for (const std::string& name : names) {
        const hid_t attribute = H5Aopen(group, name.c_str(), H5P_DEFAULT);
        const hid_t type = H5Aget_type(attribute);
        const hid_t space = H5Aget_space(attribute);
        EXPECT_EQ(H5Sget_simple_extent_type(space), H5S_SCALAR) << path << " " << name;
        walk.found[path + " @" + name] = {type_name(type), "", ""};
        H5Sclose(space);
        H5Tclose(type);
        H5Aclose(attribute);
    }
}

void note(Walk& walk, const std::string& path) {
    const hid_t object = H5Oopen(walk.file, path.c_str(), H5P_DEFAULT);
    ASSERT_GE(object, 0) << path;
    if (H5Iget_type(object) == H5I_DATASET) {
        note_dataset(walk, path, object);
    } else {
        EXPECT_EQ(H5Iget_type(object), H5I_GROUP) << path;
        note_group(walk, path, object);
    }
    H5Oclose(object);
}

Entries walk(const fs::path& path, const Study& study) {
    Walk state{H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), {}, {}};
    EXPECT_GE(state.file, 0);
    state.extents = {{study.gyros.size(), "gyros"},
                     {static_cast<hsize_t>(study.schedule.samples), "samples"},
                     {study.factors.size(), "taus"}};
    EXPECT_EQ(state.extents.size(), 3U) << "extents must differ to be told apart";
    note(state, "/");
    H5Lvisit(
        state.file, H5_INDEX_NAME, H5_ITER_INC,
        [](hid_t, const char* name, const H5L_info_t* info, void* out) -> herr_t {
            EXPECT_EQ(info->type, H5L_TYPE_HARD) << name;
            note(*static_cast<Walk*>(out), std::string("/") + name);
            return 0;
        },
        &state);
    H5Fclose(state.file);
    return state.found;
}

void compare(const Entries& page, const Entries& file) {
    for (const auto& [name, entry] : page) {
        const auto found = file.find(name);
        if (found == file.end()) {
            ADD_FAILURE() << "in results/FORMAT.md, not in the file: " << name;
        } else {
            EXPECT_EQ(entry, found->second) << name << ": page against file";
        }
    }
    for (const auto& [name, entry] : file) {
        EXPECT_TRUE(page.contains(name)) << "in the file, not in results/FORMAT.md: " << name << " " << entry;
    }
}

TEST_F(ResultFile, HoldsWhatThePageSays) {
    scenario::Scenario scenario = small(true);
    scenario.effects["quantum_noise"]["deg_rt_h"] = 0.0;  // the drive repeats itself: closed forms, too
    write(path_, scenario);
    const Entries file = walk(path_, Study(scenario));
    EXPECT_GT(file.size(), 80U);
    compare(page(scenario.arms), file);
    EXPECT_EQ(left(), std::set<std::string>{"out.h5"});
}

TEST_F(ResultFile, HoldsNoAngleRecordWhereNoneIsWanted) {
    const scenario::Scenario scenario = small(false);
    write(path_, scenario);
    Entries expected = page(scenario.arms);
    EXPECT_EQ(expected.erase("/arms/uncompensated/rate_error_closed_form_deg_h"), 1U) << "there is quantum noise";
    for (const std::string& arm : scenario.arms) EXPECT_EQ(expected.erase("/arms/" + arm + "/angle_arcsec"), 1U);
    compare(expected, walk(path_, Study(scenario)));
}

// Round trip.

bool same(double a, double b) { return a == b || (std::isnan(a) && std::isnan(b)); }
bool same(const std::optional<double>& a, const std::optional<double>& b) {
    return a.has_value() == b.has_value() && (!a || same(*a, *b));
}
bool same(const noise::Coefficient& a, const noise::Coefficient& b) {
    return a.resolved == b.resolved && same(a.value, b.value) && same(a.lo, b.lo) && same(a.hi, b.hi);
}
bool same(const noise::NoiseFit& a, const noise::NoiseFit& b) {
    return same(a.quantization_arcsec, b.quantization_arcsec) && same(a.arw_deg_rt_h, b.arw_deg_rt_h) &&
           same(a.bias_instability_deg_h, b.bias_instability_deg_h) && same(a.rrw_deg_h_rt_h, b.rrw_deg_h_rt_h) &&
           same(a.rate_ramp_deg_h_h, b.rate_ramp_deg_h_h) && a.described == b.described;
}
bool same(const allan::Point& a, const allan::Point& b) {
    return a.m == b.m && same(a.tau_s, b.tau_s) && same(a.dev, b.dev) && a.terms == b.terms && a.alpha == b.alpha &&
           same(a.edf, b.edf) && same(a.lo, b.lo) && same(a.hi, b.hi);
}
bool same(const Figure& a, const Figure& b) {
    return same(a.median, b.median) && same(a.lo, b.lo) && same(a.hi, b.hi) && same(a.median_lo, b.median_lo) &&
           same(a.median_hi, b.median_hi) && a.resolved == b.resolved;
}
bool same(const MeanFigure& a, const MeanFigure& b) {
    return same(a.mean, b.mean) && same(a.lo, b.lo) && same(a.hi, b.hi);
}
bool same(const gyro::Setup& a, const gyro::Setup& b) {
    return a.scale_factor_arcsec == b.scale_factor_arcsec && a.lockin_threshold_deg_h == b.lockin_threshold_deg_h &&
           a.coupling_phase_rad == b.coupling_phase_rad && a.dither_frequency_hz == b.dither_frequency_hz &&
           a.dither_peak_rate_deg_s == b.dither_peak_rate_deg_s &&
           a.dither_asymmetry_ratio == b.dither_asymmetry_ratio && a.input_rate_deg_h == b.input_rate_deg_h &&
           a.initial_phase_rad == b.initial_phase_rad;
}

TEST_F(ResultFile, GivesTheStudyBack) {
    scenario::Scenario scenario = small(true);
    scenario.arms = {"ideal", "noise_injected", "noise_injected+compensated"};
    scenario.input = {.rate_deg_h = 1.0, .sweep_stop_deg_h = 2.0, .sweep_points = 2};
    ResultWriter writer(path_, Study(scenario));
    std::vector<double> record;                                       // of gyro 4 in the first arm
    const OnSamples on_samples = [&](const SampledAngles& samples) {  // one thread
        writer.write_samples(samples);
        const std::int64_t row = 4 - samples.first_gyro;
        if (samples.arm != 0 || row < 0 || row >= static_cast<std::int64_t>(samples.gyros)) return;
        const auto count = static_cast<std::ptrdiff_t>(samples.angle_arcsec.size() / samples.gyros);
        record.insert(record.end(), samples.angle_arcsec.begin() + row * count,
                      samples.angle_arcsec.begin() + (row + 1) * count);
    };
    const Study study = run(scenario, 1, on_samples);
    store::Provenance provenance = store::collect_provenance({}, 1, "small.toml");
    provenance.wall_s = 1.5;
    writer.finish(study, summarise(study), provenance);

    const Study read = read_result(path_);
    EXPECT_EQ(read.scenario, study.scenario);
    EXPECT_EQ(read.factors, study.factors);
    EXPECT_EQ(read.turns, study.turns);
    EXPECT_EQ(read.tables_remade, study.tables_remade);
    EXPECT_EQ(read.turn_map_error_rad, study.turn_map_error_rad);
    ASSERT_EQ(read.gyros.size(), 6U);
    for (std::size_t g = 0; g < read.gyros.size(); ++g) EXPECT_TRUE(same(read.gyros[g], study.gyros[g])) << g;
    ASSERT_EQ(read.arms.size(), study.arms.size());
    for (std::size_t a = 0; a < read.arms.size(); ++a) {
        EXPECT_EQ(read.arms[a].arm, study.arms[a].arm);
        for (std::size_t g = 0; g < read.gyros.size(); ++g) {
            const GyroStatistics& x = read.arms[a].gyros[g];
            const GyroStatistics& y = study.arms[a].gyros[g];
            EXPECT_EQ(x.rate_error_deg_h, y.rate_error_deg_h);
            EXPECT_TRUE(same(x.noise, y.noise)) << read.arms[a].arm.name << " " << g;
            ASSERT_EQ(x.allan.size(), y.allan.size());
            for (std::size_t t = 0; t < x.allan.size(); ++t) EXPECT_TRUE(same(x.allan[t], y.allan[t])) << t;
        }
    }

    const Summary one = summarise(study);
    const Summary other = summarise(read);
    EXPECT_EQ(other.seed, one.seed);
    EXPECT_EQ(other.turns, one.turns);
    EXPECT_EQ(other.theory.arw_deg_rt_h, one.theory.arw_deg_rt_h);
    EXPECT_EQ(other.theory.dead_band_deg_h, one.theory.dead_band_deg_h);
    for (std::size_t a = 0; a < one.arms.size(); ++a) {
        EXPECT_TRUE(same(other.arms[a].arw_deg_rt_h, one.arms[a].arw_deg_rt_h));
        EXPECT_EQ(other.arms[a].bias_instability_deg_h.has_value(), one.arms[a].bias_instability_deg_h.has_value());
        EXPECT_TRUE(same(other.arms[a].rate_error_deg_h, one.arms[a].rate_error_deg_h));
        ASSERT_EQ(other.arms[a].sweep.size(), 2U);
        EXPECT_TRUE(same(other.arms[a].sweep[1].output_rate_deg_h, one.arms[a].sweep[1].output_rate_deg_h));
    }

    const store::File file = store::File::open(path_);
    const auto angle = file.dataset("arms/ideal/angle_arcsec").read_rows<double>(4, 1);
    EXPECT_EQ(angle, record);
    EXPECT_EQ(read_provenance(path_).wall_s, 1.5);
    EXPECT_EQ(read_provenance(path_).scenario_file, "small.toml");
    // The scenario in the file is a scenario.
    EXPECT_EQ(scenario::parse_string(file.dataset("scenario").read<std::string>().at(0), "resolved"), scenario);
}

TEST_F(ResultFile, GivesClosedFormsBackWhereTheDriveRepeatsItself) {
    scenario::Scenario scenario = small(false);
    scenario.arms = {"ideal", "uncompensated", "compensated", "noise_injected"};
    scenario.input = {.rate_deg_h = 1.0, .sweep_stop_deg_h = 15.0, .sweep_points = 2};
    const auto read = [&] {
        fs::remove(path_);
        write(path_, scenario);
        return read_result(path_);
    };
    for (const ArmStatistics& arm : read().arms) {
        for (const GyroStatistics& gyro : arm.gyros) EXPECT_FALSE(gyro.rate_error_closed_form_deg_h) << arm.arm.name;
    }
    EXPECT_FALSE(store::File::open(path_).has_dataset("arms/uncompensated/rate_error_closed_form_deg_h"));

    scenario.effects["quantum_noise"]["deg_rt_h"] = 0.0;
    const Study study = read();
    const double fringe_deg_h = scenario.gyro.scale_factor_arcsec /
                                (study.schedule.sample_interval_s * static_cast<double>(study.schedule.samples - 1));
    for (const ArmStatistics& arm : study.arms) {
        for (const GyroStatistics& gyro : arm.gyros) {
            const auto& closed_form = gyro.rate_error_closed_form_deg_h;
            ASSERT_EQ(closed_form.has_value(), arm.arm.name == "uncompensated") << arm.arm.name;
            if (!closed_form) continue;
            // The instrument's reading noise, 0.005 rad, is small against a fringe.
            EXPECT_NEAR(*closed_form, gyro.rate_error_deg_h, 1.01 * fringe_deg_h);
        }
    }
    const ArmSummary summary = summarise(study).arms.at(1);
    ASSERT_EQ(summary.sweep.size(), 2U);
    EXPECT_NEAR(summary.sweep[0].closed_form_rate_deg_h.value(), 0.0, 1e-9) << "locked";
    EXPECT_NEAR(summary.sweep[1].closed_form_rate_deg_h.value(), 14.8, 0.2);
    ASSERT_EQ(summary.steps.size(), 1U);
    EXPECT_EQ(summary.steps[0].order, 0);
    EXPECT_EQ(summary.steps[0].first_deg_h, 1.0);
    EXPECT_EQ(summary.steps[0].last_deg_h, 1.0);

    // Results of programs that knew no closed form are read as they are.
    const hid_t file = H5Fopen(path_.c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
    ASSERT_GE(H5Ldelete(file, "arms/uncompensated/rate_error_closed_form_deg_h", H5P_DEFAULT), 0);
    H5Fclose(file);
    const ArmSummary older = summarise(read_result(path_)).arms.at(1);
    EXPECT_FALSE(older.sweep.at(0).closed_form_rate_deg_h);
    EXPECT_TRUE(older.steps.empty());
}

TEST(ClosedForm, IsThereWhereNoEffectAddsARateThatVaries) {
    const auto repeats = [](const std::string& effect, const std::string& parameter, double value) {
        scenario::Scenario scenario;
        scenario.effects["quantum_noise"]["deg_rt_h"] = 0.0;
        if (!effect.empty()) scenario.effects.at(effect).at(parameter) = value;
        EXPECT_FALSE(has_closed_form(scenario, scenario::parse_arm("ideal")));
        EXPECT_FALSE(has_closed_form(scenario, scenario::parse_arm("compensated")));
        EXPECT_FALSE(has_closed_form(scenario, scenario::parse_arm("noise_injected")));
        return has_closed_form(scenario, scenario::parse_arm("uncompensated"));
    };
    EXPECT_FALSE(has_closed_form(scenario::Scenario(), scenario::parse_arm("uncompensated"))) << "quantum noise";
    EXPECT_TRUE(repeats("", "", 0.0));
    EXPECT_TRUE(repeats("dither_asymmetry", "ratio", 0.01));
    EXPECT_TRUE(repeats("detector_phase_offset", "phase_rad", 0.3));
    EXPECT_TRUE(repeats("readout_ellipse", "gain", 0.03));
    EXPECT_FALSE(repeats("quantum_noise", "deg_rt_h", 1e-6));
    EXPECT_FALSE(repeats("bias_instability", "deg_h", 0.01));
    EXPECT_FALSE(repeats("bias_ramp", "deg_h_per_h", 1.0));
    EXPECT_FALSE(repeats("bias_step", "step_deg_h", 1.0));
    EXPECT_FALSE(repeats("base_vibration", "rate_deg_h", 1.0));
    EXPECT_FALSE(repeats("rate_random_walk", "deg_h_rt_h", 1.0));
}

// What is there already.

TEST_F(ResultFile, ReplacesAResultOfTheSameScenarioOnly) {
    write(path_, small(false));
    EXPECT_NO_THROW(write(path_, small(false)));
    const std::string before = bytes(path_);
    EXPECT_THROW(ResultWriter(path_, Study(small(false, 6))), InputError) << "another seed";
    EXPECT_THROW(ResultWriter(path_, Study(small(true))), InputError) << "another scenario";
    EXPECT_EQ(bytes(path_), before);
    EXPECT_EQ(left(), std::set<std::string>{"out.h5"});
}

TEST_F(ResultFile, KeepsFilesThatAreNoResult) {
    for (const std::string& content : {std::string("not HDF5\n"), std::string()}) {
        std::ofstream(path_, std::ios::binary) << content;
        EXPECT_THROW(ResultWriter(path_, Study(small(false))), InputError);
        EXPECT_EQ(bytes(path_), content);
    }
    store::File::create(path_).set_attribute("format", "rlg-record");
    const std::string before = bytes(path_);
    EXPECT_THROW(ResultWriter(path_, Study(small(false))), InputError);
    EXPECT_EQ(bytes(path_), before);
    EXPECT_EQ(left(), std::set<std::string>{"out.h5"});
}

TEST_F(ResultFile, LeavesNothingWithoutFinish) {
    { ResultWriter writer(path_, Study(small(true))); }
    EXPECT_EQ(left(), std::set<std::string>{});
    EXPECT_THROW(ResultWriter(directory_ / "missing" / "out.h5", Study(small(true))), InputError);
    EXPECT_THROW(ResultWriter(directory_ / std::string(300, 'x'), Study(small(true))), InputError);
    EXPECT_EQ(left(), std::set<std::string>{});
}

// Damage.

class DamagedResult : public ResultFile {
   protected:
    void SetUp() override {
        ResultFile::SetUp();
        write(path_, small(true));
    }
    /// Opens the file for a change by hand.
    template <class Change>
    void change(Change how) {
        const hid_t file = H5Fopen(path_.c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
        ASSERT_GE(file, 0);
        how(file);
        ASSERT_GE(H5Fclose(file), 0);
    }
    void remove(const char* name) {
        change([&](hid_t file) { ASSERT_GE(H5Ldelete(file, name, H5P_DEFAULT), 0) << name; });
    }
    void reshape(const char* name, const std::vector<hsize_t>& extent) {
        remove(name);
        change([&](hid_t file) {
            const hid_t space = H5Screate_simple(static_cast<int>(extent.size()), extent.data(), nullptr);
            H5Dclose(H5Dcreate2(file, name, H5T_IEEE_F64LE, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT));
            H5Sclose(space);
        });
    }
    void set_version(std::int64_t version) {
        change([&](hid_t file) {
            const hid_t attribute = H5Aopen(file, "format_version", H5P_DEFAULT);
            H5Awrite(attribute, H5T_NATIVE_INT64, &version);
            H5Aclose(attribute);
        });
    }
};

TEST_F(DamagedResult, MissingObjectsAreNamed) {
    ASSERT_EQ(complaint_of(path_), "(accepted)");
    for (const char* name : {"arms/uncompensated/allan/edf", "arms/uncompensated/noise/arw_deg_rt_h_lo",
                             "arms/noise_injected+compensated/rate_error_deg_h", "arms/uncompensated/noise",
                             "gyros/initial_phase_rad", "arms", "scenario"}) {
        fs::remove(path_);
        write(path_, small(true));
        remove(name);
        EXPECT_THAT(complaint_of(path_), AllOf(HasSubstr(path_.string()), HasSubstr(name), HasSubstr("missing")));
    }
    // Angle records are not read for the statistics.
    fs::remove(path_);
    write(path_, small(true));
    remove("arms/uncompensated/angle_arcsec");
    EXPECT_EQ(complaint_of(path_), "(accepted)");
}

TEST_F(DamagedResult, WrongShapesAreNamedWithBoth) {
    const std::size_t taus = Study(small(true)).factors.size();
    reshape("arms/uncompensated/rate_error_deg_h", {4});
    EXPECT_THAT(complaint_of(path_), AllOf(HasSubstr(path_.string()), HasSubstr("/arms/uncompensated/rate_error_deg_h"),
                                           HasSubstr("[4]"), HasSubstr("[3]")));
    reshape("arms/uncompensated/rate_error_deg_h", {3});
    ASSERT_EQ(complaint_of(path_), "(accepted)");
    // As many numbers, but the other way round.
    reshape("arms/uncompensated/allan/edf", {taus, 3});
    EXPECT_THAT(complaint_of(path_),
                AllOf(HasSubstr("/arms/uncompensated/allan/edf"), HasSubstr("the result is damaged")));
}

TEST_F(DamagedResult, WrongKindsAreNamed) {
    remove("gyros/initial_phase_rad");
    change([](hid_t file) {
        H5Gclose(H5Gcreate2(file, "gyros/initial_phase_rad", H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT));
    });
    EXPECT_THAT(complaint_of(path_), AllOf(HasSubstr("/gyros/initial_phase_rad"), HasSubstr("must be a dataset")));
    reshape("scenario", {1});
    EXPECT_THAT(complaint_of(path_), AllOf(HasSubstr(path_.string()), HasSubstr("/scenario")));
}

TEST_F(DamagedResult, OtherVersionsAndFormatsAreRefused) {
    set_version(1);
    EXPECT_THAT(complaint_of(path_),
                AllOf(HasSubstr(path_.string()), HasSubstr("format_version is 1"), HasSubstr("reads 2")));
    set_version(2);
    change([](hid_t file) { H5Adelete(file, "turns"); });
    EXPECT_THAT(complaint_of(path_), AllOf(HasSubstr(path_.string()), HasSubstr("turns"), HasSubstr("missing")));
    change([](hid_t file) { H5Adelete(file, "format"); });
    EXPECT_THAT(complaint_of(path_), AllOf(HasSubstr(path_.string()), HasSubstr("not a ringlock result")));
}

TEST_F(DamagedResult, TruncatedFilesAreRefusedAtAnyLength) {
    const std::string whole = bytes(path_);
    for (const double part : {0.0, 0.0001, 0.01, 0.1, 0.3, 0.5, 0.7, 0.9, 0.99, 0.9999}) {
        const auto length = static_cast<std::size_t>(part * static_cast<double>(whole.size()));
        std::ofstream(path_, std::ios::binary) << whole.substr(0, length);
        EXPECT_THAT(complaint_of(path_), HasSubstr(path_.string())) << length << " of " << whole.size() << " bytes";
    }
}

// Bytes that went bad: either the damage is noticed, or it hit a number; never anything but InputError.
TEST_F(DamagedResult, OverwrittenBytesNeverCrash) {
    const std::string whole = bytes(path_);
    for (std::size_t i = 0; i < 60; ++i) {
        std::string bad = whole;
        const std::size_t at = i * (whole.size() / 60);
        for (std::size_t k = at; k < std::min(at + 64, bad.size()); ++k) bad[k] = static_cast<char>(0xA5 ^ bad[k]);
        std::ofstream(path_, std::ios::binary) << bad;
        try {
            (void)read_result(path_);
        } catch (const InputError& error) {
            EXPECT_THAT(error.what(), HasSubstr(path_.string()));
        }
    }
}

}  // namespace
}  // namespace ringlock::study
