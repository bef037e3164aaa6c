#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>

#include "engine/core/error.hpp"
#include "engine/core/version.hpp"
#include "engine/store/provenance.hpp"
#include "tests/support/open_file.hpp"
#include "tests/support/temporary_directory.hpp"

namespace ringlock::store {
namespace store_provenance_test {
namespace {

TEST(StoreProvenance, SaysWhatRanWhereAndWhen) {
    const std::array arguments{"ringlock", "run", "my scenario's.toml"};
    const Provenance p = collect_provenance(arguments, 8, "my scenario's.toml");
    EXPECT_EQ(p.command_line, "ringlock run 'my scenario'\\''s.toml'");
    EXPECT_EQ(p.program_version, version());
    EXPECT_EQ(p.git_hash, git_hash());
    EXPECT_EQ(p.threads, 8);
    EXPECT_FALSE(p.host.empty());
    EXPECT_THAT(p.date_utc,
                testing::MatchesRegex("20[0-9][0-9]-[01][0-9]-[0-3][0-9]T[0-2][0-9]:[0-5][0-9]:[0-6][0-9]Z"));
}

TEST(StoreProvenance, ComesBackFromAFile) {
    const test::TemporaryDirectory directory;
    const std::array arguments{"ringlock"};
    Provenance written = collect_provenance(arguments, 2, "a.toml");
    written.wall_s = 1.5;
    written.turns_per_s = 2e7;
    written.instruction_set = "AVX2";
    File file = File::create(directory / "a.h5");
    write_provenance(file, written);
    file.close();
    const Provenance read = read_provenance(test::open_file(directory / "a.h5"));
    EXPECT_EQ(read.program_version, written.program_version);
    EXPECT_EQ(read.git_hash, written.git_hash);
    EXPECT_EQ(read.compiler, written.compiler);
    EXPECT_EQ(read.hdf5_version, written.hdf5_version);
    EXPECT_EQ(read.command_line, "ringlock");
    EXPECT_EQ(read.scenario_file, "a.toml");
    EXPECT_EQ(read.host, written.host);
    EXPECT_EQ(read.date_utc, written.date_utc);
    EXPECT_EQ(read.threads, 2);
    EXPECT_EQ(read.wall_s, 1.5);
    EXPECT_EQ(read.turns_per_s, 2e7);
    EXPECT_EQ(read.instruction_set, "AVX2");
}

TEST(StoreProvenance, OfAnEarlierProgramIsReadAsItIs) {
    const test::TemporaryDirectory directory;
    File file = File::create(directory / "a.h5");
    Group group = file.create_group("provenance");
    for (const char* text : {"program_version", "git_hash", "compiler", "hdf5_version", "command_line", "scenario_file",
                             "host", "date_utc"}) {
        group.set_attribute(text, std::string_view(text));
    }
    group.set_attribute("threads", 2);
    EXPECT_THROW(read_provenance(file), InputError) << "wall_s is missing, which every program wrote";
    group.set_attribute("wall_s", 1.5);
    const Provenance read = read_provenance(file);
    EXPECT_EQ(read.host, "host");
    EXPECT_EQ(read.threads, 2);
    EXPECT_EQ(read.turns_per_s, 0.0);
    EXPECT_EQ(read.instruction_set, "");
}

TEST(StoreProvenance, AFileWithoutIsRefused) {
    const test::TemporaryDirectory directory;
    File::create(directory / "a.h5").close();
    EXPECT_THROW(read_provenance(test::open_file(directory / "a.h5")), InputError);
}

}  // namespace
}  // namespace store_provenance_test
}  // namespace ringlock::store
