#pragma once
#include <cstddef>
#include <string>

#include "analysis/text/layout.hpp"

namespace ringlock::text {

/// The column that is asked for: by its heading, by its name without the unit where only one is called so, or by its
/// number from 1. Throws InputError where there is none or the name stands for several.
std::size_t find_column(const Layout& layout, const std::string& asked, const std::string& file);

/// What columns there are, for messages.
std::string columns_text(const Layout& layout);

}  // namespace ringlock::text
