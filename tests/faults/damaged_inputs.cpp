#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "engine/scenario/text/render.hpp"
#include "tests/faults/damage.hpp"
#include "tests/support/packed_text.hpp"
#include "tests/unit/result_support.hpp"

// Damaged files under the commands that make something of them or would write over them. A refusal leaves nothing.
namespace ringlock::test {
namespace damaged_inputs_test {
namespace {

namespace fs = std::filesystem;

/// A whole file, the name under which commands look for it, and these commands.
struct Input {
    std::string name;
    std::string bytes;
    std::vector<std::vector<std::string>> commands;
    std::vector<std::string> last = {};  ///< a long command, for a few that are read and all that are refused
};

class DamagedInputs : public DamageTest {
   protected:
    void SetUp() override {
        DamageTest::SetUp();
        scenario::Scenario scenario = small(true);
        scenario.ensemble.duration_s = 20.0;
        write("s.toml", scenario::to_toml(scenario));
        ASSERT_EQ(run({"run", "s.toml", "-q", "-o", "whole.h5"}).status, 0);
        for (const std::string number : {"1", "2"}) {
            ASSERT_EQ(run({"run", "s.toml", "-q", "--shard", number + "/2", "-o", "out.h5"}).status, 0);
            fs::rename(directory_ / ("out.h5.shard-" + number + "-of-2"), directory_ / ("shard-" + number));
        }
        write_record("whole-record.h5", 1100);
        write_table("table.h5");
        write_array("array.npy");
        write_archive("arrays.npz");
        write_matlab("log.mat");
        original_ = left();
    }

    std::vector<Input> inputs() const {
        std::vector<Input> all = {
            {"result.h5",
             read("whole.h5"),
             {{"status", "result.h5"},
              {"merge", "new.h5", "result.h5"},
              {"import", "result.h5", "-o", "new.h5"},
              {"analyze", "result.h5", "--dev", "mdev", "--tau", "2s", "--plot", "new.svg"},
              {"replay", "result.h5", "-q", "--arm", "uncompensated", "--gyro", "1", "-o", "new.h5"},
              {"closure", "-q", "result.h5"},
              {"record", "s.toml", "-o", "result.h5"},
              {"run", "s.toml", "-q", "-o", "result.h5", "--resume"},
              {"run", "s.toml", "-q", "-o", "result.h5"}}},
            {"out.h5.shard-1-of-2",
             read("shard-1"),
             {{"validate", "out.h5.shard-1-of-2"},
              {"status", "out.h5"},
              {"merge", "new.h5", "out.h5.shard-1-of-2", "shard-2"},
              {"run", "s.toml", "-q", "--shard", "1/2", "-o", "out.h5"}}},
            {"new.h5.parts/1.part",
             read("shard-1"),
             {{"status", "new.h5", "--json"}, {"run", "s.toml", "-q", "-o", "new.h5", "--resume"}}},
            {"record.h5",
             read("whole-record.h5"),
             {{"status", "record.h5"},
              {"import", "record.h5", "-o", "new.h5"},
              {"run", "s.toml", "-q", "-o", "record.h5"},
              {"record", "s.toml", "-o", "record.h5"}},
             {"closure", "-q", "record.h5"}},
            {"record.csv", csv_record(), {{"import", "record.csv", "-o", "new.h5"}}, {"closure", "-q", "record.csv"}},
            {"t.toml",
             read("s.toml"),
             {{"validate", "t.toml"},
              {"submit", "--slurm", "t.toml", "-o", "new.h5"},
              {"record", "t.toml", "-o", "new.h5"}}},
        };
        for (const char* name : {"table.h5", "array.npy", "arrays.npz", "log.mat"})
            all.push_back(log(name, read(name)));
        std::string text = "t,x\n";
        for (int i = 0; i < 150; ++i) text += std::to_string(i) + "," + std::to_string((7 * i) % 11) + "\n";
        all.push_back(log("log.csv", text));
        for (const Packer packer : {Packer::gzip, Packer::xz, Packer::zstd}) {
            all.push_back(log("packed.csv", packed(text, packer)));
        }
        return all;
    }

    /// \param closed  how many files of a kind that can be read are closed
    void damage(int bytes_each, int parts_each, int closed, std::uint64_t seed) {
        std::mt19937_64 random(seed);
        std::vector<Input> all = inputs();
        std::vector<int> left_to_close(all.size(), closed);
        for (int i = 0; i < bytes_each + parts_each; ++i) {
            for (std::size_t k = 0; k < all.size(); ++k) {
                const std::string& whole = all[k].bytes;
                const bool parts = i < parts_each;
                expect_answers(all[k], parts ? with_other_parts(whole, random) : with_other_bytes(whole, random),
                               (parts ? "other parts " : "other bytes ") + std::to_string(i), left_to_close[k]);
            }
        }
    }

   private:
    static Input log(const std::string& name, const std::string& bytes) {
        return {name,
                bytes,
                {{"import", name, "-o", "new.h5", "--column", "x=rate", "--unit", "deg/h", "--rate", "100"},
                 {"allan", name, "--column", "x", "--kind", "rate", "--unit", "deg/h", "--rate", "100", "--plot",
                  "new.svg"}}};
    }
    static std::string csv_record() {
        std::string text = "# rate_hz = 100\n# scale_factor_arcsec = 0.6\ntime_s,angle_increment_arcsec\n";
        for (int i = 0; i < 1100; ++i) {
            text += std::to_string(0.01 * i) + "," + std::to_string(0.01 * ((7919 * i) % 101 - 50)) + "\n";
        }
        return text;
    }

    void expect_answers(const Input& input, const std::string& bytes, const std::string& how, int& left_to_close) {
        bool is_read = true;
        for (const Arguments& arguments : input.commands)
            is_read = expect_answer(input, bytes, how, arguments) && is_read;
        if (input.last.empty() || (is_read && left_to_close-- <= 0)) return;
        expect_answer(input, bytes, how, input.last);
    }

    /// Whether the command got through.
    bool expect_answer(const Input& input, const std::string& bytes, const std::string& how,
                       const Arguments& arguments) {
        fs::create_directories((directory_ / input.name).parent_path());
        write(input.name, bytes);
        const std::set<std::string> before = left();
        static const std::set<std::string> computing = {"run", "replay", "closure", "record", "merge", "submit"};
        const bool computes = computing.count(arguments.front()) > 0;
        const std::string name = fs::path(input.name).filename().string();
        const Outcome r = expect_an_answer({arguments, name, bytes.size(), how, computes});
        if (r.status != 0) {
            EXPECT_EQ(left(), before) << how << ": " << arguments.front() << ": " << r.err;
        }
        for (const std::string& there : left()) {
            if (original_.count(there) == 0) fs::remove_all(directory_ / there);
        }
        return r.status == 0;
    }

    std::set<std::string> original_;
};

TEST_F(DamagedInputs, SomeOfEveryKindAreAnswered) { damage(0, 1, 0, 3); }

class LongDamagedInputs : public DamagedInputs {};

TEST_F(LongDamagedInputs, HundredsOfEveryKindAreAnswered) { damage(200, 100, 50, 4); }

}  // namespace
}  // namespace damaged_inputs_test
}  // namespace ringlock::test
