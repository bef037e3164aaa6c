#include <gmock/gmock.h>
#include <unistd.h>

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "analysis/parts/block_record.hpp"
#include "analysis/parts/checkpoints.hpp"
#include "analysis/parts/folder.hpp"
#include "analysis/parts/manifest.hpp"
#include "analysis/study/experiment.hpp"
#include "engine/core/error.hpp"
#include "tests/support/expect_throw.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/unit/result_support.hpp"

namespace ringlock::parts {
namespace parts_folder_test {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

class RunFolder : public testing::Test {
   protected:
    static scenario::Scenario scenario() {
        scenario::Scenario s = test::small(true);
        s.ensemble.gyros = 40;
        s.ensemble.duration_s = 20.0;
        return s;
    }
    Folder folder(Beginning beginning = Beginning::refuse) { return folder(beginning, scenario()); }
    Folder folder(Beginning beginning, const scenario::Scenario& of) {
        return {out_, manifest_of(of, {}), beginning, [this](const std::string& line) { told_.push_back(line); }};
    }
    Checkpoints::Options options(double every_s) const {
        Checkpoints::Options options;
        options.every_s = every_s;
        return options;
    }
    /// Simulates the first gyros and leaves them in the folder.
    void leave_gyros(std::int64_t gyros, const scenario::Scenario& of) {
        Folder here = folder(Beginning::refuse, of);
        study::Experiment plan(of);
        Checkpoints checkpoints(here, plan, options(0.0), [](const auto&) {});
        const study::Stretch some{0, 0, gyros};
        study::run(
            plan.points, {&some, 1}, 1,
            [&](std::size_t point, std::int64_t first, std::size_t n) { return checkpoints.keeper(point, first, n); },
            {});
    }
    std::vector<study::Stretch> missing(const scenario::Scenario& of) {
        Folder here = folder(Beginning::resume, of);
        study::Experiment plan(of);
        Checkpoints checkpoints(here, plan, options(30.0), [this](const auto& line) { told_.push_back(line); });
        return checkpoints.take_up(plan.points, 0, std::numeric_limits<std::int64_t>::max());
    }

    test::TemporaryDirectory directory_;
    fs::path out_ = directory_ / "out.h5";
    fs::path path_ = directory_ / "out.h5.parts";
    std::vector<std::string> told_;
};

TEST_F(RunFolder, GoesWhereItHoldsNothing) {
    {
        const Folder here = folder();
        EXPECT_TRUE(fs::is_directory(path_));
        EXPECT_THAT(holder(path_), HasSubstr("process " + std::to_string(getpid()) + " on "));
    }
    EXPECT_FALSE(fs::exists(path_));
    EXPECT_EQ(holder(path_), "");
}

TEST_F(RunFolder, BelongsToOneAtATime) {
    const Folder first = folder();
    for (const Beginning beginning : {Beginning::refuse, Beginning::resume, Beginning::discard}) {
        EXPECT_THAT(test::message_of<InputError>([&] { folder(beginning); }),
                    AllOf(HasSubstr(out_.string()), HasSubstr("process " + std::to_string(getpid()))));
    }
    EXPECT_TRUE(fs::is_directory(path_));
}

TEST_F(RunFolder, IsTheSameForALinkToTheOutput) {
    fs::create_symlink(out_, directory_ / "link.h5");
    const Folder first = folder();
    EXPECT_THROW(Folder(directory_ / "link.h5", manifest_of(scenario(), {}), Beginning::refuse, [](const auto&) {}),
                 InputError);
}

TEST_F(RunFolder, KeepsFinishedGyrosUnlessTheyAreDiscarded) {
    leave_gyros(16, scenario());
    EXPECT_THAT(test::message_of<InputError>([&] { folder(); }),
                AllOf(HasSubstr(path_.string()), HasSubstr("--resume"), HasSubstr("--discard")));
    EXPECT_THAT(missing(scenario()), ElementsAre(study::Stretch{0, 16, 40}));
    EXPECT_THAT(part_files(path_), testing::Not(IsEmpty()));
    { const Folder here = folder(Beginning::discard); }
    EXPECT_FALSE(fs::exists(path_));
}

TEST_F(RunFolder, OfAnotherRunIsRefusedWithTheDifferences) {
    leave_gyros(16, scenario());
    scenario::Scenario other = scenario();
    other.ensemble.seed = 123;
    other.gyro.lockin_threshold_deg_h = 250.0;
    EXPECT_THAT(test::message_of<InputError>([&] { folder(Beginning::resume, other); }),
                AllOf(HasSubstr("ensemble.seed: 5 before, 123 now"), HasSubstr("gyro.lockin_threshold_deg_h")));
    EXPECT_THAT(missing(scenario()), ElementsAre(study::Stretch{0, 16, 40}));
}

TEST_F(RunFolder, PutsDamagedFilesAsideAndAsksForTheirGyrosAgain) {
    leave_gyros(40, scenario());
    const std::vector<fs::path> files = part_files(path_);
    ASSERT_EQ(files.size(), 3U);
    fs::resize_file(files[0], fs::file_size(files[0]) - 1);
    {
        std::fstream file(files[2], std::ios::binary | std::ios::in | std::ios::out);
        file.seekp(static_cast<std::streamoff>(fs::file_size(files[2]) / 2));
        file.put('\x55');
    }
    std::int64_t gyros = 0;
    for (const study::Stretch& stretch : missing(scenario())) gyros += stretch.last - stretch.first;
    EXPECT_GE(gyros, 16);
    EXPECT_THAT(told_, ElementsAre(AllOf(HasSubstr("is damaged"), HasSubstr(files[0].filename().string())),
                                   AllOf(HasSubstr("is damaged"), HasSubstr(files[2].filename().string()))));
    EXPECT_TRUE(fs::exists(files[0].string() + ".damaged"));
    EXPECT_TRUE(fs::exists(files[1]));
}

TEST_F(RunFolder, ClearsWhatWasBeingWritten) {
    leave_gyros(16, scenario());
    const fs::path partial = path_ / "000009.part.partial";
    std::ofstream(partial) << "half";
    EXPECT_THAT(missing(scenario()), ElementsAre(study::Stretch{0, 16, 40}));
    EXPECT_FALSE(fs::exists(partial));
    EXPECT_THAT(told_, ElementsAre(HasSubstr(partial.string())));
}

TEST_F(RunFolder, OfThatNameThatIsNoneIsKept) {
    fs::create_directory(path_);
    std::ofstream(path_ / "letter.txt") << "mine";
    for (const Beginning beginning : {Beginning::refuse, Beginning::resume, Beginning::discard}) {
        EXPECT_THAT(test::message_of<InputError>([&] { folder(beginning); }), HasSubstr("not a folder of a run"));
    }
    EXPECT_TRUE(fs::exists(path_ / "letter.txt"));
    fs::remove_all(path_);
    std::ofstream(path_) << "a file";
    EXPECT_THROW(folder(), InputError);
    EXPECT_TRUE(fs::is_regular_file(path_));
}

TEST_F(RunFolder, AFileThatSomebodyPutsThereStaysAndTheFolderWithIt) {
    {
        Folder here = folder();
        std::ofstream(path_ / "letter.txt") << "mine";
        here.remove();
    }
    EXPECT_TRUE(fs::exists(path_ / "letter.txt"));
}

TEST_F(RunFolder, SamplesComeBackWithTheirBlocks) {
    const auto collect = [](const auto& each) {
        std::vector<double> sum;
        each([&](const study::SampledAngles& samples) {
            for (const double angle : samples.angle_arcsec) sum.push_back(angle);
        });
        std::sort(sum.begin(), sum.end());
        return sum;
    };
    leave_gyros(40, scenario());
    Folder here = folder(Beginning::resume);
    study::Experiment plan(scenario());
    Checkpoints checkpoints(here, plan, options(30.0), [](const auto&) {});
    EXPECT_THAT(checkpoints.take_up(plan.points, 0, 40), IsEmpty());
    const auto kept = collect([&](const study::OnSamples& on) { checkpoints.finished().each_samples(on); });
    const auto straight =
        collect([&](const study::OnSamples& on) { study::run(study::Experiment(scenario()), 1, on); });
    EXPECT_EQ(kept, straight);
}

}  // namespace
}  // namespace parts_folder_test
}  // namespace ringlock::parts
