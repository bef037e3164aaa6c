#include <cmath>
#include <filesystem>

#include "tests/support/array_files.hpp"
#include "tests/unit/allan_record_support.hpp"

// Series as arrays of NumPy.
namespace allan_record_numpy_test {
namespace {

using namespace ringlock;
using test::AllanRecord;
using test::bytes_of;
using test::npy;
using test::npy_dictionary;
using test::write_zip;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;

class AllanRecordNumpy : public AllanRecord {
   protected:
    std::string array(const std::string& type, const std::string& shape, const std::string& data, bool fortran = false,
                      char version = 1) {
        return file(npy(npy_dictionary(type, shape, fortran), data, version), "gyro.npy");
    }
    std::vector<double> values(const std::string& path, const std::optional<std::string>& column = std::nullopt) {
        return record::read_series(path, column).values;
    }
};

TEST_F(AllanRecordNumpy, NumbersOfEverySizeAndByteOrder) {
    const auto expect = [&](const std::string& type, const std::string& data) {
        EXPECT_THAT(values(array("'" + type + "'", "(3,)", data)), ElementsAre(1.0, 2.0, 100.0)) << type;
    };
    expect("<f8", bytes_of<double>({1, 2, 100}));
    expect(">f8", bytes_of<double>({1, 2, 100}, true));
    expect("<f4", bytes_of<float>({1, 2, 100}));
    expect(">f4", bytes_of<float>({1, 2, 100}, true));
    expect("<f2", bytes_of<std::uint16_t>({0x3c00, 0x4000, 0x5640}));  // IEEE 754 binary16
    expect("|i1", bytes_of<std::int8_t>({1, 2, 100}));
    expect("<i2", bytes_of<std::int16_t>({1, 2, 100}));
    expect(">i4", bytes_of<std::int32_t>({1, 2, 100}, true));
    expect("<i8", bytes_of<std::int64_t>({1, 2, 100}));
    expect("|u1", bytes_of<std::uint8_t>({1, 2, 100}));
    expect(">u2", bytes_of<std::uint16_t>({1, 2, 100}, true));
    expect("<u4", bytes_of<std::uint32_t>({1, 2, 100}));
    expect(">u8", bytes_of<std::uint64_t>({1, 2, 100}, true));
}

// Since 1970 a double resolves 2e-7 s: whole seconds and nanoseconds keep their digits.
TEST_F(AllanRecordNumpy, SecondsAndNanosecondsAreOneTime) {
    const std::string path = file("", "log.npz");
    const std::int32_t start = 1700000000;
    write_zip(path,
              {{"gx.npy", npy(npy_dictionary("'<f8'", "(4,)"), bytes_of<double>({1, 2, 3, 4}))},
               {"sec.npy",
                npy(npy_dictionary("'<i4'", "(4,)"), bytes_of<std::int32_t>({start, start, start + 1, start + 1}))},
               {"nsec.npy",
                npy(npy_dictionary("'<u4'", "(4,)"), bytes_of<std::uint32_t>({999'999'000, 999'999'500, 0, 1000}))},
               {"bad.npy",
                npy(npy_dictionary("'<u4'", "(4,)"), bytes_of<std::uint32_t>({999'999'000, 1'000'000'500, 0, 1000}))}});
    const auto request = [&](const std::string& time) {
        return record::SeriesRequest{.path = path, .column = "gx", .time = time, .rate_hz = 2e6};
    };
    const auto s = record::read_series(request("sec,nsec"));
    ASSERT_EQ(s.values.size(), 5U);
    EXPECT_EQ(s.missing, 1U);
    EXPECT_TRUE(std::isnan(s.values[3]));
    EXPECT_THAT(error_of(request("sec,bad")),
                AllOf(HasSubstr("bad, element 1"), HasSubstr("1000000500"), HasSubstr("nanoseconds")));
    EXPECT_THAT(error_of(request("sec,sec")), HasSubstr("twice"));
    auto in_ms = request("sec,nsec");
    in_ms.time_unit = "ms";
    EXPECT_THAT(error_of(in_ms), HasSubstr("--time-unit ms"));
}

TEST_F(AllanRecordNumpy, HalvesAtTheirEnds) {
    const auto halves = bytes_of<std::uint16_t>({0x0001, 0xfbff, 0x8000, 0x7e00});
    const std::vector<double> read = values(array("'<f2'", "(4,)", halves));
    EXPECT_EQ(read[0], std::ldexp(1.0, -24)) << "smallest subnormal";
    EXPECT_EQ(read[1], -65504.0) << "largest in size";
    EXPECT_EQ(read[2], 0.0);
    EXPECT_TRUE(std::isnan(read[3])) << "missing";
    EXPECT_THAT(error_of(array("'<f2'", "(1,)", bytes_of<std::uint16_t>({0x7c00}))), HasSubstr("must be finite"));
}

TEST_F(AllanRecordNumpy, LargeCountsKeepTheirLastDigit) {
    const std::int64_t large = 9007199254740993;  // 2^53 + 1
    const auto series =
        record::read_series(array("'<i8'", "(2,)", bytes_of<std::int64_t>({large, -large})), std::nullopt);
    EXPECT_THAT(series.counts, ElementsAre(large, -large));
    EXPECT_THAT(error_of(array("'<u8'", "(1,)", bytes_of<std::uint64_t>({~std::uint64_t{0}}))),
                AllOf(HasSubstr("element 0"), HasSubstr("18446744073709551615")));
}

TEST_F(AllanRecordNumpy, EveryVersionOfTheHead) {
    for (const char version : {'\1', '\2', '\3'}) {
        EXPECT_THAT(values(array("'<f8'", "(2,)", bytes_of<double>({3, 4}), false, version)), ElementsAre(3.0, 4.0));
    }
    EXPECT_THAT(error_of(array("'<f8'", "(2,)", bytes_of<double>({3, 4}), false, 4)), HasSubstr("version 4"));
}

TEST_F(AllanRecordNumpy, RowsAndColumnsInBothOrders) {
    // [[1 2 3] [4 5 6]]
    const std::string by_rows = array("'<f8'", "(2, 3)", bytes_of<double>({1, 2, 3, 4, 5, 6}));
    EXPECT_THAT(values(by_rows, "[1,:]"), ElementsAre(4.0, 5.0, 6.0));
    EXPECT_THAT(values(by_rows, "[:,1]"), ElementsAre(2.0, 5.0));
    EXPECT_THAT(values(by_rows, "gyro[:,2]"), ElementsAre(3.0, 6.0)) << "by the name of the file";
    EXPECT_THAT(error_of(by_rows), AllOf(HasSubstr("2 rows and 3 columns"), HasSubstr("[:,J]")));
    EXPECT_THAT(error_of(by_rows, "[:,3]"), HasSubstr("no column 3"));
    const std::string by_columns = array("'<f8'", "(2, 3)", bytes_of<double>({1, 4, 2, 5, 3, 6}), true);
    EXPECT_THAT(values(by_columns, "[1,:]"), ElementsAre(4.0, 5.0, 6.0));
    EXPECT_THAT(values(by_columns, "[:,1]"), ElementsAre(2.0, 5.0));
}

TEST_F(AllanRecordNumpy, ALongColumnIsReadInPieces) {
    std::vector<double> table;
    for (int i = 0; i < 100'000; ++i) {
        table.push_back(i);
        table.push_back(-i);
    }
    const auto read = values(array("'<f8'", "(100000, 2)", bytes_of(table)), "[:,1]");
    ASSERT_EQ(read.size(), 100'000U);
    for (std::size_t i = 0; i < read.size(); ++i) ASSERT_EQ(read[i], -static_cast<double>(i));
}

TEST_F(AllanRecordNumpy, FieldsOfRecordsAreColumns) {
    std::string data;
    for (int i = 0; i < 4; ++i) {
        data += bytes_of<double>({0.25 * i}) + bytes_of<std::int16_t>({static_cast<std::int16_t>(10 * i)}) + "ab" +
                bytes_of<float>({1.0F, static_cast<float>(i)});
    }
    const std::string path = array("[('t', '<f8'), ('n', '<i2'), ('s', '|S2'), ('v', '<f4', (2,))]", "(4,)", data);
    const auto series = record::read_series({path, "n", "t", 4.0});
    EXPECT_THAT(series.values, ElementsAre(0.0, 10.0, 20.0, 30.0));
    EXPECT_THAT(values(path, "v[:,1]"), ElementsAre(0.0, 1.0, 2.0, 3.0));
    EXPECT_THAT(error_of(path, "s"), HasSubstr("holds text"));
    EXPECT_THAT(error_of(path, "v"), HasSubstr("[:,J]"));
    EXPECT_THAT(error_of(path), AllOf(HasSubstr("arr_0/t"), HasSubstr("arr_0/n"), HasSubstr("arr_0/v[:,J]")));
}

TEST_F(AllanRecordNumpy, WhatIsNoNumberIsRefusedByName) {
    const auto refusal = [&](const std::string& type) { return error_of(array(type, "(1,)", std::string(64, '\0'))); };
    EXPECT_THAT(refusal("'<c16'"), HasSubstr("complex"));
    EXPECT_THAT(refusal("'|O'"), HasSubstr("Python objects"));
    EXPECT_THAT(refusal("'<U3'"), HasSubstr("text"));
    EXPECT_THAT(refusal("'<M8[ns]'"), HasSubstr("dates"));
    EXPECT_THAT(refusal("'<f16'"), HasSubstr("float64"));
    EXPECT_THAT(error_of(array("'<f8'", "()", bytes_of<double>({1}))), HasSubstr("single value"));
    EXPECT_THAT(error_of(array("'<f8'", "(1, 1, 1)", bytes_of<double>({1}))), HasSubstr("3 dimensions"));
    EXPECT_THAT(error_of(array("'<f8'", "(0,)", "")), HasSubstr("is empty"));
}

TEST_F(AllanRecordNumpy, AHeadThatClaimsMoreThanIsThereIsRefusedAtOnce) {
    EXPECT_THAT(error_of(array("'<f8'", "(1000000000000,)", bytes_of<double>({1, 2}))),
                AllOf(HasSubstr("8000000000000 bytes"), HasSubstr("there are 16"), HasSubstr("cut off")));
    EXPECT_THAT(error_of(array("'<f8'", "(18446744073709551615, 18446744073709551615)", "")), HasSubstr("cut off"));
    const std::string whole = npy(npy_dictionary("'<f8'", "(2,)"), bytes_of<double>({1, 2}));
    for (std::size_t length = 6; length < whole.size(); length += 3) {
        EXPECT_THAT(error_of(file(whole.substr(0, length), "cut.npy")), HasSubstr("cut.npy")) << length;
    }
    for (const char* dictionary : {"", "{", "{'descr': '<f8'}", "[1]", "{'descr': ((((((((((((((((((((1", "{1: 2}}",
                                   "{'descr': '<f8', 'fortran_order': 1, 'shape': (2,)}"}) {
        EXPECT_THAT(error_of(file(npy(dictionary, ""), "bad.npy")), HasSubstr("bad.npy")) << dictionary;
    }
}

TEST_F(AllanRecordNumpy, ArchivesHoldArraysByName) {
    std::vector<double> t, x;
    for (int i = 0; i < 1000; ++i) {
        t.push_back(0.5 * i);
        x.push_back(std::sin(i));
    }
    for (const bool packed : {false, true}) {
        const std::string path = (directory_ / "log.npz").string();
        test::write_zip(path,
                        {{"t.npy", npy(npy_dictionary("'<f8'", "(1000,)"), bytes_of(t))},
                         {"note.txt", "hello"},
                         {"m.npy", npy(npy_dictionary("'<i4'", "(2, 2)"), bytes_of<std::int32_t>({1, 2, 3, 4}))},
                         {"gyro/x.npy", npy(npy_dictionary("'<f8'", "(1000,)"), bytes_of(x))}},
                        packed);
        EXPECT_EQ(record::read_series({path, "x", "t", 2.0}).values, x);
        EXPECT_THAT(values(path, "m[:,0]"), ElementsAre(1.0, 3.0));
        EXPECT_THAT(error_of(path), AllOf(HasSubstr("/t"), HasSubstr("/gyro/x"), HasSubstr("/m[I,:]")));
    }
}

TEST_F(AllanRecordNumpy, AnArchiveThatUnpacksToFarTooMuchIsRefusedByItsHead) {
    const std::string path = file("", "bomb.npz");
    constexpr std::size_t bytes = 110'000'000;
    test::write_zip(path, {{"x.npy", npy(npy_dictionary("'|i1'", "(110000000,)"), std::string(bytes, '\0'))}});
    EXPECT_THAT(error_of(path),
                AllOf(HasSubstr("bomb.npz: dataset /x: unpacks to 1.1e+08 bytes"), HasSubstr("more than 200 times")));
}

// A request of the name would mean either array. One was read with the layout of the other, behind the end of that.
TEST_F(AllanRecordNumpy, ANameThatOccursTwiceInAnArchiveIsRefusedIfRequested) {
    const std::string path = (directory_ / "log.npz").string();
    test::write_zip(path, {{"x.npy", npy(npy_dictionary("[('a', '<f8')]", "(2,)"), bytes_of<double>({1, 2}))},
                           {"y.npy", npy(npy_dictionary("'<f8'", "(2,)"), bytes_of<double>({5, 6}))},
                           {"x.npy", npy(npy_dictionary("'<i4'", "(2,)"), bytes_of<std::int32_t>({3, 4}))}});
    for (const char* const asked : {"x", "x/a"}) {
        EXPECT_THAT(error_of(path, asked), AllOf(HasSubstr("log.npz"), HasSubstr("/x"),
                                                 HasSubstr("occurs more than once in the file; rename or remove one")));
    }
    EXPECT_THAT(values(path, "y"), ElementsAre(5.0, 6.0));
}

// The second field was read with the type of the first, which may be wider than any number.
TEST_F(AllanRecordNumpy, FieldNamesThatOccurTwiceOrAreEmptyAreRefused) {
    const std::string path = array("[('x', '<f16'), ('x', '<u8')]", "(2,)", std::string(48, '\1'));
    EXPECT_THAT(error_of(path, "x"), AllOf(HasSubstr("gyro.npy"), HasSubstr("is the name of several fields")));
    const std::string nameless = array("[('x', '<f16'), ('', '<u8')]", "(2,)", std::string(48, '\1'));
    EXPECT_THAT(error_of(nameless), AllOf(HasSubstr("gyro.npy"), HasSubstr("a field without a name")));
}

TEST_F(AllanRecordNumpy, ArchivesThatAreNoneAreNamed) {
    const std::string path = (directory_ / "log.npz").string();
    test::write_zip(path, {{"a.txt", "hello"}});
    EXPECT_THAT(error_of(path), AllOf(HasSubstr("log.npz"), HasSubstr("without arrays")));
    test::write_zip(path, {{"x.npy", npy(npy_dictionary("'<f8'", "(100000000000,)"), bytes_of<double>({1}))}});
    EXPECT_THAT(error_of(path), AllOf(HasSubstr("/x"), HasSubstr("cut off")));
    EXPECT_THAT(error_of(file(std::string("PK\x03\x04garbage that is no archive at all"), "bad.npz")),
                HasSubstr("bad.npz"));
}

}  // namespace
}  // namespace allan_record_numpy_test
