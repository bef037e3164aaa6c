// Records as files: both forms, those of other programs, and damaged ones.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hdf5.h>

#include <filesystem>
#include <fstream>
#include <limits>
#include <random>

#include "analysis/record/record.hpp"
#include "analysis/record/series/series.hpp"
#include "engine/core/error.hpp"
#include "tests/support/expect_throw.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/unit/record_support.hpp"

namespace ringlock::record {
namespace record_file_test {
namespace {

using test::expect_equal;
using test::file_bytes;
using test::full_record;
using test::message_of;
using test::plain_samples;
using test::plain_turns;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
namespace fs = std::filesystem;

class RecordFile : public testing::Test {
   protected:
    std::string path(const std::string& name = "r.h5") const { return (directory_ / name).string(); }
    std::string text(const std::string& content, const std::string& name = "r.csv") const {
        std::ofstream(directory_ / name, std::ios::binary) << content;
        return path(name);
    }
    static std::string refusal(const std::string& path) {
        return message_of<InputError>([&] { read_record(path); });
    }
    test::TemporaryDirectory directory_;
};

TEST_F(RecordFile, ComesBackAsItWas) {
    write_record(path(), full_record());
    EXPECT_TRUE(is_hdf5(path()));
    const Record back = read_record(path());
    expect_equal(full_record(), back);
    EXPECT_TRUE(back.ignored.empty());
    EXPECT_EQ(directory_.entries(), 1);
}

TEST_F(RecordFile, RandomRecordsComeBackAsTheyWere) {
    std::mt19937_64 engine(20);
    const auto coin = [&] { return engine() % 2 == 0; };
    const auto number = [&] {
        // Any exponent, the smallest and largest included.
        const double mantissa = std::uniform_real_distribution<double>(0.5, 1.0)(engine);
        return std::ldexp(mantissa, static_cast<int>(engine() % 200) - 100);
    };
    for (int i = 0; i < 20; ++i) {
        Record r;
        if (coin()) r.title = std::string(engine() % 300, 'x') + " \xE2\x82\xAC\n\"";
        if (coin()) r.licence = "BSD";
        for (auto* field : {&r.declared.scale_factor_arcsec, &r.declared.clock_hz, &r.declared.readout_noise_rad}) {
            if (coin()) *field = number();
        }
        if (coin()) r.declared.bias_deg_h = -number();
        const bool turns = coin();
        if (turns) {
            r.turns = plain_turns(1 + engine() % 300, 3.0, engine());
            for (double& value : r.turns->accel_before_rad_s2) value = coin() ? number() : 0.0;
        }
        if (!turns || coin()) {
            r.samples = plain_samples(1 + engine() % 300, static_cast<SampleKind>(engine() % 3), engine());
            r.samples->rate_hz = number();
            r.samples->t0_s = -number();
            if (coin()) r.samples->witnesses["temperature_c"].assign(r.samples->size(), number());
            if (coin()) r.samples->witnesses["accel_z"].assign(r.samples->size(), -number());
        }
        if (coin()) r.temperature_c = {{0.0, number()}, {number(), -number()}};
        if (coin()) r.input_rate_deg_h = {{-1.0}, {number()}};
        write_record(path(), r);
        expect_equal(r, read_record(path()));
    }
}

TEST_F(RecordFile, ExtremeNumbersComeBack) {
    Record r;
    r.samples = plain_samples(4, SampleKind::quarter_count);
    r.samples->counts = {std::numeric_limits<std::int64_t>::min(), -1, 0, std::numeric_limits<std::int64_t>::max()};
    write_record(path(), r);
    EXPECT_EQ(read_record(path()).samples->counts, r.samples->counts);
}

TEST_F(RecordFile, MissingAccelerationsAreZeros) {
    Record r = full_record();
    r.turns->accel_before_rad_s2.clear();
    r.turns->accel_after_rad_s2.clear();
    write_record(path(), r);
    const Turns turns = *read_record(path()).turns;
    EXPECT_EQ(turns.accel_before_rad_s2, std::vector<double>(50, 0.0));
    EXPECT_EQ(turns.accel_after_rad_s2, std::vector<double>(50, 0.0));
}

TEST_F(RecordFile, ReplacesRecordsOnly) {
    write_record(path(), full_record());
    Record other = full_record();
    other.title = "other";
    write_record(path(), other);
    EXPECT_EQ(read_record(path()).title, "other");
    const std::string csv = text("# rate_hz = 1\nangle_arcsec\n1\n2\n");
    const std::string before = file_bytes(csv);
    EXPECT_THAT(message_of<InputError>([&] { write_record(csv, other); }), AllOf(HasSubstr(csv), HasSubstr("move it")));
    EXPECT_EQ(file_bytes(csv), before);
    EXPECT_THAT(message_of<InputError>([&] { write_record(path("no/r.h5"), other); }), HasSubstr("no"));
    EXPECT_THAT(message_of<InputError>([&] { write_record(directory_.path().string(), other); }),
                HasSubstr("directory"));
    EXPECT_EQ(directory_.entries(), 2);
}

// What other programs write.

/// Files made with the HDF5 library itself, as h5py and MATLAB make them.
class ForeignRecord : public RecordFile {
   protected:
    void SetUp() override { begin(H5P_DEFAULT); }
    void TearDown() override {
        if (file_ >= 0) H5Fclose(file_);
    }
    void begin(hid_t creation) {
        if (file_ >= 0) H5Fclose(file_);
        file_ = H5Fcreate(path().c_str(), H5F_ACC_TRUNC, creation, H5P_DEFAULT);
    }
    void end() {
        H5Fclose(file_);
        file_ = -1;
    }
    hid_t group(const char* name) { return H5Gcreate2(file_, name, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT); }

    /// `length` 0: variable.
    void text_attribute(const char* name, const std::string& value, std::size_t length, H5T_str_t padding,
                        const std::vector<hsize_t>& extent = {}) {
        const hid_t type = H5Tcopy(H5T_C_S1);
        H5Tset_size(type, length == 0 ? H5T_VARIABLE : length);
        H5Tset_strpad(type, padding);
        const hid_t space = space_of(extent);
        const hid_t attribute = H5Acreate2(file_, name, type, space, H5P_DEFAULT, H5P_DEFAULT);
        std::string padded = value;
        padded.resize(length, padding == H5T_STR_SPACEPAD ? ' ' : '\0');
        const char* pointer = value.c_str();
        if (length == 0) {
            H5Awrite(attribute, type, &pointer);
        } else {
            H5Awrite(attribute, type, padded.data());
        }
        H5Aclose(attribute);
        H5Sclose(space);
        H5Tclose(type);
    }
    void number_attribute(hid_t where, const char* name, double value, hid_t type,
                          const std::vector<hsize_t>& extent = {}) {
        const hid_t space = space_of(extent);
        const hid_t attribute = H5Acreate2(where, name, type, space, H5P_DEFAULT, H5P_DEFAULT);
        H5Awrite(attribute, H5T_NATIVE_DOUBLE, &value);
        H5Aclose(attribute);
        H5Sclose(space);
    }
    static hid_t space_of(const std::vector<hsize_t>& extent) {
        return extent.empty() ? H5Screate(H5S_SCALAR)
                              : H5Screate_simple(static_cast<int>(extent.size()), extent.data(), nullptr);
    }
    void dataset(const char* name, const std::vector<double>& values, hid_t type, std::vector<hsize_t> extent = {},
                 bool compressed = false) {
        if (extent.empty()) extent = {values.size()};
        const hid_t space = space_of(extent);
        const hid_t creation = H5Pcreate(H5P_DATASET_CREATE);
        if (compressed) {
            std::vector<hsize_t> chunk = extent;
            for (hsize_t& side : chunk) side = std::min<hsize_t>(side, 7);
            H5Pset_chunk(creation, static_cast<int>(chunk.size()), chunk.data());
            H5Pset_shuffle(creation);
            H5Pset_deflate(creation, 6);
        }
        const hid_t made = H5Dcreate2(file_, name, type, space, H5P_DEFAULT, creation, H5P_DEFAULT);
        ASSERT_GE(made, 0) << name;
        H5Dwrite(made, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data());
        H5Dclose(made);
        H5Pclose(creation);
        H5Sclose(space);
    }
    void head() {
        text_attribute("format", "rlg-record", 0, H5T_STR_NULLTERM);
        number_attribute(file_, "format_version", 1.0, H5T_STD_I32LE);
    }
    /// All columns of plain_turns(50) but one.
    void turns_without(const std::string& missing) {
        H5Gclose(group("turns"));
        const Turns turns = plain_turns(50);
        const std::vector<double> direction(turns.direction.begin(), turns.direction.end());
        const std::vector<double> counts(turns.quarter_count.begin(), turns.quarter_count.end());
        for (const auto& [name, values] :
             std::vector<std::pair<std::string, std::vector<double>>>{{"time_s", turns.time_s},
                                                                      {"direction", direction},
                                                                      {"quarter_count", counts},
                                                                      {"sin", turns.sine},
                                                                      {"cos", turns.cosine}}) {
            if (name != missing) dataset(("turns/" + name).c_str(), values, H5T_IEEE_F64LE);
        }
    }
    std::string refused() {
        end();
        return refusal(path());
    }

    hid_t file_ = -1;
};

TEST_F(ForeignRecord, OtherTypesShapesAndFiltersAreRead) {
    text_attribute("format", "rlg-record", 10, H5T_STR_NULLPAD);
    text_attribute("title", "a run", 12, H5T_STR_SPACEPAD);
    text_attribute("instrument", "one", 0, H5T_STR_NULLTERM, {1});
    number_attribute(file_, "format_version", 1.0, H5T_IEEE_F64LE, {1, 1});
    const hid_t declared = group("declared");
    number_attribute(declared, "scale_factor_arcsec", 0.5, H5T_IEEE_F32BE);
    number_attribute(declared, "clock_hz", 100e6, H5T_STD_I64BE);
    H5Gclose(declared);
    H5Gclose(group("turns"));
    const Turns turns = plain_turns(50);
    const std::vector<double> direction(turns.direction.begin(), turns.direction.end());
    const std::vector<double> counts(turns.quarter_count.begin(), turns.quarter_count.end());
    dataset("turns/time_s", turns.time_s, H5T_IEEE_F64BE, {50, 1}, true);
    dataset("turns/direction", direction, H5T_STD_I64LE, {}, true);
    dataset("turns/quarter_count", counts, H5T_STD_I32BE, {1, 50});
    dataset("turns/sin", turns.sine, H5T_IEEE_F32LE, {}, true);
    dataset("turns/cos", turns.cosine, H5T_IEEE_F32LE);
    dataset("turns/accel_after_rad_s2", std::vector<double>(50, 7.0), H5T_STD_U8LE);
    dataset("turns/note", {1, 2, 3, 4, 5, 6, 7, 8}, H5T_IEEE_F64LE, {2, 2, 2});
    dataset("extra", {1, 2}, H5T_IEEE_F64LE);
    end();
    const Record r = read_record(path());
    EXPECT_EQ(r.title, "a run");
    EXPECT_EQ(r.instrument, "one");
    EXPECT_EQ(r.declared.scale_factor_arcsec, 0.5);
    EXPECT_EQ(r.declared.clock_hz, 100e6);
    EXPECT_EQ(r.turns->time_s, turns.time_s);
    EXPECT_EQ(r.turns->direction, turns.direction);
    EXPECT_EQ(r.turns->quarter_count, turns.quarter_count);
    EXPECT_EQ(r.turns->sine[3], static_cast<double>(static_cast<float>(turns.sine[3])));
    EXPECT_EQ(r.turns->accel_before_rad_s2, std::vector<double>(50, 0.0));
    EXPECT_EQ(r.turns->accel_after_rad_s2, std::vector<double>(50, 7.0));
    EXPECT_THAT(r.ignored, ElementsAre("/turns/note", "/extra"));
}

TEST_F(ForeignRecord, CountsMayBeDoublesOrUnsigned) {
    for (const hid_t type : {H5T_IEEE_F64LE, H5T_STD_U64LE, H5T_STD_U8LE, H5T_STD_I16BE}) {
        begin(H5P_DEFAULT);
        head();
        const hid_t samples = group("samples");
        number_attribute(samples, "rate_hz", 50.0, H5T_STD_U8LE);
        H5Gclose(samples);
        dataset("samples/quarter_count", {0, 5, 9, 120}, type);
        end();
        const Record r = read_record(path());
        EXPECT_THAT(r.samples->counts, ElementsAre(0, 5, 9, 120));
        EXPECT_EQ(r.samples->rate_hz, 50.0);
        EXPECT_EQ(r.samples->t0_s, 0.0);
    }
}

TEST_F(ForeignRecord, AFileWithABlockOfTheUsersInFrontIsRead) {
    const hid_t creation = H5Pcreate(H5P_FILE_CREATE);
    H5Pset_userblock(creation, 512);
    begin(creation);
    H5Pclose(creation);
    head();
    turns_without("nothing");
    end();
    std::fstream(path(), std::ios::binary | std::ios::in | std::ios::out) << "MATLAB 7.3 MAT-file";
    EXPECT_TRUE(is_hdf5(path()));
    EXPECT_EQ(read_record(path()).turns->size(), 50U);
    EXPECT_EQ(read_series(path(), "sin").values.size(), 50U);
}

TEST_F(ForeignRecord, MissingThingsAreNamed) {
    EXPECT_THAT(refused(), AllOf(HasSubstr(path()), HasSubstr("format is missing"), HasSubstr("rlg-record")));
    begin(H5P_DEFAULT);
    text_attribute("format", "rlg-record", 0, H5T_STR_NULLTERM);
    EXPECT_THAT(refused(), HasSubstr("format_version is missing"));
    begin(H5P_DEFAULT);
    head();
    EXPECT_THAT(refused(), HasSubstr("neither turns nor samples"));
    for (const char* name : {"time_s", "direction", "quarter_count", "sin", "cos"}) {
        begin(H5P_DEFAULT);
        head();
        turns_without(name);
        EXPECT_THAT(refused(),
                    AllOf(HasSubstr(path()), HasSubstr(std::string("/turns/") + name), HasSubstr("missing")));
    }
    begin(H5P_DEFAULT);
    head();
    H5Gclose(group("samples"));
    dataset("samples/angle_arcsec", {1, 2}, H5T_IEEE_F64LE);
    EXPECT_THAT(refused(), AllOf(HasSubstr("/samples"), HasSubstr("rate_hz is missing")));
    begin(H5P_DEFAULT);
    head();
    const hid_t samples = group("samples");
    number_attribute(samples, "rate_hz", 50.0, H5T_STD_U8LE);
    H5Gclose(samples);
    EXPECT_THAT(refused(), AllOf(HasSubstr("/samples"), HasSubstr("no samples")));
    begin(H5P_DEFAULT);
    head();
    turns_without("nothing");
    H5Gclose(group("environment"));
    dataset("environment/time_s", {1, 2}, H5T_IEEE_F64LE);
    EXPECT_THAT(refused(), AllOf(HasSubstr("/environment/temperature_c"), HasSubstr("missing")));
}

TEST_F(ForeignRecord, WrongFormatsAreNamed) {
    text_attribute("format", "ringlock-result", 0, H5T_STR_NULLTERM);
    EXPECT_THAT(refused(), AllOf(HasSubstr("ringlock-result"), HasSubstr("analyze")));
    begin(H5P_DEFAULT);
    number_attribute(file_, "format", 1.0, H5T_IEEE_F64LE);
    EXPECT_THAT(refused(), AllOf(HasSubstr("format"), HasSubstr("must be a string")));
    begin(H5P_DEFAULT);
    text_attribute("format", "rlg-record", 0, H5T_STR_NULLTERM);
    number_attribute(file_, "format_version", 2.0, H5T_STD_I32LE);
    EXPECT_THAT(refused(), AllOf(HasSubstr("format_version is 2"), HasSubstr("reads 1")));
}

TEST_F(ForeignRecord, WrongTypesAndShapesAreNamed) {
    const auto with_sine = [&](const auto& make) {
        begin(H5P_DEFAULT);
        head();
        turns_without("sin");
        make();
        return refused();
    };
    EXPECT_THAT(with_sine([&] {
                    dataset("turns/sin", std::vector<double>(50, 1.0), H5T_IEEE_F64LE, {10, 5});
                }),
                AllOf(HasSubstr("/turns/sin"), HasSubstr("10 x 5"), HasSubstr("one column")));
    EXPECT_THAT(with_sine([&] {
                    dataset("turns/sin", std::vector<double>(50, 1.0), H5T_IEEE_F64LE, {5, 5, 2});
                }),
                AllOf(HasSubstr("/turns/sin"), HasSubstr("dimensions")));
    EXPECT_THAT(with_sine([&] { dataset("turns/sin", std::vector<double>(49, 1.0), H5T_IEEE_F64LE); }),
                AllOf(HasSubstr("/turns/sin"), HasSubstr("49 rows"), HasSubstr("50")));
    EXPECT_THAT(with_sine([&] { H5Gclose(group("turns/sin")); }),
                AllOf(HasSubstr("/turns/sin"), HasSubstr("must be a dataset")));
    EXPECT_THAT(
        with_sine([&] {
            const hid_t space = H5Screate(H5S_SCALAR);
            H5Dclose(H5Dcreate2(file_, "turns/sin", H5T_IEEE_F64LE, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT));
            H5Sclose(space);
        }),
        AllOf(HasSubstr("/turns/sin"), HasSubstr("single value")));
    EXPECT_THAT(with_sine([&] {
                    const hid_t type = H5Tcreate(H5T_COMPOUND, 16);
                    H5Tinsert(type, "re", 0, H5T_NATIVE_DOUBLE);
                    H5Tinsert(type, "im", 8, H5T_NATIVE_DOUBLE);
                    const hid_t space = space_of({50});
                    H5Dclose(H5Dcreate2(file_, "turns/sin", type, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT));
                    H5Sclose(space);
                    H5Tclose(type);
                }),
                AllOf(HasSubstr("/turns/sin"), HasSubstr("must hold numbers")));
    EXPECT_THAT(
        with_sine([&] {
            // Never written, so that it takes no space on the disk.
            const hid_t space = space_of({hsize_t{1} << 40});
            H5Dclose(H5Dcreate2(file_, "turns/sin", H5T_IEEE_F64LE, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT));
            H5Sclose(space);
        }),
        AllOf(HasSubstr("/turns/sin"), HasSubstr("never written")));
    const auto with_counts = [&](const std::vector<double>& counts, hid_t type) {
        begin(H5P_DEFAULT);
        head();
        const hid_t samples = group("samples");
        number_attribute(samples, "rate_hz", 50.0, H5T_IEEE_F64LE);
        H5Gclose(samples);
        dataset("samples/quarter_count", counts, type);
        return refused();
    };
    EXPECT_THAT(with_counts({1, 2.5, 3}, H5T_IEEE_F64LE),
                AllOf(HasSubstr("/samples/quarter_count"), HasSubstr("row 1 is 2.5"), HasSubstr("whole")));
    EXPECT_THAT(with_counts({1, 2, std::nan("")}, H5T_IEEE_F64LE),
                AllOf(HasSubstr("row 2 is nan"), HasSubstr("whole")));
    EXPECT_THAT(with_counts({1, 1.8e19}, H5T_STD_U64LE), AllOf(HasSubstr("row 1"), HasSubstr("too large")));
    begin(H5P_DEFAULT);
    head();
    turns_without("direction");
    std::vector<double> direction(50, 1.0);
    direction[1] = 255.0;
    dataset("turns/direction", direction, H5T_STD_U8LE);
    EXPECT_THAT(refused(), AllOf(HasSubstr("direction: row 1 is 255"), HasSubstr("-1 at a maximum")));
    begin(H5P_DEFAULT);
    head();
    turns_without("nothing");
    dataset("samples", {1.0}, H5T_IEEE_F64LE);
    EXPECT_THAT(refused(), AllOf(HasSubstr("/samples"), HasSubstr("must be a group")));
    begin(H5P_DEFAULT);
    head();
    const hid_t declared = group("declared");
    number_attribute(declared, "clock_hz", 1.0, H5T_IEEE_F64LE, {2});
    H5Gclose(declared);
    EXPECT_THAT(refused(), AllOf(HasSubstr("clock_hz"), HasSubstr("/declared"), HasSubstr("must be a number")));
}

// Damage.

TEST_F(RecordFile, TruncatedFilesAreRefusedAtAnyLength) {
    write_record(path(), full_record());
    const std::string whole = file_bytes(path());
    for (const double part : {0.0, 0.0001, 0.01, 0.1, 0.3, 0.5, 0.7, 0.9, 0.99, 0.9999}) {
        const auto length = static_cast<std::size_t>(part * static_cast<double>(whole.size()));
        const std::string cut = text(whole.substr(0, length), "cut.h5");
        EXPECT_THAT(refusal(cut), HasSubstr(cut)) << length << " of " << whole.size() << " bytes";
    }
}

TEST_F(RecordFile, OverwrittenBytesNeverCrash) {
    write_record(path(), full_record());
    const std::string whole = file_bytes(path());
    for (std::size_t i = 0; i < 40; ++i) {
        std::string bad = whole;
        const std::size_t at = i * (whole.size() / 40);
        for (std::size_t k = at; k < std::min(at + 48, bad.size()); ++k) bad[k] = static_cast<char>(0xA5 ^ bad[k]);
        const std::string damaged = text(bad, "bad.h5");
        try {
            (void)read_record(damaged);
        } catch (const InputError& error) {
            EXPECT_THAT(error.what(), HasSubstr(damaged));
        }
    }
}

// The text form.

constexpr const char* good =
    "# format = rlg-record\n# format_version = 1\n# title = bench, x axis\n# a sentence = not a key\n# rate_hz = 200\n"
    "# t0_s = -1.5\n# declared.scale_factor_arcsec = 0.6\n\nangle_increment_arcsec, accel_x ,temperature_c\n"
    "0.5,1,20\r\n-0.25,+2,20.5 # warm\n1e-3,3,21";

TEST_F(RecordFile, TheTextFormIsRead) {
    for (const std::string& front : {std::string(), std::string("\xEF\xBB\xBF")}) {
        const Record r = read_record(text(front + good));
        EXPECT_EQ(r.title, "bench, x axis");
        EXPECT_EQ(r.declared.scale_factor_arcsec, 0.6);
        EXPECT_FALSE(r.declared.clock_hz);
        EXPECT_FALSE(r.turns);
        ASSERT_TRUE(r.samples);
        EXPECT_EQ(r.samples->rate_hz, 200.0);
        EXPECT_EQ(r.samples->t0_s, -1.5);
        EXPECT_EQ(r.samples->kind, SampleKind::angle_increment_arcsec);
        EXPECT_THAT(r.samples->values, ElementsAre(0.5, -0.25, 1e-3));
        EXPECT_THAT(r.samples->witnesses.at("accel_x"), ElementsAre(1.0, 2.0, 3.0));
        EXPECT_THAT(r.samples->witnesses.at("temperature_c"), ElementsAre(20.0, 20.5, 21.0));
        EXPECT_TRUE(r.ignored.empty());
        write_record(path(), r);
        expect_equal(r, read_record(path()));
    }
    const Record counts = read_record(text("# rate_hz = 1\nquarter_count\n9007199254740993\n+4\n-5.0\n6e2\n"));
    EXPECT_THAT(counts.samples->counts, ElementsAre(9007199254740993, 4, -5, 600));
    const Record blanks = read_record(text("# rate_hz = 1\nangle_arcsec note\n1 a\n 2  b\n"));
    EXPECT_THAT(blanks.samples->values, ElementsAre(1.0, 2.0));
    EXPECT_THAT(blanks.ignored, ElementsAre("line 2: column note"));
    EXPECT_THAT(read_record(text("# rate_hz = 1\n# who = me\nangle_arcsec\n1\n2\n")).ignored,
                ElementsAre("line 2: who"));
}

TEST_F(RecordFile, TextThatIsNoRecordIsRefusedWithItsPlace) {
    const std::string rate = "# rate_hz = 100\n";
    const std::vector<std::tuple<std::string, std::vector<std::string>>> faults = {
        {"", {"no header row"}},
        {"# rate_hz = 100\n", {"no header row"}},
        {rate + "angle_arcsec\n", {"no rows"}},
        {"angle_arcsec\n1\n2\n", {"no rate", "# rate_hz"}},
        {rate + "1,2\n3,4\n", {":2:", "names of the columns"}},
        {rate + "accel_x,note\n1,2\n", {":2:", "no column of samples", "accel_x, note"}},
        {rate + "time_s,direction,sin,cos\n1,1,1,1\n", {"turns must be written as HDF5"}},
        {rate + "angle_arcsec,angle_increment_arcsec\n1,2\n", {":2:", "one of them"}},
        {rate + "angle_arcsec,angle_arcsec\n1,2\n", {":2:", "angle_arcsec is there twice"}},
        {rate + "angle_arcsec,accel_x,accel_x\n1,2,3\n", {"accel_x is there twice"}},
        {"time_s,direction,quarter_count,sin,cos\n0,1,2,3,4\n", {"columns of turns", "HDF5"}},
        {rate + "angle_arcsec,accel_x\n1,2\n3\n", {":4:", "1 column", "header has 2"}},
        {rate + "angle_arcsec,accel_x\n1,2\n3,4,5\n", {":4:", "3 columns", "header has 2"}},
        {rate + "angle_arcsec\n1\nx\n", {":4:", "angle_arcsec", "'x'"}},
        {rate + "angle_arcsec\n1\nnan\nnan\n", {"/samples/angle_arcsec, row 1", "2 of 3 samples are missing"}},
        {rate + "quarter_count\n1\nnan\n", {":4:", "'nan'", "whole number"}},
        {rate + "angle_arcsec\n(deg)\n1\n2\n", {":2:", "is declared to be in deg", "arcsec"}},
        {rate + "angle_arcsec\n1\n-inf\n", {":4:", "'-inf'"}},
        {rate + "angle_arcsec\n1\n1e999\n", {":4:", "1e999"}},
        {rate + "angle_arcsec,accel_x\n1,\n", {"/samples/accel_x, row 0", "1 of 1 samples are missing"}},
        {rate + "quarter_count,accel_x\n1,2\n,3\n", {":4:", "quarter_count", "is empty"}},
        {rate + "quarter_count\n1\n1.5\n", {":4:", "whole number"}},
        {rate + "quarter_count\n1\n1e30\n", {":4:", "whole number"}},
        {rate + rate + "angle_arcsec\n1\n", {":2:", "rate_hz is given twice"}},
        {"# rate_hz = fast\nangle_arcsec\n1\n", {":1:", "'fast'"}},
        {"# rate_hz = 0\nangle_arcsec\n1\n", {":1:", "positive"}},
        {"# rate_hz = nan\nangle_arcsec\n1\n", {":1:", "finite"}},
        {"# t0_s = \n" + rate + "angle_arcsec\n1\n", {":1:", "t0_s"}},
        {"# format = csv\n" + rate + "angle_arcsec\n1\n", {":1:", "'csv'", "rlg-record"}},
        {"# format_version = 7\n" + rate + "angle_arcsec\n1\n", {":1:", "version 1"}},
        {"# declared.clock_hz = 1 MHz\n" + rate + "angle_arcsec\n1\n", {":1:", "declared.clock_hz"}},
        {"# declared.clock_hz = -1\n" + rate + "angle_arcsec\n1\n", {"/declared", "clock_hz"}},
        {rate + std::string("angle_arcsec\n1\n\0\n", 17), {":4:", "zero byte"}},
        {std::string(5 << 20, 'x'), {"longer than"}},
    };
    for (const auto& [content, said] : faults) {
        const std::string file = text(content);
        EXPECT_THAT(refusal(file), HasSubstr(file));
        for (const std::string& part : said) EXPECT_THAT(refusal(file), HasSubstr(part)) << content.substr(0, 200);
    }
    EXPECT_THAT(refusal(path("none.csv")), HasSubstr("none.csv"));
    EXPECT_THAT(refusal(directory_.path().string()), HasSubstr("directory"));
}

TEST_F(RecordFile, RealDataAreRead) {
    const fs::path data = fs::path(RINGLOCK_SHARED_DATA) / "laser-gyro-triad-x.csv";
    if (!fs::exists(data)) GTEST_SKIP() << "no " << data << " on this machine";
    const Record r = read_record(data.string());
    EXPECT_EQ(r.samples->rate_hz, 100.0);
    EXPECT_EQ(r.samples->size(), r.samples->witnesses.at("accel_z").size());
    EXPECT_GT(r.samples->size(), 180'000U);
    EXPECT_TRUE(r.ignored.empty());
    write_record(path(), r);
    expect_equal(r, read_record(path()));
}

}  // namespace
}  // namespace record_file_test
}  // namespace ringlock::record
