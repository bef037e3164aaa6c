#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hdf5.h>

#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "tests/faults/damage.hpp"
#include "tests/support/array_files.hpp"
#include "tests/support/packed_text.hpp"

// Faults that the head or the first part of a file shows: they are refused in memory that has nothing to do with what
// the head claims, or with how much follows. None of them takes a second of the processor.
namespace ringlock::test {
namespace refusals_test {
namespace {

using testing::AllOf;
using testing::HasSubstr;

class Refusals : public DamageTest {
   protected:
    void expect_refused(const std::string& name, std::size_t bytes, const testing::Matcher<std::string>& message,
                        const Arguments& more = {}) const {
        Arguments arguments = {"allan", name, "--rate", "100", "--kind", "rate", "--unit", "deg/h"};
        arguments.insert(arguments.end(), more.begin(), more.end());
        Attempt attempt{arguments, name, bytes, "refused by its head"};
        attempt.memory_mb = 100.0;
        attempt.processor_s = 1;
        const Outcome r = expect_an_answer(attempt);
        EXPECT_EQ(r.status, 2) << r.out;
        EXPECT_THAT(r.err, message);
    }
    void expect_refused(const std::string& name, const testing::Matcher<std::string>& message,
                        const Arguments& more = {}) const {
        expect_refused(name, std::filesystem::file_size(directory_ / name), message, more);
    }
};

TEST_F(Refusals, AnEarlyFaultOfALongTextIsFoundAtOnce) {
    std::string text = "t,x\n";
    for (int i = 0; i < 10; ++i) text += std::to_string(i) + ",1\n";
    text += "10,seven\n";
    while (text.size() < 10'000'000) text += text.size() % 2 == 0 ? "11,1.5\n" : "12,0.25\n";
    write("log.csv", text);
    const auto message = AllOf(HasSubstr(":12: column x: 'seven'"));
    expect_refused("log.csv", message, {"--column", "x"});
    for (const auto& [name, packer] : {std::pair{"log.csv.gz", Packer::gzip}, std::pair{"log.csv.zst", Packer::zstd}}) {
        write(name, packed(text, packer));
        expect_refused(name, text.size(), message, {"--column", "x"});
    }
    write("log.csv.xz", packed(text.substr(0, 2'000'000), Packer::xz));
    expect_refused("log.csv.xz", message, {"--column", "x"});
}

TEST_F(Refusals, StampsInAnotherUnitAreFoundAtOnce) {
    std::string text = "t,x\n";
    for (std::int64_t i = 0; i < 60; ++i) text += std::to_string(1403636579758555392 + i * 10000000) + ",1\n";
    write("log.csv", text);
    expect_refused("log.csv", HasSubstr("log.csv:3: column t"), {"--column", "x", "--time", "t"});
}

TEST_F(Refusals, WindowsOfDecodersAreBounded) {
    const std::string text = "t,x\n0,1\n1,2\n";
    write("log.csv.xz", packed_with_window(text, Packer::xz, 30));
    expect_refused("log.csv.xz", HasSubstr("more than 64 MB at a time"));
    // A frame with a window of 2 GB, and one that is its own window (RFC 8878, 3.1.1.1).
    write("log.csv.zst", std::string("\x28\xb5\x2f\xfd\x00\xa8\x01\x00\x00", 9));
    expect_refused("log.csv.zst", HasSubstr("more than 64 MB at a time"));
    write("log.csv.zst", std::string("\x28\xb5\x2f\xfd\xa0\x00\x00\x00\x80\x01\x00\x00", 12));
    expect_refused("log.csv.zst", HasSubstr("more than 64 MB at a time"));
}

TEST_F(Refusals, WhatAHeadClaimsTakesNoMemory) {
    const std::string head = npy_dictionary("'<f8'", "(1000000000000,)");
    write("array.npy", npy(head, std::string(800, '\0')));
    expect_refused("array.npy", HasSubstr("take 8000000000000 bytes"));
    write_zip((directory_ / "arrays.npz").string(), {{"x.npy", npy(head, std::string(800, '\0'))}});
    expect_refused("arrays.npz", HasSubstr("take 8000000000000 bytes"));
    for (const bool packed : {false, true}) {
        const std::string path = (directory_ / "log.h5").string();
        const hid_t file = H5Fcreate(path.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
        const hsize_t size = 1'000'000'000'000;
        const hsize_t chunk = 1000;
        const hid_t space = H5Screate_simple(1, &size, nullptr);
        const hid_t creation = H5Pcreate(H5P_DATASET_CREATE);
        if (packed) {
            H5Pset_chunk(creation, 1, &chunk);
            H5Pset_deflate(creation, 1);
        } else {
            H5Pset_alloc_time(creation, H5D_ALLOC_TIME_LATE);
        }
        const hid_t set = H5Dcreate2(file, "x", H5T_NATIVE_DOUBLE, space, H5P_DEFAULT, creation, H5P_DEFAULT);
        H5Dclose(set);
        H5Pclose(creation);
        H5Sclose(space);
        H5Fclose(file);
        expect_refused("log.h5", HasSubstr("log.h5: dataset /x"));
    }
}

TEST_F(Refusals, AScenarioOfUnknownKeysIsRefusedEarly) {
    std::string text;
    for (int i = 0; i < 300000; ++i) text += "key_" + std::to_string(i) + " = 1\n";
    write("keys.toml", text);
    Attempt attempt{{"validate", "keys.toml"}, "keys.toml", text.size(), "300000 keys"};
    attempt.memory_mb = 100.0;
    attempt.processor_s = 1;
    const Outcome r = expect_an_answer(attempt);
    EXPECT_EQ(r.status, 2);
    EXPECT_THAT(r.err, HasSubstr("keys.toml:20001:11: more than 20000 keys and sections"));
}

}  // namespace
}  // namespace refusals_test
}  // namespace ringlock::test
