#include "tests/fuzz/texts.hpp"

#include <algorithm>

#include "analysis/record/record.hpp"

namespace ringlock::fuzz {

const std::vector<std::string> logs = {
    "# rate_hz = 100\ntime_s,angle_increment_arcsec,accel_x\n0.00,1.5,2\n0.01,-2.5,3\n0.04,0.5,nan\n0.05,0.25,4\n",
    "\"Zeit [s]\";\"Gyro X (deg/s)\"\n0,000;0,25\n0,005;-0,5\n0,010;1,#QNAN\n0,015;NA\n",
    "t,gx\n(s),(rad/s)\n2024-05-01T12:00:00.5Z,1\n2024-05-01T12:00:00.51Z,2.5D-03\n2024-05-01T12:00:00.52Z,3\n",
    ",0,1\n0,0.5,1.5\n1,0.6,1.6\n2,0.7,1.7\n",
    "#timestamp [ns],w_x [rad s^-1]\n1403636579758555392,1\n1403636579768555392,2\n1403636579778555392,3\n",
    "// Start: unknown\nPacket\tGyr X\tGyr Y\n0\t1\t2\n1\t3\t4\n2\t\t6\n",
    "1 2\n3 4\n9007199254740993 5\n",
};

namespace {

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

}  // namespace

std::string damaged_text(std::string text, std::size_t faults, Chance& chance) {
    for (; faults > 0; --faults) {
        const std::size_t at = chance.any(text.size() + 1);
        const std::size_t length = std::min(chance.any(12), text.size() - at);
        switch (chance.any(6)) {
            case 0:
                text.erase(at, length);
                break;
            case 1:
                text.insert(at, chance.of(words));
                break;
            case 2:
                if (at < text.size()) text[at] = static_cast<char>(chance.any(256));
                break;
            case 3:
                text.insert(chance.any(text.size() + 1), text.substr(at, length * 8));
                break;
            case 4:
                text.resize(at);
                break;
            default:
                if (at < text.size()) text[at] = static_cast<char>(text[at] ^ (1 << chance.any(8)));
                break;
        }
    }
    return text;
}

record::SeriesRequest text_request(const std::string& path, Chance& chance) {
    record::SeriesRequest request;
    request.path = path;
    static const std::vector<std::string> columns = {"2", "2", "2", "1", "3", "gx", "Gyr X", "accel_x"};
    if (!chance.one_in(8)) request.column = chance.of(columns);
    static const std::vector<std::string> times = {"1", "t", "1,2", "time_s", "timestamp"};
    if (chance.one_in(4)) {
        request.time = chance.of(times);
        request.rate_hz = 100.0;
        static const std::vector<std::string> units = {"s", "ms", "ns", "iso", "mjd"};
        if (chance.one_in(3)) request.time_unit = chance.of(units);
    }
    if (chance.one_in(6)) request.text.skip = chance.any(4);
    if (chance.one_in(6)) request.text.delimiter = ",;\t |"[chance.any(5)];
    if (chance.one_in(6)) {
        request.text.header = static_cast<text::Options::Header>(chance.any(4));
        request.text.header_line = 1 + chance.any(4);
    }
    return request;
}

void read_text(const InputFile& file, Chance& chance, Tally& tally) {
    const record::SeriesRequest request = text_request(file.path(), chance);
    attempt(
        file.path(), [&] { record::read_series(request); }, tally);
    attempt(
        file.path(), [&] { record::read_record(file.path()); }, tally);
}

}  // namespace ringlock::fuzz
