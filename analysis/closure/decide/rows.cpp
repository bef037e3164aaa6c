#include "analysis/closure/decide/rows.hpp"

#include "analysis/closure/options.hpp"

namespace ringlock::closure {

Rows training_rows(std::size_t rows) {
    Rows training(rows);
    for (std::size_t i = 0; i < rows; ++i) {
        const std::size_t block = i * options.blocks / rows;
        training[i] = block % options.blocks_in_a_row == options.held_out_block ? 0 : 1;
    }
    return training;
}

}  // namespace ringlock::closure
