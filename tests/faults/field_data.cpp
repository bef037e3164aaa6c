// Logs of the field that are damaged, or would take more than there is.
#include <gmock/gmock.h>
#include <sys/resource.h>

#include <cstdint>
#include <string>

#include "tests/cli/program.hpp"
#include "tests/support/packed_text.hpp"

namespace ringlock::test {
namespace field_data_test {
namespace {

using testing::AllOf;
using testing::HasSubstr;

class FieldData : public ProgramTest {
   protected:
    void expect_refused(const Arguments& arguments, const testing::Matcher<std::string>& message) const {
        const auto before = left();
        // What is left out is never made, so that little memory does.
        const Outcome r = run(arguments, [] {
            const rlimit little{std::uint64_t{1} << 30, std::uint64_t{1} << 30};
            setrlimit(RLIMIT_AS, &little);
        });
        EXPECT_EQ(r.status, 2) << r.err;
        EXPECT_EQ(r.out, "");
        EXPECT_THAT(r.err, message);
        EXPECT_EQ(left(), before);
    }
    static std::string stamped(std::size_t rows, std::int64_t first, std::int64_t step) {
        std::string text = "t,gx\n";
        for (std::size_t i = 0; i < rows; ++i) {
            text += std::to_string(first + static_cast<std::int64_t>(i) * step) + "," + std::to_string(i % 7) + "\n";
        }
        return text;
    }
    const Arguments allan_{"allan", "log.csv", "--rate", "200", "--kind", "rate", "--column", "gx"};
    Arguments with(Arguments more) const {
        Arguments all = allan_;
        all.insert(all.end(), more.begin(), more.end());
        return all;
    }
};

TEST_F(FieldData, StampsInAnotherUnitTakeNoMemory) {
    write("log.csv", stamped(100000, 1403636579758555392, 5000000));
    expect_refused(with({"--time", "t"}), AllOf(HasSubstr("log.csv:3: column t"), HasSubstr("say --time-unit ns")));
    // No unit fits: the first step is a gap beyond reason.
    write("log.csv", stamped(100000, 1403636579758555392, 7777777));
    expect_refused(with({"--time", "t"}), AllOf(HasSubstr("log.csv:3: column t"), HasSubstr("samples out")));
    expect_refused(
        {"import", "log.csv", "-o", "log.h5", "--column", "gx=rate", "--unit", "deg/s", "--rate", "200", "--time", "t"},
        HasSubstr("samples out"));
    write("r.csv", "# rate_hz = 200\ntime_s,angle_arcsec\n0,1\n0.005,2\n1e15,3\n");
    expect_refused({"validate", "r.csv"}, AllOf(HasSubstr("r.csv:5: column time_s"), HasSubstr("samples out")));
}

TEST_F(FieldData, DamageOfPackedTextIsNamed) {
    const std::string text = stamped(50000, 0, 1);
    for (const Packer packer : {Packer::gzip, Packer::xz, Packer::zstd}) {
        const std::string bytes = packed(text, packer);
        write("log.csv", bytes.substr(0, bytes.size() / 2));
        expect_refused(allan_, AllOf(HasSubstr("log.csv: is packed with"), HasSubstr("ends too early")));
        write("log.csv", bytes + bytes.substr(bytes.size() / 2));
        expect_refused(allan_, AllOf(HasSubstr("log.csv: is packed with"), HasSubstr("damaged")));
    }
    // A gigabyte of zeros in a file of a megabyte.
    std::string zeros;
    const std::string part = packed(std::string(std::size_t{1} << 26, '\0'), Packer::gzip);
    for (int i = 0; i < 16; ++i) zeros += part;
    write("log.csv", zeros);
    expect_refused(allan_, AllOf(HasSubstr("log.csv:1:"), HasSubstr("zero byte")));
}

TEST_F(FieldData, EndlessLinesAndDamagedRowsAreNamed) {
    write("log.csv", "t,gx\n0,1\n" + std::string(std::size_t{5} << 20, '1'));
    expect_refused(allan_, AllOf(HasSubstr("log.csv:3: a line is longer")));
    std::string text = stamped(30000, 0, 1);
    text[text.size() - 3] = '\0';
    write("log.csv", text);
    expect_refused(allan_, AllOf(HasSubstr("log.csv:30001:"), HasSubstr("zero byte")));
    write("log.csv", stamped(30000, 0, 1) + "30000,\"7\n");
    expect_refused(allan_, AllOf(HasSubstr("log.csv:30002: column 2"), HasSubstr("quotes")));
    write("log.csv", stamped(30000, 0, 1) + "30000\n");
    expect_refused(allan_, AllOf(HasSubstr("log.csv:30002: has 1 column"), HasSubstr("header has 2")));
    write("log.csv", stamped(30000, 0, 1) + "30000,seven\n");
    expect_refused(allan_, AllOf(HasSubstr("log.csv:30002: column gx: 'seven'")));
}

}  // namespace
}  // namespace field_data_test
}  // namespace ringlock::test
