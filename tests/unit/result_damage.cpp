// Files that are no result, another one or a damaged one: in the way of a result, and given to be read.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hdf5.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <limits>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "analysis/study/family.hpp"
#include "analysis/study/result/result_file.hpp"
#include "engine/core/error.hpp"
#include "tests/unit/result_support.hpp"

namespace ringlock::study {
namespace result_damage_test {
namespace {

using test::bytes;
using test::ResultFile;
using test::small;
using test::small_design;
using test::write;
using testing::AllOf;
using testing::HasSubstr;
namespace fs = std::filesystem;

// What is there already.

TEST_F(ResultFile, ReplacesAResultOfTheSameScenarioOnly) {
    write(path_, small(false));
    EXPECT_NO_THROW(write(path_, small(false)));
    const std::string before = bytes(path_);
    EXPECT_THROW(ResultWriter(path_, Experiment(small(false, 6))), InputError) << "another seed";
    EXPECT_THROW(ResultWriter(path_, Experiment(small(true))), InputError) << "another scenario";
    EXPECT_EQ(bytes(path_), before);
    EXPECT_EQ(left(), std::set<std::string>{"out.h5"});
}

TEST_F(ResultFile, KeepsFilesThatAreNoResult) {
    for (const std::string& content : {std::string("not HDF5\n"), std::string()}) {
        std::ofstream(path_, std::ios::binary) << content;
        EXPECT_THROW(ResultWriter(path_, Experiment(small(false))), InputError);
        EXPECT_EQ(bytes(path_), content);
    }
    store::File::create(path_).set_attribute("format", "rlg-record");
    const std::string before = bytes(path_);
    EXPECT_THROW(ResultWriter(path_, Experiment(small(false))), InputError);
    EXPECT_EQ(bytes(path_), before);
    EXPECT_EQ(left(), std::set<std::string>{"out.h5"});
}

TEST_F(ResultFile, LeavesNothingWithoutFinish) {
    { ResultWriter writer(path_, Experiment(small(true))); }
    EXPECT_EQ(left(), std::set<std::string>{});
    EXPECT_THROW(ResultWriter(directory_ / "missing" / "out.h5", Experiment(small(true))), InputError);
    EXPECT_THROW(ResultWriter(directory_ / std::string(300, 'x'), Experiment(small(true))), InputError);
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

TEST_F(DamagedResult, AngleRecordsThatAreNotWholeAreNamed) {
    const auto complaint = [&]() -> std::string {
        try {
            (void)family_deviations(path_, read_result(path_), 0, std::array{allan::Estimator::oadev},
                                    std::array<std::int64_t, 1>{20});
        } catch (const InputError& error) {
            return error.what();
        }
        return "(accepted)";
    };
    ASSERT_EQ(complaint(), "(accepted)");
    const std::string name = "/arms/uncompensated/angle_arcsec";
    // A gyro is missing, a sample is missing, rows are columns.
    for (const std::vector<hsize_t>& extent : std::vector<std::vector<hsize_t>>{{2, 45}, {3, 44}, {45, 3}, {135}}) {
        reshape(name.c_str(), extent);
        EXPECT_THAT(complaint(), AllOf(HasSubstr(path_.string()), HasSubstr(name), HasSubstr("the result is damaged")));
    }
    // A value that is none, within a record and at its end: neither is a gap to be bridged.
    constexpr double nan = std::numeric_limits<double>::quiet_NaN();
    constexpr double infinite = std::numeric_limits<double>::infinity();
    for (const auto& [place, value] : {std::pair{45 + 20, nan}, {2 * 45 - 1, nan}, {45 + 20, infinite}}) {
        reshape(name.c_str(), {3, 45});
        change([&](hid_t file) {
            std::vector<double> angles(3 * 45);
            for (std::size_t i = 0; i < angles.size(); ++i) angles[i] = std::sin(static_cast<double>(i));
            angles[static_cast<std::size_t>(place)] = value;
            const hid_t dataset = H5Dopen2(file, name.c_str(), H5P_DEFAULT);
            ASSERT_GE(H5Dwrite(dataset, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, angles.data()), 0);
            H5Dclose(dataset);
        });
        EXPECT_THAT(complaint(), AllOf(HasSubstr(name), HasSubstr("row 1"), HasSubstr("not finite")));
    }
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
    for (std::size_t i = 0; i < 20; ++i) {
        std::string bad = whole;
        const std::size_t at = i * (whole.size() / 20);
        for (std::size_t k = at; k < std::min(at + 64, bad.size()); ++k) bad[k] = static_cast<char>(0xA5 ^ bad[k]);
        std::ofstream(path_, std::ios::binary) << bad;
        try {
            (void)read_result(path_);
        } catch (const InputError& error) {
            EXPECT_THAT(error.what(), HasSubstr(path_.string()));
        }
    }
}

class DamagedDesign : public DamagedResult {
   protected:
    void SetUp() override {
        ResultFile::SetUp();
        rewrite();
    }
    void rewrite() {
        fs::remove(path_);
        write(path_, small_design(true));
    }
    void fill(const char* name, const std::vector<double>& values) {
        reshape(name, {values.size()});
        change([&](hid_t file) {
            const hid_t dataset = H5Dopen2(file, name, H5P_DEFAULT);
            ASSERT_GE(H5Dwrite(dataset, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()), 0);
            H5Dclose(dataset);
        });
    }
};

constexpr const char* varied = "/design/gyro.lockin_threshold_deg_h";

TEST_F(DamagedDesign, ValuesOfAKeyThatAreNotThoseOfTheDesignAreNamed) {
    ASSERT_EQ(complaint_of(path_), "(accepted)");
    fill(varied, {200.0, 300.0});
    ASSERT_EQ(complaint_of(path_), "(accepted)");
    for (const std::vector<double>& values : {std::vector{200.0}, std::vector{200.0, 300.0, 400.0}}) {
        fill(varied, values);
        EXPECT_THAT(complaint_of(path_), AllOf(HasSubstr(path_.string()), HasSubstr(varied), HasSubstr("[2]"),
                                               HasSubstr("the result is damaged")));
    }
    // No number, no threshold, and a threshold that is not the scenario's.
    for (const double value :
         {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(), -1.0, 301.0, 300.0001}) {
        fill(varied, {200.0, value});
        EXPECT_THAT(complaint_of(path_),
                    AllOf(HasSubstr(path_.string()), HasSubstr(varied), HasSubstr("the result is damaged")))
            << value;
    }
    // A last digit may be that of another machine.
    fill(varied, {200.0, std::nextafter(300.0, 0.0)});
    EXPECT_EQ(complaint_of(path_), "(accepted)");
}

TEST_F(DamagedDesign, MissingObjectsAreNamed) {
    for (const char* name : {varied, "/design/turns", "/design/turn_map_error_rad", "/design",
                             "/arms/uncompensated/allan/tau_s", "/arms/uncompensated/rate_error_deg_h"}) {
        rewrite();
        remove(name);
        EXPECT_THAT(complaint_of(path_), AllOf(HasSubstr(path_.string()), HasSubstr(name), HasSubstr("missing")));
    }
}

TEST_F(DamagedDesign, WrongShapesAreNamed) {
    const std::size_t taus = Study(small(true)).factors.size();
    const auto refused = [&](const char* name, const std::vector<hsize_t>& extent) {
        rewrite();
        reshape(name, extent);
        EXPECT_THAT(complaint_of(path_),
                    AllOf(HasSubstr(path_.string()), HasSubstr(name), HasSubstr("the result is damaged")));
    };
    refused("/design/turn_map_error_rad", {3});
    refused("/arms/uncompensated/allan/tau_s", {taus});
    refused("/arms/uncompensated/allan/edf", {3, taus});
    refused("/arms/noise_injected+compensated/rate_error_deg_h", {3});
    refused("/gyros/initial_phase_rad", {3});
}

}  // namespace
}  // namespace result_damage_test
}  // namespace ringlock::study
