// The figures of results/replication/tables.md, one block of Markdown after another.
//
//   bench_replication [BLOCK [RESULT.h5]]
//
// Without arguments every block but `coefficients`, which needs the result of
// scenarios/gao-deng-2007-coefficients.toml; `--list` names the others. tools/replication puts them into the page.
#include <string>

#include "tests/bench/page.hpp"
#include "tests/bench/replication_blocks.hpp"

using namespace ringlock::bench::replication;

int main(int argc, char** argv) {
    const std::string wanted = argc > 1 ? argv[1] : "";
    const ringlock::bench::Block of_a_result[] = {{"coefficients", [&] { coefficients(argv[2]); }}};
    const ringlock::bench::Block blocks[] = {
        {"device", device},     {"half-turns", half_turns}, {"turns", turns},     {"averaging", averaging},
        {"cycles", cycles},     {"likelihood", likelihood}, {"search", search},   {"one-cycle", one_cycle},
        {"readings", readings}, {"implied", implied},       {"table-1", table_1}, {"corrections", corrections},
    };
    const bool result_given = wanted == "coefficients" && argc == 3;
    return result_given ? ringlock::bench::print_blocks("bench_replication", wanted, of_a_result)
                        : ringlock::bench::print_blocks("bench_replication", wanted, blocks);
}
