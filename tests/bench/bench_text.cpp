// Rows a second of a text of three columns, of which one is read, in several dialects and packed; beside a plain copy
// of the file's bytes.
#include <fmt/format.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <random>
#include <string>

#include "analysis/record/series/series.hpp"
#include "tests/support/packed_text.hpp"

namespace {

using namespace ringlock;

constexpr std::size_t rows = 1'000'000;

/// `wide`: quotes, semicolons and decimal commas.
std::string table(bool wide) {
    std::mt19937_64 engine(1);
    std::normal_distribution<double> normal;
    std::string out = wide ? "\"t\";\"x\";\"y\"\n" : "t,x,y\n";
    for (std::size_t i = 0; i < rows; ++i) {
        std::string row = wide ? fmt::format("\"{:.3f}\";\"{:.6f}\";\"{:.6f}\"\n", 0.005 * static_cast<double>(i),
                                             normal(engine), normal(engine))
                               : fmt::format("{:.3f},{:.6f},{:.6f}\n", 0.005 * static_cast<double>(i), normal(engine),
                                             normal(engine));
        for (char& c : row) c = wide && c == '.' ? ',' : c;
        out += row;
    }
    return out;
}

double seconds_to_read(const record::SeriesRequest& request) {
    double best = 1e9;
    for (int trial = 0; trial < 3; ++trial) {
        const auto start = std::chrono::steady_clock::now();
        double sum = 0.0;
        record::stream_series(request, [&](std::span<const double> piece) { sum += piece[0]; });
        best = std::min(best, std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
        if (sum == 0.125) fmt::print(" ");  // or nothing would have to be read
    }
    return best;
}

}  // namespace

int main() {
    const std::filesystem::path path =
        std::filesystem::temp_directory_path() / fmt::format("ringlock-bench-text-{}", ::getpid());
    fmt::print("{:28}  {:>12}  {:>8}\n", "text of three columns", "rows/s", "MB/s");
    const auto measure = [&](const char* name, const std::string& text, test::Packer packer, bool times) {
        std::ofstream(path, std::ios::binary) << test::packed(text, packer);
        record::SeriesRequest request{.path = path.string(), .column = "2", .time = std::nullopt};
        request.text.quiet = true;
        request.rate_hz = 200.0;
        if (times) request.time = "1";
        const double seconds = seconds_to_read(request);
        fmt::print("{:28}  {:12.4g}  {:8.4g}\n", name, static_cast<double>(rows) / seconds,
                   static_cast<double>(text.size()) / seconds / 1e6);
    };
    const std::string plain = table(false);
    measure("commas", plain, test::Packer::none, false);
    measure("commas, with time stamps", plain, test::Packer::none, true);
    measure("commas, gzip", plain, test::Packer::gzip, false);
    measure("commas, xz", plain, test::Packer::xz, false);
    measure("commas, zstd", plain, test::Packer::zstd, false);
    measure("quotes and decimal commas", table(true), test::Packer::none, false);
    std::filesystem::remove(path);
    return 0;
}
