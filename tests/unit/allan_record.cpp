#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hdf5.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "analysis/record/series.hpp"
#include "engine/core/error.hpp"

namespace {

using namespace ringlock;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;

/// A directory of this test alone, gone afterwards.
class AllanRecord : public testing::Test {
   protected:
    void SetUp() override {
        const auto* info = testing::UnitTest::GetInstance()->current_test_info();
        directory_ = std::filesystem::temp_directory_path() /
                     ("ringlock-allan-record-" + std::string(info->name()) + "-" + std::to_string(::getpid()));
        std::filesystem::create_directories(directory_);
    }
    void TearDown() override { std::filesystem::remove_all(directory_); }

    std::string file(const std::string& text, const std::string& name = "data.txt") {
        const auto path = directory_ / name;
        std::ofstream(path, std::ios::binary) << text;
        return path.string();
    }
    static std::string error_of(const std::string& path, const std::optional<std::string>& column = std::nullopt) {
        try {
            record::read_series(path, column);
        } catch (const InputError& e) {
            return e.what();
        }
        return "no error";
    }

    std::filesystem::path directory_;
};

TEST_F(AllanRecord, ReadsOneColumnWithCommentsAndBlankLines) {
    const auto s = record::read_series(file("# a note\n1\n\n2.5e-3 # why\n  -3\n+4"), std::nullopt);
    EXPECT_THAT(s.values, ElementsAre(1.0, 2.5e-3, -3.0, 4.0));
    EXPECT_FALSE(s.rate_hz.has_value());
}

TEST_F(AllanRecord, ReadsCommasSpacesTabsWindowsLinesAndByteOrderMark) {
    EXPECT_THAT(record::read_series(file("\xEF\xBB\xBF"
                                         "1,10\r\n2,20\r\n"),
                                    "2")
                    .values,
                ElementsAre(10.0, 20.0));
    EXPECT_THAT(record::read_series(file(" 1 \t 10\n2  20 \n"), "1").values, ElementsAre(1.0, 2.0));
    EXPECT_THAT(record::read_series(file("1 , 10\n2,20"), "2").values, ElementsAre(10.0, 20.0));
}

TEST_F(AllanRecord, HeaderNamesColumnsAndOtherColumnsMayHoldText) {
    const auto path = file("time,rate,note\n2026-01-01,1.5,warm\n2026-01-02,2.5,cold\n");
    EXPECT_THAT(record::read_series(path, "rate").values, ElementsAre(1.5, 2.5));
    EXPECT_EQ(record::read_series(path, "2").column, "rate");
    EXPECT_THAT(record::read_series(file("rate_deg_h\n1\n2\n"), std::nullopt).values, ElementsAre(1.0, 2.0));
}

TEST_F(AllanRecord, ReadsTheRateOfAnRlgRecord) {
    const auto s = record::read_series(
        file("# format = rlg-record\n# rate_hz = 100\nangle_increment_arcsec,accel_x\n0.5,1\n-0.5,2\n"),
        "angle_increment_arcsec");
    EXPECT_EQ(s.rate_hz, 100.0);
    EXPECT_THAT(s.values, ElementsAre(0.5, -0.5));
    EXPECT_THAT(error_of(file("# rate_hz = fast\n1\n")),
                AllOf(HasSubstr(":1:"), HasSubstr("'fast'"), HasSubstr("positive")));
}

TEST_F(AllanRecord, ErrorsNameFileLineColumnAndWhatIsAllowed) {
    EXPECT_THAT(error_of(file("1 2\n3 4\n")),
                AllOf(HasSubstr("data.txt:1:"), HasSubstr("2 columns"), HasSubstr("--column")));
    EXPECT_THAT(error_of(file("a b\n3 4\n"), "c"), AllOf(HasSubstr("'c'"), HasSubstr("a, b")));
    EXPECT_THAT(error_of(file("1 2\n3 4\n"), "3"), AllOf(HasSubstr("'3'"), HasSubstr("1 to 2")));
    EXPECT_THAT(error_of(file("1\n2\nx3\n")),
                AllOf(HasSubstr("data.txt:3:"), HasSubstr("'x3'"), HasSubstr("not a number")));
    EXPECT_THAT(error_of(file("1\n2\n1e999\n")), HasSubstr("'1e999'"));
    EXPECT_THAT(error_of(file("1 2\n3\n"), "1"),
                AllOf(HasSubstr("data.txt:2:"), HasSubstr("1 column"), HasSubstr("2")));
    EXPECT_THAT(error_of(file("1\nnan\n")), AllOf(HasSubstr("data.txt:2:"), HasSubstr("'nan'"), HasSubstr("gaps")));
    EXPECT_THAT(error_of(file("1\n-inf\n")), AllOf(HasSubstr("'-inf'"), HasSubstr("finite")));
    EXPECT_THAT(error_of(file("1,2\n3,\n"), "2"), AllOf(HasSubstr(":2:"), HasSubstr("empty")));
    EXPECT_THAT(error_of(file("")), HasSubstr("no data"));
    EXPECT_THAT(error_of(file("# only a comment\nname\n")), HasSubstr("no data"));
    EXPECT_THAT(error_of(directory_.string()), HasSubstr("directory"));
    EXPECT_THAT(error_of((directory_ / "absent").string()), AllOf(HasSubstr("absent"), HasSubstr("cannot be opened")));
}

// Lines that straddle the reader's buffer.
TEST_F(AllanRecord, LongFilesAreReadWhole) {
    std::string text;
    constexpr int rows = 100000;
    for (int i = 0; i < rows; ++i) text += std::to_string(i) + " " + std::to_string(0.5 * i) + "\n";
    const auto s = record::read_series(file(text), "2");
    ASSERT_EQ(s.values.size(), static_cast<std::size_t>(rows));
    for (int i = 0; i < rows; ++i) ASSERT_EQ(s.values[i], 0.5 * i);
    const std::string wide(600000, ' ');
    EXPECT_THAT(record::read_series(file("1\n" + wide + "2\n3\n"), std::nullopt).values, ElementsAre(1.0, 2.0, 3.0));
}

TEST_F(AllanRecord, ReadsHdf5DatasetsByPathOrName) {
    const auto path = (directory_ / "data.h5").string();
    const hid_t h5 = H5Fcreate(path.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
    const hid_t group = H5Gcreate2(h5, "samples", H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
    const hsize_t size = 3;
    const hid_t space = H5Screate_simple(1, &size, nullptr);
    const double angle[] = {0.5, 1.5, -2.0};
    const long long counts[] = {4, 5, 6};
    const hid_t a = H5Dcreate2(group, "angle_arcsec", H5T_IEEE_F64LE, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
    H5Dwrite(a, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, angle);
    const hid_t b = H5Dcreate2(group, "quarter_count", H5T_STD_I64LE, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
    H5Dwrite(b, H5T_NATIVE_LLONG, H5S_ALL, H5S_ALL, H5P_DEFAULT, counts);
    const hid_t scalar = H5Screate(H5S_SCALAR);
    const double rate = 200.0;
    const hid_t attribute = H5Acreate2(group, "rate_hz", H5T_IEEE_F64LE, scalar, H5P_DEFAULT, H5P_DEFAULT);
    H5Awrite(attribute, H5T_NATIVE_DOUBLE, &rate);
    H5Aclose(attribute);
    H5Sclose(scalar);
    H5Dclose(a);
    H5Dclose(b);
    H5Sclose(space);
    H5Gclose(group);
    H5Fclose(h5);

    const auto s = record::read_series(path, "/samples/angle_arcsec");
    EXPECT_THAT(s.values, ElementsAre(0.5, 1.5, -2.0));
    EXPECT_EQ(s.rate_hz, 200.0);
    EXPECT_THAT(record::read_series(path, "quarter_count").values, ElementsAre(4.0, 5.0, 6.0));
    EXPECT_THAT(error_of(path),
                AllOf(HasSubstr("2 datasets"), HasSubstr("/samples/angle_arcsec"), HasSubstr("--column")));
    EXPECT_THAT(error_of(path, "absent"), AllOf(HasSubstr("'absent'"), HasSubstr("/samples/quarter_count")));

    std::filesystem::resize_file(path, 600);
    EXPECT_THAT(error_of(path, "quarter_count"), HasSubstr("HDF5"));
}

// Real data, where it is there: RINGLOCK_TEST_DATA names the folder.
TEST(AllanRecordMeasured, LaserGyroRecordIsReadWhole) {
    const char* folder = std::getenv("RINGLOCK_TEST_DATA");
    const std::filesystem::path path =
        std::filesystem::path(folder != nullptr ? folder : RINGLOCK_SHARED_DATA) / "laser-gyro-triad-x.csv";
    if (!std::filesystem::exists(path)) GTEST_SKIP() << path << " is not there; set RINGLOCK_TEST_DATA to its folder";
    const auto s = record::read_series(path.string(), "angle_increment_arcsec");
    EXPECT_EQ(s.values.size(), 184718u);
    EXPECT_EQ(s.rate_hz, 100.0);
}

}  // namespace
