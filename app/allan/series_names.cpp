#include "app/allan/series_names.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "analysis/record/column_list.hpp"
#include "engine/core/error.hpp"
#include "engine/core/printable.hpp"

namespace ringlock::app {
namespace {

void refuse_repeated(const std::vector<std::string>& names, const char* what) {
    for (auto name = names.begin(); name != names.end(); ++name) {
        if (std::find(names.begin(), name, *name) == name) continue;
        throw InputError(fmt::format("{} {} is named twice; name it once", what, printable(*name)));
    }
}

}  // namespace

std::vector<SeriesName> series_names(const std::vector<std::string>& files, const std::string& columns,
                                     const record::SeriesRequest& series, const RepeatedInput& input) {
    refuse_repeated(files, "DATA");
    std::vector<SeriesName> out;
    for (const std::string& file : files) {
        if (columns.empty()) {
            out.push_back({.path = file, .column = std::nullopt});
            continue;
        }
        record::SeriesRequest request = series;
        request.path = file;
        input.rewind();
        const std::vector<std::string> names = record::columns_of_list(request, columns);
        refuse_repeated(names, "--column");
        for (const std::string& name : names) {
            out.push_back({.path = file, .column = name, .read_before = &name != &names.front()});
        }
    }
    return out;
}

}  // namespace ringlock::app
