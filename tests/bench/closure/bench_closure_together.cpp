// Adds up what benches of the closed loop have counted.
//
//   bench_closure_together TOTALS.csv...
//
// Prints a table of the figures that all of them have, each with its interval and its one-sided upper limit.
#include <fmt/format.h>

#include <cstdio>
#include <exception>
#include <fstream>
#include <map>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "tests/closure/suite/bench_tables.hpp"

namespace {

using Total = std::pair<std::size_t, std::size_t>;

std::size_t count_in(std::istream& line) {
    std::string text;
    std::getline(line, text, ',');
    return std::stoull(text);
}

}  // namespace

int main(int argc, char** argv) {
    if (argc < 2) {
        fmt::print(stderr, "usage: bench_closure_together TOTALS.csv...\n");
        return 2;
    }
    try {
        std::vector<std::string> figures;
        std::map<std::string, Total> totals;
        for (int k = 1; k < argc; ++k) {
            std::ifstream in(argv[k]);
            std::string text;
            if (!std::getline(in, text)) throw std::runtime_error(std::string("cannot read ") + argv[k]);
            while (std::getline(in, text)) {
                std::istringstream line(text);
                std::string figure;
                std::getline(line, figure, ',');
                if (!totals.contains(figure)) figures.push_back(figure);
                Total& total = totals[figure];
                total.first += count_in(line);
                total.second += count_in(line);
            }
        }
        fmt::print(
            "| turns and samples together | reached (95 % interval) | upper 95 % limit, one-sided |\n|---|---|---|\n");
        for (const std::string& figure : figures) {
            const auto [count, of] = totals.at(figure);
            fmt::print("| {} | {} | {} |\n", figure, ringlock::test::closure::share_of(count, of),
                       ringlock::test::closure::limit_of(count, of));
        }
    } catch (const std::exception& error) {
        fmt::print(stderr, "bench_closure_together: {}\n", error.what());
        return 1;
    }
}
