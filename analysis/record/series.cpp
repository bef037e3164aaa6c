#include "analysis/record/series.hpp"

#include <fmt/format.h>

#include "analysis/record/readers.hpp"

namespace ringlock::record {

std::string listed(const std::vector<std::string>& names) {
    constexpr std::size_t most = 20;
    std::string out;
    for (std::size_t i = 0; i < names.size() && i < most; ++i) out += fmt::format("{}{}", i > 0 ? ", " : "", names[i]);
    if (names.size() > most) out += fmt::format(", ... ({} in all)", names.size());
    return out;
}

Series read_series(const std::string& path, const std::optional<std::string>& column) {
    return is_hdf5(path) ? read_hdf5_series(path, column) : read_text_series(path, column);
}

}  // namespace ringlock::record
