#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>
#include <string>
#include <vector>

#include "tests/faults/damage.hpp"
#include "tests/unit/result_support.hpp"

// Files of every kind with bytes changed and parts cut off, doubled, emptied or lengthened: the commands that only read
// say something about each of them, and neither crash nor hang nor take memory that the file does not explain.
namespace ringlock::test {
namespace damaged_files_test {
namespace {

/// A whole file and the commands that read it.
struct Sample {
    std::string name;
    std::string bytes;
    std::vector<std::vector<std::string>> commands;  ///< the name of the file goes behind the first word
};

class DamagedFiles : public DamageTest {
   protected:
    std::vector<Sample> samples() const {
        const std::vector<std::string> allan = {"allan", "--rate", "100", "--kind", "increment", "--column", "x"};
        test::write(directory_ / "result.h5", small(false));
        write_record("record.h5", 200);
        write_table("table.h5");
        write_array("array.npy");
        write_matlab("log.mat");
        return {{"result.h5", read("result.h5"), {{"validate"}, {"analyze", "--json"}}},
                {"record.h5", read("record.h5"), {{"validate"}}},
                {"table.h5", read("table.h5"), {allan}},
                {"array.npy", read("array.npy"), {allan}},
                {"log.mat", read("log.mat"), {allan}}};
    }

    void expect_answers(const Sample& sample, const std::string& bytes, const std::string& how) {
        const std::string name = "bad-" + sample.name;
        write(name, bytes);
        for (const std::vector<std::string>& command : sample.commands) {
            Arguments arguments = command;
            arguments.insert(arguments.begin() + 1, name);
            const Outcome r = expect_an_answer({arguments, name, bytes.size(), how});
            if (bytes == sample.bytes) {
                EXPECT_EQ(r.status, 0) << sample.name << ": " << r.err;
            }
        }
    }

    void damage(int bytes_each, int parts_each, std::uint64_t seed) {
        std::mt19937_64 random(seed);
        for (const Sample& sample : samples()) {
            ASSERT_GT(sample.bytes.size(), 800U) << sample.name;
            expect_answers(sample, sample.bytes, "whole");
            for (int i = 0; i < bytes_each; ++i) {
                expect_answers(sample, with_other_bytes(sample.bytes, random), "other bytes " + std::to_string(i));
            }
            for (int i = 0; i < parts_each; ++i) {
                expect_answers(sample, with_other_parts(sample.bytes, random), "other parts " + std::to_string(i));
            }
        }
    }
};

TEST_F(DamagedFiles, SomeOfEveryKindAreAnswered) { damage(6, 3, 1); }

class LongDamagedFiles : public DamagedFiles {};

TEST_F(LongDamagedFiles, ThousandsOfEveryKindAreAnswered) { damage(400, 200, 2); }

}  // namespace
}  // namespace damaged_files_test
}  // namespace ringlock::test
