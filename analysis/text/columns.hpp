#pragma once
#include <cstddef>
#include <string>

#include "analysis/text/layout/layout.hpp"

namespace ringlock::text {

/// Index of the requested column: by its heading, by its name without the unit where only one column has that name, or
/// by its number from 1. Throws InputError where no column or several columns have that name.
std::size_t find_column(const Layout& layout, const std::string& asked, const std::string& file);

/// List of the columns, for messages.
std::string columns_text(const Layout& layout);

}  // namespace ringlock::text
