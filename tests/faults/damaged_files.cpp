#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hdf5.h>
#include <sys/resource.h>
#include <sys/wait.h>

#include <cmath>
#include <cstdint>
#include <cstring>
#include <random>
#include <string>
#include <vector>

#include "analysis/record/record.hpp"
#include "tests/cli/program.hpp"
#include "tests/support/array_files.hpp"
#include "tests/unit/result_support.hpp"

// Files of every kind with bytes changed and parts cut off, doubled, emptied or lengthened: the program says something
// about each of them, and neither crashes nor hangs nor takes memory that the file does not explain.
namespace ringlock::test {
namespace {

using testing::HasSubstr;
using testing::Not;

/// A whole file and the commands that read it.
struct Sample {
    std::string name;
    std::string bytes;
    std::vector<std::vector<std::string>> commands;  ///< the name of the file goes behind the first word
};

class DamagedFiles : public ProgramTest {
   protected:
    std::vector<Sample> samples() const {
        const std::vector<std::string> allan = {"allan", "--rate", "100", "--kind", "increment"};
        const auto column = [&](const std::string& name) {
            std::vector<std::string> words = allan;
            words.insert(words.end(), {"--column", name});
            return words;
        };
        test::write(directory_ / "result.h5", small(false));
        write_a_record();
        write_a_table();
        std::vector<double> x;
        for (int i = 0; i < 300; ++i) x.push_back(std::sin(1.0 * i));
        write("array.npy", npy(npy_dictionary("[('t', '<f8'), ('x', '<f8')]", "(150,)"), bytes_of(x)));
        MatWriter((directory_ / "log.mat").string()).add<double>("x", MAT_C_DOUBLE, MAT_T_DOUBLE, 300, 1, x, true);
        return {{"result.h5", read("result.h5"), {{"validate"}, {"analyze", "--json"}}},
                {"record.h5", read("record.h5"), {{"validate"}}},
                {"table.h5", read("table.h5"), {column("x")}},
                {"array.npy", read("array.npy"), {column("x")}},
                {"log.mat", read("log.mat"), {column("x")}}};
    }

    /// What the program says about the damaged file.
    void expect_an_answer(const Sample& sample, const std::string& bytes, const std::string& how) {
        write("bad-" + sample.name, bytes);
        for (const std::vector<std::string>& command : sample.commands) {
            Arguments arguments = command;
            arguments.insert(arguments.begin() + 1, "bad-" + sample.name);
            rusage used{};
            const Outcome r = limited(arguments, used);
            const std::string what = how + ", " + arguments.front() + " of " + sample.name;
            EXPECT_EQ(r.signal, 0) << what;
            EXPECT_THAT(r.status, testing::AnyOf(0, 1, 2)) << what;
            if (r.status != 0) {
                EXPECT_THAT(r.err, HasSubstr("bad-" + sample.name)) << what;
            }
            if (bytes == sample.bytes) {
                EXPECT_EQ(r.status, 0) << what << ": " << r.err;
            }
            for (const char c : r.out + r.err) {
                EXPECT_TRUE(static_cast<unsigned char>(c) >= 0x20 || c == '\n' || c == '\t') << what;
            }
            EXPECT_THAT(r.out, Not(HasSubstr("-nan"))) << what;
#ifndef __SANITIZE_ADDRESS__
            const double allowed_kb = 200e3 + 60e3 + static_cast<double>(bytes.size()) * 1e-3;  // 60 MB: the program
            EXPECT_LT(static_cast<double>(used.ru_maxrss), allowed_kb) << what;
#endif
        }
    }

    /// One of many ways in which a byte can be wrong.
    static std::string with_other_bytes(const std::string& whole, std::mt19937_64& random) {
        std::string bad = whole;
        for (std::uint64_t n = 1 + random() % 3; n > 0; --n) bad[random() % bad.size()] = static_cast<char>(random());
        return bad;
    }
    /// One of many ways in which the parts of a file can be wrong.
    static std::string with_other_parts(const std::string& whole, std::mt19937_64& random) {
        const std::size_t at = random() % whole.size();
        const std::size_t length = std::min<std::size_t>(8 + random() % 500, whole.size() - at);
        std::string bad = whole;
        switch (random() % 4) {
            case 0:
                return whole.substr(0, at);
            case 1:
                return bad.insert(at, whole.substr(at, length));
            case 2:
                std::fill_n(bad.begin() + static_cast<std::ptrdiff_t>(at), length, '\0');
                return bad;
            default:
                break;
        }
        // A length or a size in a head: eight bytes at a multiple of four, most of them near the front.
        const std::uint64_t values[] = {0, 1, ~std::uint64_t{0}, std::uint64_t{1} << 31, std::uint64_t{1} << 40, 4096};
        const std::uint64_t value = values[random() % std::size(values)];
        const std::size_t place = std::min<std::size_t>(random() % (random() % 2 == 0 ? 800 : whole.size()) / 4 * 4,
                                                        whole.size() - sizeof value);
        std::memcpy(&bad[place], &value, sizeof value);
        return bad;
    }

    void damage(int bytes_each, int parts_each, std::uint64_t seed) {
        std::mt19937_64 random(seed);
        for (const Sample& sample : samples()) {
            ASSERT_GT(sample.bytes.size(), 800U) << sample.name;
            expect_an_answer(sample, sample.bytes, "whole");
            for (int i = 0; i < bytes_each; ++i) {
                expect_an_answer(sample, with_other_bytes(sample.bytes, random), "other bytes " + std::to_string(i));
            }
            for (int i = 0; i < parts_each; ++i) {
                expect_an_answer(sample, with_other_parts(sample.bytes, random), "other parts " + std::to_string(i));
            }
        }
    }

   private:
    Outcome limited(const Arguments& arguments, rusage& used) const {
        const pid_t child = start(arguments, [] {
            constexpr rlim_t most_s = 10;
            const rlimit processor{most_s, most_s};
            setrlimit(RLIMIT_CPU, &processor);
            alarm(120);  // a wait without end
        });
        int raw = 0;
        wait4(child, &raw, 0, &used);
        Outcome outcome;
        if (WIFEXITED(raw)) outcome.status = WEXITSTATUS(raw);
        if (WIFSIGNALED(raw)) outcome.signal = WTERMSIG(raw);
        outcome.out = contents(streams_ / "out");
        outcome.err = contents(streams_ / "err");
        return outcome;
    }

    void write_a_record() const {
        record::Record record;
        record.title = "a short one";
        record.declared.scale_factor_arcsec = 0.6;
        record::Samples& samples = record.samples.emplace();
        samples.rate_hz = 100.0;
        samples.kind = record::SampleKind::angle_increment_arcsec;
        for (int i = 0; i < 200; ++i) samples.values.push_back(std::cos(1.0 * i));
        record::write_record((directory_ / "record.h5").string(), record);
    }
    void write_a_table() const {
        struct Row {
            double t;
            double x;
        };
        std::vector<Row> rows;
        for (int i = 0; i < 200; ++i) rows.push_back({0.01 * i, std::sin(1.0 * i)});
        const hid_t type = H5Tcreate(H5T_COMPOUND, sizeof(Row));
        H5Tinsert(type, "t", HOFFSET(Row, t), H5T_NATIVE_DOUBLE);
        H5Tinsert(type, "x", HOFFSET(Row, x), H5T_NATIVE_DOUBLE);
        const hid_t h5 = H5Fcreate((directory_ / "table.h5").c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
        const hsize_t size = rows.size();
        const hsize_t chunk = 50;
        const hid_t creation = H5Pcreate(H5P_DATASET_CREATE);
        H5Pset_chunk(creation, 1, &chunk);
        H5Pset_deflate(creation, 1);
        const hid_t space = H5Screate_simple(1, &size, nullptr);
        const hid_t dataset = H5Dcreate2(h5, "imu", type, space, H5P_DEFAULT, creation, H5P_DEFAULT);
        H5Dwrite(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, rows.data());
        H5Dclose(dataset);
        H5Sclose(space);
        H5Pclose(creation);
        H5Tclose(type);
        H5Fclose(h5);
    }
};

TEST_F(DamagedFiles, SomeOfEveryKindAreAnswered) { damage(12, 6, 1); }

class LongDamagedFiles : public DamagedFiles {};

TEST_F(LongDamagedFiles, ThousandsOfEveryKindAreAnswered) { damage(400, 200, 2); }

}  // namespace
}  // namespace ringlock::test
