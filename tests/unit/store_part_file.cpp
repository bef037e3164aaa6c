#include <gmock/gmock.h>

#include <cerrno>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "engine/core/error.hpp"
#include "engine/store/part_file.hpp"
#include "tests/support/expect_throw.hpp"
#include "tests/support/temporary_directory.hpp"

namespace ringlock::store {
namespace store_part_file_test {
namespace {

namespace fs = std::filesystem;
using Records = std::vector<std::pair<RecordKind, std::string>>;

void give_up(const std::string& problem, int) { throw RunError(problem); }

void write(const fs::path& path, const Records& records) {
    PartWriter writer(path, PartWriter::Open::new_file, give_up);
    for (const auto& [kind, content] : records) writer.add(kind, std::as_bytes(std::span(content)));
    writer.close();
}

Records read(const fs::path& path) {
    Records records;
    read_part(path, [&](RecordKind kind, std::span<const std::byte> content) {
        records.emplace_back(kind, std::string(reinterpret_cast<const char*>(content.data()), content.size()));
        return true;
    });
    return records;
}

std::string bytes(const fs::path& path) {
    std::ifstream in(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
}

void put(const fs::path& path, const std::string& content) { std::ofstream(path, std::ios::binary) << content; }

class PartFile : public testing::Test {
   protected:
    test::TemporaryDirectory directory_;
    fs::path path_ = directory_ / "a.part";
    const Records records_ = {{1, "first"}, {2, ""}, {7, std::string(5000, 'x')}, {2, "last"}};
};

TEST_F(PartFile, GivesBackItsRecordsInTheirOrder) {
    write(path_, records_);
    EXPECT_EQ(read(path_), records_);
    EXPECT_TRUE(is_part(path_));
    EXPECT_NO_THROW(check_part(path_));
}

TEST_F(PartFile, MayHoldNoRecordAtAll) {
    write(path_, {});
    EXPECT_EQ(read(path_), Records{});
}

TEST_F(PartFile, HoldsMoreThanItsBuffer) {
    const Records large(5, {3, std::string(700'000, 'y')});
    write(path_, large);
    EXPECT_EQ(read(path_), large);
}

TEST_F(PartFile, ReadingEndsWhenNoMoreIsWanted) {
    write(path_, records_);
    int seen = 0;
    read_part(path_, [&](RecordKind, std::span<const std::byte>) { return ++seen < 2; });
    EXPECT_EQ(seen, 2);
}

TEST_F(PartFile, CutOffAnywhereIsToldFromWhole) {
    write(path_, {{1, "first"}, {2, "second"}});
    const std::string whole = bytes(path_);
    for (std::size_t length = 0; length < whole.size(); ++length) {
        put(path_, whole.substr(0, length));
        EXPECT_THROW(check_part(path_), InputError) << length << " of " << whole.size() << " bytes";
    }
}

TEST_F(PartFile, AnyBitThatChangedIsToldFromWhole) {
    write(path_, {{1, "first"}, {2, "second"}});
    const std::string whole = bytes(path_);
    for (std::size_t bit = 0; bit < 8 * whole.size(); ++bit) {
        std::string changed = whole;
        changed[bit / 8] = static_cast<char>(changed[bit / 8] ^ (1 << (bit % 8)));
        put(path_, changed);
        EXPECT_THROW(check_part(path_), InputError) << "bit " << bit;
    }
}

TEST_F(PartFile, WhatFollowsItsEndIsDamage) {
    write(path_, records_);
    put(path_, bytes(path_) + "z");
    EXPECT_THAT(test::message_of<InputError>([&] { check_part(path_); }), testing::HasSubstr("goes on after its end"));
}

TEST_F(PartFile, OtherFilesAreNone) {
    put(path_, "something else, longer than eight bytes");
    EXPECT_FALSE(is_part(path_));
    EXPECT_THAT(test::message_of<InputError>([&] { check_part(path_); }), testing::HasSubstr(path_.string()));
    EXPECT_FALSE(is_part(directory_ / "missing"));
    EXPECT_THROW(check_part(directory_ / "missing"), InputError);
    EXPECT_FALSE(is_part(directory_.path()));
    EXPECT_THROW(check_part(directory_.path()), InputError);
}

TEST_F(PartFile, ARefusalIsToldAndTheSameTriedAgain) {
    const fs::path folder = directory_ / "later";
    int refusals = 0;
    PartWriter writer(folder / "a.part", PartWriter::Open::new_file, [&](const std::string& problem, int error) {
        EXPECT_EQ(error, ENOENT);
        EXPECT_THAT(problem, testing::HasSubstr((folder / "a.part").string()));
        if (++refusals == 3) fs::create_directory(folder);
    });
    writer.add(1, {});
    writer.close();
    EXPECT_EQ(refusals, 3);
    EXPECT_EQ(read(folder / "a.part"), (Records{{1, ""}}));
}

TEST_F(PartFile, NewFilesReplaceNothingAndFollowNoLink) {
    put(path_, "kept");
    EXPECT_THROW(PartWriter(path_, PartWriter::Open::new_file, give_up), RunError);
    const fs::path link = directory_ / "link";
    fs::create_symlink(directory_ / "elsewhere", link);
    EXPECT_THROW(PartWriter(link, PartWriter::Open::new_file, give_up), RunError);
    EXPECT_EQ(bytes(path_), "kept");
    EXPECT_FALSE(fs::exists(directory_ / "elsewhere"));
}

TEST_F(PartFile, RecordsOfTheKindOfTheEndAreAMistake) {
    PartWriter writer(path_, PartWriter::Open::new_file, give_up);
    EXPECT_THROW(writer.add(0, {}), std::invalid_argument);
}

}  // namespace
}  // namespace store_part_file_test
}  // namespace ringlock::store
