// How often the intervals of analysis/lot hold the truth. `bench_lot_coverage [BLOCK]` prints the tables of
// docs/lot.md, or one of them: ratio, exact, stopped-yields, stopped-means, stopped-lots; `--list` names them.
// LOT_STUDIES=N in the environment sets the number of simulated studies a rule of stopped-lots, 5000 unless told.
//
// exact and stopped-yields are sums over binomial probabilities without any simulation. stopped-means draws variances
// only, and integrates over the mean.
#include <array>

#include "tests/bench/lot_coverage.hpp"

int main(int argc, char** argv) {
    using namespace ringlock::bench::lot_coverage;
    const std::array<ringlock::bench::Block, 5> blocks = {{{"ratio", print_ratio},
                                                           {"exact", print_exact},
                                                           {"stopped-yields", print_stopped_yields},
                                                           {"stopped-means", print_stopped_means},
                                                           {"stopped-lots", print_stopped_lots}}};
    return ringlock::bench::print_blocks("bench_lot_coverage", argc > 1 ? argv[1] : "", blocks);
}
