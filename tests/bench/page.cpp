#include "tests/bench/page.hpp"

#include <fmt/format.h>

#include <cmath>
#include <exception>

namespace ringlock::bench {

void row(const std::vector<std::string>& cells) {
    for (const std::string& cell : cells) fmt::print("| {} ", cell);
    fmt::print("|\n");
}
void head(const std::vector<std::string>& cells) {
    row(cells);
    for (std::size_t i = 0; i < cells.size(); ++i) fmt::print("|---");
    fmt::print("|\n");
}

std::string number(double value, int digits) { return fmt::format("{:.{}f}", value, digits); }

std::string signed_number(double value, int digits) {
    const bool zero = std::abs(value) < 0.5 * std::pow(10.0, -digits);
    return zero ? fmt::format("{:.{}f}", 0.0, digits) : fmt::format("{:+.{}f}", value, digits);
}

int print_blocks(const char* program, const std::string& wanted, std::span<const Block> blocks) {
    try {
        bool found = false;
        for (const auto& [title, print] : blocks) {
            if (wanted == "--list") {
                fmt::print("{}\n", title);
            } else if (wanted.empty() || wanted == title) {
                if (wanted.empty()) fmt::print("\n{}\n\n", title);
                print();
            } else {
                continue;
            }
            found = true;
        }
        if (found) return 0;
        fmt::print(stderr, "{}: no block {}\n", program, wanted);
        return 2;
    } catch (const std::exception& error) {
        fmt::print(stderr, "{}: {}\n", program, error.what());
        return 1;
    }
}

}  // namespace ringlock::bench
