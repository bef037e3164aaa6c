#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <span>
#include <thread>
#include <vector>

#include "engine/core/error.hpp"
#include "engine/store/hdf5.hpp"
#include "tests/support/expect_throw.hpp"
#include "tests/support/open_file.hpp"
#include "tests/support/temporary_directory.hpp"

namespace ringlock::store {
namespace store_hdf5_test {
namespace {

using test::message_of;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;

class StoreHdf5 : public testing::Test {
   protected:
    test::TemporaryDirectory directory_;
    std::filesystem::path path_ = directory_ / "a.h5";

    /// Writes with `fill`, closes, and opens for reading.
    template <class Fill>
    File round_trip(Fill fill) {
        File file = File::create(path_);
        fill(file);
        file.close();
        return test::open_file(path_);
    }
};

TEST_F(StoreHdf5, AttributesOfEveryTypeComeBack) {
    const File file = round_trip([](File& f) {
        f.set_attribute("text", "Ω_L = 300 °/h");
        f.set_attribute("empty", "");
        f.set_attribute("small", std::numeric_limits<std::int64_t>::min());
        f.set_attribute("large", std::numeric_limits<std::uint64_t>::max());
        f.set_attribute("pi", 3.25);
        f.set_attribute("list", std::vector<double>{1.5, -2.5});
        f.set_attribute("nothing", std::vector<double>{});
    });
    EXPECT_EQ(file.string_attribute("text"), "Ω_L = 300 °/h");
    EXPECT_EQ(file.string_attribute("empty"), "");
    EXPECT_EQ(file.int_attribute("small"), std::numeric_limits<std::int64_t>::min());
    EXPECT_EQ(file.uint_attribute("large"), std::numeric_limits<std::uint64_t>::max());
    EXPECT_EQ(file.double_attribute("pi"), 3.25);
    EXPECT_THAT(file.doubles_attribute("list"), ElementsAre(1.5, -2.5));
    EXPECT_THAT(file.doubles_attribute("nothing"), ElementsAre());
    EXPECT_THAT(file.attribute_names(), ElementsAre("empty", "large", "list", "nothing", "pi", "small", "text"));
}

TEST_F(StoreHdf5, AnAttributeLongerThanAnObjectHeaderComesBack) {
    const std::string scenario(200'000, 'x');
    const File file = round_trip([&](File& f) { f.set_attribute("scenario", scenario); });
    EXPECT_EQ(file.string_attribute("scenario"), scenario);
}

TEST_F(StoreHdf5, AnAttributeSetTwiceHoldsTheSecondValue) {
    const File file = round_trip([](File& f) {
        f.set_attribute("a", 1);
        f.set_attribute("a", "two");
    });
    EXPECT_EQ(file.string_attribute("a"), "two");
}

TEST_F(StoreHdf5, DatasetsOfEveryTypeComeBackWithUnitAndDescription) {
    const File file = round_trip([](File& f) {
        f.write("rate", std::vector{1.5, std::nan(""), -3.0}, {"deg/h", "rate of the case"});
        f.write("count", std::vector<std::int64_t>{-4, 5}, {"1", "quarter fringes"});
        f.write("seed", std::vector<std::uint64_t>{~0ULL}, {"1", "seed"});
        f.write("direction", std::vector<std::int8_t>{1, -1}, {"1", "of the turn"});
        f.write("arm", std::vector<std::string>{"ideal", "", "größer"}, {"", "names"});
    });
    const auto rate = file.dataset("rate").read<double>();
    ASSERT_EQ(rate.size(), 3);
    EXPECT_EQ(rate[0], 1.5);
    EXPECT_TRUE(std::isnan(rate[1]));
    EXPECT_THAT(file.dataset("count").read<std::int64_t>(), ElementsAre(-4, 5));
    EXPECT_THAT(file.dataset("seed").read<std::uint64_t>(), ElementsAre(~0ULL));
    EXPECT_THAT(file.dataset("direction").read<std::int8_t>(), ElementsAre(1, -1));
    EXPECT_THAT(file.dataset("arm").read<std::string>(), ElementsAre("ideal", "", "größer"));
    EXPECT_EQ(file.dataset("rate").unit(), "deg/h");
    EXPECT_EQ(file.dataset("rate").description(), "rate of the case");
    EXPECT_THAT(file.children(), ElementsAre("arm", "count", "direction", "rate", "seed"));
}

TEST_F(StoreHdf5, RowsWrittenInAnyOrderFillAPreallocatedDataset) {
    const File file = round_trip([](File& f) {
        Dataset angle = f.create_dataset<double>("arms/ideal/angle_arcsec", {4, 2}, {"arcsec", "angle"});
        angle.write_rows<double>(3, 1, std::vector{7.0, 8.0});
        angle.write_rows<double>(0, 2, std::vector{1.0, 2.0, 3.0, 4.0});
    });
    const Dataset angle = file.group("arms").group("ideal").dataset("angle_arcsec");
    EXPECT_EQ(angle.path(), "/arms/ideal/angle_arcsec");
    EXPECT_THAT(angle.shape(), ElementsAre(4, 2));
    EXPECT_THAT(angle.read_rows<double>(0, 2), ElementsAre(1.0, 2.0, 3.0, 4.0));
    EXPECT_THAT(angle.read_rows<double>(3, 1), ElementsAre(7.0, 8.0));
    EXPECT_TRUE(std::isnan(angle.read<double>()[4])) << "a row that was never written must not look like data";
}

TEST_F(StoreHdf5, ChunkedDatasetsAreWrittenPieceByPieceAndAreSmall) {
    constexpr std::uint64_t rows = 100'003;
    std::vector<double> all(rows);
    for (std::uint64_t i = 0; i < rows; ++i) all[i] = static_cast<double>(i % 1000);
    const File file = round_trip([&](File& f) {
        Dataset column = f.create_chunked<double>("column", {rows}, 4096, {"s", "times"});
        for (std::uint64_t row = 0; row < rows; row += 4096) {
            const std::uint64_t n = std::min<std::uint64_t>(4096, rows - row);
            column.write_rows<double>(row, n, std::span<const double>(all).subspan(row, n));
        }
        f.create_chunked<std::int64_t>("wide", {3, 2}, 4096, {"1", "fewer rows than a chunk"})
            .write_rows<std::int64_t>(0, 3, std::vector<std::int64_t>{1, 2, 3, 4, 5, 6});
        f.create_chunked<std::int8_t>("none", {0}, 4096, {"1", "no rows"});
        f.create_chunked<double>("unwritten", {5}, 2, {"1", "nothing"});
    });
    EXPECT_EQ(file.dataset("column").read<double>(), all);
    EXPECT_EQ(file.dataset("column").unit(), "s");
    EXPECT_THAT(file.dataset("wide").read<std::int64_t>(), ElementsAre(1, 2, 3, 4, 5, 6));
    EXPECT_THAT(file.dataset("none").read<std::int8_t>(), ElementsAre());
    for (const double value : file.dataset("unwritten").read<double>()) EXPECT_TRUE(std::isnan(value));
    EXPECT_LT(std::filesystem::file_size(path_), rows * sizeof(double) / 4);
}

TEST_F(StoreHdf5, BlocksOfADatasetAreRead) {
    const File file = round_trip([](File& f) {
        f.write("table", std::span<const double>(std::vector{1.0, 2.0, 3.0, 4.0, 5.0, 6.0}), {2, 3}, {"1", "numbers"});
    });
    const Dataset table = file.dataset("table");
    EXPECT_THAT(table.read_block<double>(1, 1, 1, 2), ElementsAre(5.0, 6.0));
    EXPECT_THAT(table.read_block<double>(0, 2, 0, 1), ElementsAre(1.0, 4.0));
    EXPECT_THAT(table.read_block<double>(0, 1, 3, 0), ElementsAre());
    EXPECT_THAT(message_of<InputError>([&] { table.read_block<double>(0, 1, 2, 2); }), HasSubstr("3 columns"));
    EXPECT_THAT(message_of<InputError>([&] { table.read_block<double>(2, 1, 0, 1); }), HasSubstr("2 rows"));
}

TEST_F(StoreHdf5, EmptyDatasetsComeBack) {
    const File file = round_trip([](File& f) {
        f.write("none", std::vector<double>{}, {"s", "no times"});
        f.create_dataset<std::int64_t>("no_columns", {3, 0}, {"1", "nothing"}).write_rows<std::int64_t>(1, 1, {});
        f.write("no_names", std::vector<std::string>{}, {"", "no names"});
    });
    EXPECT_THAT(file.dataset("none").read<double>(), ElementsAre());
    EXPECT_THAT(file.dataset("no_columns").read_rows<std::int64_t>(0, 3), ElementsAre());
    EXPECT_THAT(file.dataset("no_names").read<std::string>(), ElementsAre());
}

TEST_F(StoreHdf5, NumbersAreReadOnlyIntoTypesThatHoldThem) {
    const File file = round_trip([](File& f) {
        f.write("int8", std::vector<std::int8_t>{-1}, {"1", ""});
        f.write("int64", std::vector<std::int64_t>{-1}, {"1", ""});
        f.write("uint64", std::vector<std::uint64_t>{1}, {"1", ""});
        f.write("double", std::vector<double>{0.5}, {"1", ""});
        f.set_attribute("negative", -1);
        f.set_attribute("half", 0.5);
    });
    EXPECT_THAT(file.dataset("int8").read<std::int64_t>(), ElementsAre(-1));
    EXPECT_THAT(file.dataset("int64").read<double>(), ElementsAre(-1.0));
    EXPECT_THROW(file.dataset("int64").read<std::int8_t>(), InputError);
    EXPECT_THROW(file.dataset("int64").read<std::uint64_t>(), InputError);
    EXPECT_THROW(file.dataset("uint64").read<std::int64_t>(), InputError);
    EXPECT_THROW(file.dataset("double").read<std::int64_t>(), InputError);
    EXPECT_THROW(file.dataset("double").read<std::string>(), InputError);
    EXPECT_EQ(file.double_attribute("negative"), -1.0);
    EXPECT_THROW(file.uint_attribute("negative"), InputError);
    EXPECT_THROW(file.int_attribute("half"), InputError);
    EXPECT_THROW(file.string_attribute("half"), InputError);
}

TEST_F(StoreHdf5, ErrorsNameFileAndObject) {
    const File file = round_trip([](File& f) {
        f.create_group("arms/ideal");
        f.write("rate", std::vector{1.0}, {"deg/h", ""});
    });
    const auto names = [&](const std::string& object) { return AllOf(HasSubstr(path_.string()), HasSubstr(object)); };
    EXPECT_THAT(message_of<InputError>([&] { file.dataset("turns/sin"); }), names("/turns/sin"));
    EXPECT_THAT(message_of<InputError>([&] { file.group("arms").group("none"); }), names("/arms/none"));
    EXPECT_THAT(message_of<InputError>([&] { file.dataset("arms"); }), names("must be a dataset"));
    EXPECT_THAT(message_of<InputError>([&] { file.group("rate"); }), names("must be a group"));
    EXPECT_THAT(message_of<InputError>([&] { file.group("arms").string_attribute("x"); }),
                names("attribute x of /arms"));
    EXPECT_THAT(message_of<InputError>([&] { file.dataset("rate").read_rows<double>(1, 1); }), names("/rate"));
    EXPECT_TRUE(file.has("arms/ideal"));
    EXPECT_TRUE(file.has_group("arms"));
    EXPECT_TRUE(file.has_dataset("rate"));
    EXPECT_FALSE(file.has("arms/none/deeper"));
    EXPECT_FALSE(file.has_dataset("arms"));
}

TEST_F(StoreHdf5, FilesThatAreNotHdf5AreRefused) {
    EXPECT_THAT(message_of<InputError>([&] { test::open_file(path_); }), HasSubstr("No such file"));
    EXPECT_THAT(message_of<InputError>([&] { test::open_file(directory_.path()); }), HasSubstr("is not a file"));
    std::ofstream(path_) << "tau_s,dev\n";
    EXPECT_THAT(message_of<InputError>([&] { test::open_file(path_); }), HasSubstr("is not a readable HDF5 file"));
    std::ofstream(path_, std::ios::trunc).flush();
    EXPECT_THAT(message_of<InputError>([&] { test::open_file(path_); }), HasSubstr("is not a readable HDF5 file"));
}

TEST_F(StoreHdf5, ATruncatedFileIsRefused) {
    round_trip([](File& f) { f.write("rate", std::vector<double>(10'000, 1.0), {"deg/h", ""}); });
    std::filesystem::resize_file(path_, 20'000);
    EXPECT_THAT(message_of<InputError>([&] { test::open_file(path_); }), HasSubstr(path_.string()));
}

TEST_F(StoreHdf5, NothingIsPrintedOnFailure) {
    testing::internal::CaptureStderr();
    EXPECT_THROW(test::open_file("/dev/null"), InputError);
    std::thread([&] {
        std::ofstream(path_) << "not HDF5";
        EXPECT_THROW(test::open_file(path_), InputError);
    }).join();
    EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
}

TEST_F(StoreHdf5, EqualDataMakeEqualFiles) {
    const auto bytes = [&](const std::string& name) {
        File file = File::create(directory_ / name);
        file.set_attribute("format", "ringlock-result");
        file.create_dataset<double>("arms/ideal/angle_arcsec", {3, 5}, {"arcsec", "angle"})
            .write_rows<double>(1, 1, std::vector<double>(5, 1.0));
        file.write("arms/names", std::vector<std::string>{"ideal"}, {"", "names"});
        file.close();
        std::ifstream stream(directory_ / name, std::ios::binary);
        return std::string(std::istreambuf_iterator<char>(stream), {});
    };
    const std::string first = bytes("first.h5");
    std::this_thread::sleep_for(std::chrono::milliseconds(1100));  // object times, were there any, count seconds
    EXPECT_TRUE(first == bytes("second.h5"));
}

TEST_F(StoreHdf5, RowsMayBeWrittenFromManyThreads) {
    constexpr std::uint64_t rows = 64;
    const File file = round_trip([](File& f) {
        Dataset data = f.create_dataset<std::int64_t>("data", {rows, 8}, {"1", ""});
        std::vector<std::jthread> threads;
        for (std::uint64_t start = 0; start < 4; ++start)
            threads.emplace_back([&data, start] {
                for (std::uint64_t row = start; row < rows; row += 4)
                    data.write_rows<std::int64_t>(row, 1, std::vector<std::int64_t>(8, static_cast<std::int64_t>(row)));
            });
    });
    const auto data = file.dataset("data").read<std::int64_t>();
    for (std::uint64_t i = 0; i < data.size(); ++i) EXPECT_EQ(data[i], static_cast<std::int64_t>(i / 8));
}

}  // namespace
}  // namespace store_hdf5_test
}  // namespace ringlock::store
