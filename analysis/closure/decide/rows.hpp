#pragma once
#include <cstddef>

#include "analysis/closure/types.hpp"

namespace ringlock::closure {

/// The training rows of a record with that number of rows: effects are selected and parameters fitted on them. The
/// record is cut into contiguous blocks and every tenth block is held out (Options::blocks), so that the error of
/// predictions on it can be reported.
/// \return 1 for each training row, 0 for each held-out row
Rows training_rows(std::size_t rows);

}  // namespace ringlock::closure
