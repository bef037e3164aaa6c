// Damaged texts for the readers of series and records: `fuzz_text SEED COUNT [packed]`. Each is read, or refused with
// an InputError that names the file; anything else ends the program with a status that is not 0. With `packed` the
// damage is done to packed bytes.
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <fstream>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include "analysis/record/record.hpp"
#include "analysis/record/series.hpp"
#include "engine/core/error.hpp"
#include "engine/core/notice.hpp"
#include "tests/support/packed_text.hpp"

namespace {

using namespace ringlock;

const std::vector<std::string> seeds = {
    "# rate_hz = 100\ntime_s,angle_increment_arcsec,accel_x\n0.00,1.5,2\n0.01,-2.5,3\n0.04,0.5,nan\n0.05,0.25,4\n",
    "\"Zeit [s]\";\"Gyro X (deg/s)\"\n0,000;0,25\n0,005;-0,5\n0,010;1,#QNAN\n0,015;NA\n",
    "t,gx\n(s),(rad/s)\n2024-05-01T12:00:00.5Z,1\n2024-05-01T12:00:00.51Z,2.5D-03\n2024-05-01T12:00:00.52Z,3\n",
    ",0,1\n0,0.5,1.5\n1,0.6,1.6\n2,0.7,1.7\n",
    "#timestamp [ns],w_x [rad s^-1]\n1403636579758555392,1\n1403636579768555392,2\n1403636579778555392,3\n",
    "// Start: unknown\nPacket\tGyr X\tGyr Y\n0\t1\t2\n1\t3\t4\n2\t\t6\n",
    "1 2\n3 4\n9007199254740993 5\n",
};
const std::vector<std::string> words = {",",
                                        ";",
                                        "\t",
                                        " ",
                                        "\n",
                                        "\r",
                                        "\r\n",
                                        "\"",
                                        "\"\"",
                                        "#",
                                        "# rate_hz = 7\n",
                                        "nan",
                                        "1e308",
                                        "-1e999",
                                        "9223372036854775807",
                                        "99999999999999999999",
                                        "1.#INF",
                                        "2024-02-30T25:00:00",
                                        "[ns]",
                                        "(ms)",
                                        "\xEF\xBB\xBF",
                                        "\xff\xfe",
                                        "\xc3",
                                        std::string(1, '\0'),
                                        "%",
                                        "//",
                                        "--",
                                        "time_s",
                                        "quarter_count",
                                        "0",
                                        "1,2",
                                        "'"};

class Mutator {
   public:
    explicit Mutator(std::uint64_t seed) : engine_(seed) {}
    std::size_t any(std::size_t below) { return engine_() % below; }

    std::string damaged(std::string text, std::size_t times) {
        for (; times > 0; --times) {
            const std::size_t at = any(text.size() + 1);
            const std::size_t length = std::min(any(12), text.size() - at);
            switch (any(6)) {
                case 0:
                    text.erase(at, length);
                    break;
                case 1:
                    text.insert(at, words[any(words.size())]);
                    break;
                case 2:
                    if (at < text.size()) text[at] = static_cast<char>(any(256));
                    break;
                case 3:
                    text.insert(any(text.size() + 1), text.substr(at, length * 8));
                    break;
                case 4:
                    text.resize(at);
                    break;
                default:
                    if (at < text.size()) text[at] ^= static_cast<char>(1 << any(8));
                    break;
            }
        }
        return text;
    }

   private:
    std::mt19937_64 engine_;
};

record::SeriesRequest request_of(Mutator& mutator, const std::string& path) {
    record::SeriesRequest request;
    request.path = path;
    const std::vector<std::string> columns = {"2", "2", "2", "1", "3", "gx", "Gyr X", "accel_x"};
    if (mutator.any(8) > 0) request.column = columns[mutator.any(columns.size())];
    const std::vector<std::string> times = {"1", "t", "1,2", "time_s", "timestamp"};
    if (mutator.any(4) == 0) {
        request.time = times[mutator.any(times.size())];
        request.rate_hz = 100.0;
        const std::vector<std::string> units = {"s", "ms", "ns", "iso", "mjd"};
        if (mutator.any(3) == 0) request.time_unit = units[mutator.any(units.size())];
    }
    if (mutator.any(6) == 0) request.text.skip = mutator.any(4);
    if (mutator.any(6) == 0) request.text.delimiter = ",;\t |"[mutator.any(5)];
    if (mutator.any(6) == 0) {
        request.text.header = static_cast<text::Options::Header>(mutator.any(4));
        request.text.header_line = 1 + mutator.any(4);
    }
    return request;
}

/// True where it was read. Ends the program where the refusal is no InputError or does not name the file.
template <class Action>
bool attempt(const std::string& path, std::string_view text, Action action) {
    try {
        action();
        return true;
    } catch (const InputError& error) {
        if (std::string_view(error.what()).find(path) != std::string_view::npos) return false;
        fmt::print(stderr, "the message does not name the file: {}\n{}\n", error.what(), text);
    } catch (const std::exception& error) {
        fmt::print(stderr, "no InputError: {}\n{}\n", error.what(), text);
    }
    std::exit(1);
}

}  // namespace

int main(int count_of_arguments, char** arguments) {
    if (count_of_arguments < 3) {
        fmt::print(stderr, "usage: fuzz_text SEED COUNT [packed]\n");
        return 2;
    }
    Mutator mutator(std::strtoull(arguments[1], nullptr, 10));
    const std::uint64_t count = std::strtoull(arguments[2], nullptr, 10);
    const bool packed = count_of_arguments > 3;
    set_notice_sink([](std::string_view) {});
    const std::string path =
        (std::filesystem::temp_directory_path() / fmt::format("ringlock-fuzz-{}", ::getpid())).string();
    std::uint64_t read = 0;
    for (std::uint64_t i = 0; i < count; ++i) {
        std::string text = seeds[mutator.any(seeds.size())];
        const std::size_t times = mutator.any(5);
        if (packed) {
            if (mutator.any(4) == 0) text = test::utf16(text, mutator.any(2) == 0, mutator.any(2) == 0);
            text = mutator.damaged(test::packed(text, static_cast<test::Packer>(mutator.any(4))), mutator.any(3));
        } else {
            text = mutator.damaged(text, times);
        }
        std::ofstream(path, std::ios::binary) << text;
        const record::SeriesRequest request = request_of(mutator, path);
        read += attempt(path, text, [&] { record::read_series(request); }) ? 1 : 0;
        read += attempt(path, text, [&] { record::read_record(path); }) ? 1 : 0;
    }
    std::filesystem::remove(path);
    fmt::print("{} of {} read, the others refused\n", read, 2 * count);
    return read > 0 ? 0 : 1;
}
