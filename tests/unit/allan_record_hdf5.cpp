#include <fmt/format.h>
#include <pthread.h>

#include <cstdint>
#include <filesystem>

#include "tests/unit/allan_record_support.hpp"

// Series as datasets of HDF5 files.
namespace allan_record_hdf5_test {
namespace {

using namespace ringlock;
using test::AllanRecordHdf5;
using test::same_numbers;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double inf = std::numeric_limits<double>::infinity();

TEST_F(AllanRecordHdf5, DatasetsAreReadByPathOrName) {
    const hid_t h5 = h5_;
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
    close();

    const auto s = record::read_series(path(), "/samples/angle_arcsec");
    EXPECT_THAT(s.values, ElementsAre(0.5, 1.5, -2.0));
    EXPECT_EQ(s.rate_hz, 200.0);
    EXPECT_THAT(record::read_series(path(), "quarter_count").values, ElementsAre(4.0, 5.0, 6.0));
    EXPECT_THAT(error_of(path()),
                AllOf(HasSubstr("2 datasets"), HasSubstr("/samples/angle_arcsec"), HasSubstr("--column")));
    EXPECT_THAT(error_of(path(), "absent"), AllOf(HasSubstr("'absent'"), HasSubstr("/samples/quarter_count")));

    std::filesystem::resize_file(path(), 600);
    EXPECT_THAT(error_of(path(), "quarter_count"), HasSubstr("HDF5"));
}

TEST_F(AllanRecordHdf5, MissingValuesAreKeptAndInfiniteOnesAreNot) {
    write("gaps", {nan, 1.5, nan, nan, -2.0, nan});
    write("endless", {1.0, nan, -inf});
    write("nothing", {nan, nan});
    const auto s = read("gaps");
    EXPECT_THAT(s.values, same_numbers({nan, 1.5, nan, nan, -2.0, nan}));
    EXPECT_EQ(s.missing, 4u);
    EXPECT_EQ(s.n, 6u);
    EXPECT_THAT(refusal("endless"), AllOf(HasSubstr("/endless"), HasSubstr("element 2"), HasSubstr("-inf")));
    EXPECT_THAT(refusal("nothing"), AllOf(HasSubstr("/nothing"), HasSubstr("all 2 values are missing")));
}

TEST_F(AllanRecordHdf5, WholeNumbersBeyondDoublesAreKeptExactly) {
    constexpr std::int64_t largest = std::numeric_limits<std::int64_t>::max();
    const std::vector<std::int64_t> counts = {largest, -largest - 1, 9007199254740993, 0};
    write("signed", H5T_STD_I64BE, H5T_NATIVE_INT64, counts);
    const std::vector<std::uint64_t> up_to_largest = {1, static_cast<std::uint64_t>(largest)};
    write("unsigned", H5T_STD_U64LE, H5T_NATIVE_UINT64, up_to_largest);
    write("small", H5T_STD_I64LE, H5T_NATIVE_INT64, std::vector<std::int64_t>{1, -9007199254740992});
    const std::vector<std::uint64_t> wrapped = {7, 8, static_cast<std::uint64_t>(largest) + 1};
    write("beyond", H5T_STD_U64LE, H5T_NATIVE_UINT64, wrapped);
    write("bytes", H5T_STD_U8LE, H5T_NATIVE_UINT64, std::vector<std::uint64_t>{255, 3});
    EXPECT_EQ(read("signed").counts, counts);
    EXPECT_TRUE(read("signed").rounded);
    EXPECT_THAT(read("unsigned").counts, ElementsAre(1, largest));
    EXPECT_THAT(read("small").counts, IsEmpty());
    EXPECT_THAT(read("small").values, ElementsAre(1.0, -9007199254740992.0));
    EXPECT_THAT(read("bytes").values, ElementsAre(255.0, 3.0));
    EXPECT_THAT(refusal("beyond"), AllOf(HasSubstr("/beyond"), HasSubstr("element 2"), HasSubstr("9223372036854775808"),
                                         HasSubstr("up to 9223372036854775807")));
}

TEST_F(AllanRecordHdf5, ColumnsOfAMatrixOfOneColumnAreRead) {
    write("down", {1.0, 2.0, 3.0}, {.sides = {3, 1}});
    write("across", {4.0, 5.0}, {.sides = {1, 2}});
    write("matrix", {1.0, 2.0, 3.0, 4.0}, {.sides = {2, 2}});
    EXPECT_THAT(read("down").values, ElementsAre(1.0, 2.0, 3.0));
    EXPECT_THAT(read("across").values, ElementsAre(4.0, 5.0));
    EXPECT_THAT(refusal("absent"), AllOf(HasSubstr("'absent'"), HasSubstr("/across, /down, /matrix")));
}

TEST_F(AllanRecordHdf5, RowsAndColumnsOfTablesAreRead) {
    write("table", {0.0, 1.0, 2.0, 10.0, 11.0, 12.0}, {.sides = {2, 3}});
    write("counts", H5T_STD_I64LE, H5T_NATIVE_INT64, std::vector<std::int64_t>{1, 9007199254740993, 3, 5},
          {.sides = {2, 2}});
    write("down", {1.0, 2.0, 3.0}, {.sides = {3, 1}});
    write("odd[0]", {7.0, 8.0});
    const auto row = read("table[1,:]");
    EXPECT_THAT(row.values, ElementsAre(10.0, 11.0, 12.0));
    EXPECT_EQ(row.column, "/table[1,:]");
    EXPECT_THAT(read("/table[ : , 2 ]").values, ElementsAre(2.0, 12.0));
    EXPECT_THAT(read("counts[:,1]").values, ElementsAre(9007199254740992.0, 5.0));
    EXPECT_THAT(read("counts[:,1]").counts, ElementsAre(9007199254740993, 5));
    EXPECT_THAT(read("down[:,0]").values, ElementsAre(1.0, 2.0, 3.0));
    EXPECT_THAT(read("odd[0]").values, ElementsAre(7.0, 8.0));  // a name may have brackets of its own
    EXPECT_THAT(refusal("table[:,1]", "table[1,:]", 1.0), AllOf(HasSubstr("/table[1,:] has 3"), HasSubstr("has 2")));
}

TEST_F(AllanRecordHdf5, ATableOfTimesAndValuesIsOneFile) {
    write("log", {5.0, 1.0, 6.0, 2.0, 8.0, nan, 9.0, 4.0}, {.sides = {4, 2}});
    EXPECT_THAT(read("log[:,1]", "log[:,0]", 1.0).values, same_numbers({1.0, 2.0, nan, nan, 4.0}));
    EXPECT_THAT(refusal("log[:,0]", "log[:,1]", 1.0),
                AllOf(HasSubstr("/log[:,1], element"), HasSubstr("counted from 0")));
}

TEST_F(AllanRecordHdf5, AnIndexThatIsMissingOrWrongIsExplained) {
    write("table", {0.0, 1.0, 2.0, 10.0, 11.0, 12.0}, {.sides = {2, 3}});
    write("empty", std::vector<double>{}, {.sides = {0, 3}});
    EXPECT_THAT(refusal("table"), AllOf(HasSubstr("/table has 2 rows and 3 columns"), HasSubstr("'table[I,:]'"),
                                        HasSubstr("I = 0 to 1"), HasSubstr("J = 0 to 2")));
    EXPECT_THAT(refusal("table[2,:]"), AllOf(HasSubstr("no row 2"), HasSubstr("2 rows and 3 columns"),
                                             HasSubstr("I = 0 to 1"), HasSubstr("'table[:,J]'")));
    EXPECT_THAT(refusal("table[:,3]"), AllOf(HasSubstr("no column 3"), HasSubstr("J = 0 to 2")));
    for (const char* wrong : {"table[1]", "table[1,2]", "table[:,:]", "table[-1,:]", "table[]", "table[1.5,:]",
                              "table[a,:]", "table[99999999999999999999,:]"}) {
        EXPECT_THAT(refusal(wrong), AllOf(HasSubstr(wrong), HasSubstr("[I,:] for row I"))) << wrong;
    }
    EXPECT_THAT(refusal("empty[0,:]"), HasSubstr("empty"));
    EXPECT_THAT(refusal("empty"), HasSubstr("empty"));
    EXPECT_THAT(refusal("absent[0,:]"), AllOf(HasSubstr("'absent[0,:]'"), HasSubstr("/table")));
    EXPECT_THAT(refusal(), AllOf(HasSubstr("2 datasets"), HasSubstr("/table[I,:] or [:,J]")));
}

TEST_F(AllanRecordHdf5, ASeriesHasNoRowsAndColumns) {
    write("x", {1.0, 2.0});
    EXPECT_THAT(refusal("x[0,:]"), AllOf(HasSubstr("/x has one dimension"), HasSubstr("leave the brackets out")));
}

TEST_F(AllanRecordHdf5, TheOnlyTableOfAFileWantsAnIndex) {
    write("table", {1.0, 2.0, 3.0, 4.0}, {.sides = {2, 2}});
    EXPECT_THAT(refusal(),
                AllOf(HasSubstr("--column '/table[I,:]'"), HasSubstr("'/table[:,J]' for column J = 0 to 1")));
}

TEST_F(AllanRecordHdf5, PlacesRowsByTheirTimes) {
    write("t", {10.0, 10.5, 12.0, 12.5});
    write("x", H5T_STD_I64LE, H5T_NATIVE_INT64, std::vector<std::int64_t>{1, 2, 9007199254740993, 4});
    write("short", {1.0, 2.0});
    write("stands", {1.0, 1.5, 1.5, 2.0});
    write("holes", {1.0, 1.5, nan, 2.0});
    const auto s = read("x", "t", 2.0);
    EXPECT_THAT(s.values, same_numbers({1.0, 2.0, nan, nan, 9007199254740992.0, 4.0}));
    EXPECT_THAT(s.counts, ElementsAre(1, 2, 0, 0, 9007199254740993, 4));
    EXPECT_EQ(s.missing, 2u);
    EXPECT_THAT(refusal("x", "short", 2.0), AllOf(HasSubstr("/short has 2"), HasSubstr("/x has 4")));
    EXPECT_THAT(refusal("x", "stands", 2.0),
                AllOf(HasSubstr("/stands, element 2"), HasSubstr("1.5"), HasSubstr("element 1")));
    EXPECT_THAT(refusal("x", "holes", 2.0), AllOf(HasSubstr("/holes, element 2"), HasSubstr("no time")));
    EXPECT_THAT(refusal("x", "absent", 2.0), HasSubstr("'absent'"));
    EXPECT_THAT(refusal("x", "t"), HasSubstr("sampling rate"));
}

TEST_F(AllanRecordHdf5, TheColumnNeedsNoNameBesideTheTime) {
    write("t", {0.0, 1.0});
    write("x", {5.0, 6.0});
    EXPECT_THAT(read(std::nullopt, "t", 1.0).values, ElementsAre(5.0, 6.0));
}

// Several pieces, the last one short; chunks that are smaller than a piece, larger, and no divisor of it.
TEST_F(AllanRecordHdf5, StreamsInBoundedPiecesWhateverTheChunks) {
    std::vector<double> values;
    for (int i = 0; i < 200000; ++i) values.push_back(i % 777 == 5 ? nan : 0.5 * i);
    for (const hsize_t chunk : {0, 1000, 200000, 70001}) {
        const std::string name = fmt::format("x{}", chunk);
        write(name.c_str(), values, {.sides = {}, .chunk = chunk});
    }
    close();
    for (const char* name : {"x0", "x1000", "x200000", "x70001"}) {
        const auto streamed = test::stream({.path = path(), .column = name, .time = std::nullopt});
        EXPECT_LE(streamed.longest, 65536u) << name;
        EXPECT_EQ(streamed.info.n, values.size()) << name;
        EXPECT_THAT(streamed.values, same_numbers(values)) << name;
        EXPECT_THAT(record::read_series(path(), name).values, same_numbers(values)) << name;
    }
}

TEST_F(AllanRecordHdf5, StreamsColumnsOfLongTables) {
    std::vector<double> table;
    std::vector<double> second;
    for (int i = 0; i < 150'000; ++i) {
        table.insert(table.end(), {1.0 * i, 0.5 * i * i, -1.0});
        second.push_back(0.5 * i * i);
    }
    write("plain", table, {.sides = {150'000, 3}, .chunk = 0});
    write("packed", table, {.sides = {150'000, 3}, .chunk = 7001});
    write("rows", table, {.sides = {3, 150'000}, .chunk = 1});
    close();
    for (const char* name : {"plain[:,1]", "packed[:,1]"}) {
        const auto streamed = test::stream({.path = path(), .column = name, .time = std::nullopt});
        EXPECT_LE(streamed.longest, 65536u) << name;
        EXPECT_EQ(streamed.values, second) << name;
    }
    const auto row = test::stream({.path = path(), .column = "rows[2,:]", .time = std::nullopt});
    EXPECT_EQ(row.values, std::vector<double>(table.begin() + 300'000, table.end()));
}

// It would be read as zeros, a trillion of them.
TEST_F(AllanRecordHdf5, ADatasetThatWasNeverWrittenIsRefused) {
    write("x", std::vector<double>{}, {.sides = {hsize_t{1} << 40}, .chunk = 0});
    write("nothing", std::vector<double>{});
    EXPECT_THAT(refusal("x"), AllOf(HasSubstr("/x"), HasSubstr("never written")));
    EXPECT_THAT(refusal("nothing"), AllOf(HasSubstr("/nothing"), HasSubstr("empty")));
}

// Damage.

TEST_F(AllanRecordHdf5, TruncatedFilesAreRefusedAtAnyLength) {
    write("x", std::vector<double>(5000, 1.25));
    close();
    const auto whole = static_cast<double>(std::filesystem::file_size(path()));
    for (const double part : {0.9999, 0.9, 0.5, 0.1, 0.01, 0.001}) {
        std::filesystem::resize_file(path(), static_cast<std::uintmax_t>(part * whole));
        EXPECT_THAT(error_of(path()), HasSubstr("data.h5")) << part;
    }
}

// The library copies elements of the size that the file names, from beyond what it has unpacked.
TEST_F(AllanRecordHdf5, ElementsOfAnAbsurdSizeAreRefused) {
    write("x", std::vector<double>(300, 0.5), {.sides = {}, .chunk = 50});
    close();
    std::string bytes = contents();
    const std::size_t type = bytes.find(std::string("\x11\x20\x3f\0\x08\0\0\0", 8));
    ASSERT_NE(type, std::string::npos);
    bytes[type + 5] = '\xdf';
    EXPECT_THAT(error_of(file(bytes, "bad.h5")), AllOf(HasSubstr("bad.h5"), HasSubstr("57096 bytes each")));
}

// What damage crashes the library depends on what lies in memory beside; so the process that would crash is looked for.
TEST_F(AllanRecordHdf5, ReadingIsTriedInAnotherProcessFirst) {
    static int processes = 0;
    pthread_atfork(
        nullptr, [] { ++processes; }, nullptr);
    write("x", {1.0, 2.0});
    read();
    EXPECT_EQ(processes, 1);
    test::stream({.path = path(), .column = std::nullopt, .time = std::nullopt});
    EXPECT_EQ(processes, 2);
}

TEST_F(AllanRecordHdf5, OverwrittenBytesNeverCrash) {
    write("t", {0.0, 1.0, 3.0});
    write("packed", std::vector<double>(3000, 0.5), {.sides = {}, .chunk = 500});
    write("x", H5T_STD_I64LE, H5T_NATIVE_INT64, std::vector<std::int64_t>{1, 2, 3});
    close();
    const std::string whole = contents();
    int refused = 0;
    for (std::size_t at = 0; at < whole.size(); at += whole.size() / 20) {
        std::string bad = whole;
        for (std::size_t k = at; k < std::min(at + 24, bad.size()); ++k) bad[k] = static_cast<char>(0xA5 ^ bad[k]);
        const std::string damaged = file(bad, "bad.h5");
        for (const char* column : {"packed", "x"}) {
            const std::string error = error_of(record::SeriesRequest{damaged, column, std::nullopt, 0.0});
            if (error == "no error") continue;
            ++refused;
            EXPECT_THAT(error, HasSubstr(damaged));
        }
    }
    EXPECT_GT(refused, 3);
}

}  // namespace
}  // namespace allan_record_hdf5_test
