#include "analysis/record/series.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "analysis/record/readers.hpp"
#include "analysis/record/text_lines.hpp"
#include "engine/core/error.hpp"

namespace ringlock::record {
namespace {

SeriesInfo stream_pieces(const SeriesRequest& request, const TakePiece& take) {
    const std::string file = name_of_file(request.path);
    if (request.time && (!(request.rate_hz > 0.0) || !std::isfinite(request.rate_hz))) {
        throw InputError(
            fmt::format("{}: time stamps need the sampling rate that they should keep, a positive number "
                        "[Hz]; found {}",
                        file, request.rate_hz));
    }
    const bool hdf5 = request.path != standard_input && is_hdf5(request.path);
    SeriesInfo info = hdf5 ? stream_hdf5_series(request, take) : stream_text_series(request, take);
    if (info.missing == info.n) {
        throw InputError(fmt::format("{}: {} {}: all {} values are missing", file, hdf5 ? "dataset" : "column",
                                     info.column, info.n));
    }
    return info;
}

/// Keeps the pieces. Whole numbers are kept beside the doubles only from where these lose digits.
class Collector {
   public:
    Collector(std::string file, Series& into) : file_(std::move(file)), into_(into) {}

    void take(const SeriesPiece& piece) {
        check_memory(into_.values.size() + piece.values.size());
        const bool kept = !into_.counts.empty();
        if (piece.counts.empty()) {
            std::vector<std::int64_t>().swap(into_.counts);
        } else if (kept || std::any_of(piece.counts.begin(), piece.counts.end(), is_beyond_doubles)) {
            if (!kept) {
                for (const double v : into_.values)
                    into_.counts.push_back(std::isnan(v) ? 0 : static_cast<std::int64_t>(v));
            }
            into_.counts.insert(into_.counts.end(), piece.counts.begin(), piece.counts.end());
        }
        into_.values.insert(into_.values.end(), piece.values.begin(), piece.values.end());
    }

   private:
    void check_memory(std::size_t values) const {
        // A vector that grows holds the old values beside the new ones.
        constexpr double bytes_a_value = 3.0 * sizeof(double);
        if (bytes_a_value * static_cast<double>(values) <= memory_bytes()) return;
        throw InputError(
            fmt::format("{}: has more values than memory is free for ({} and more, those that "
                        "are missing included); cut the record into pieces",
                        file_, values));
    }

    std::string file_;
    Series& into_;
};

}  // namespace

std::string listed(const std::vector<std::string>& names) {
    constexpr std::size_t most = 20;
    std::string out;
    for (std::size_t i = 0; i < names.size() && i < most; ++i) out += fmt::format("{}{}", i > 0 ? ", " : "", names[i]);
    if (names.size() > most) out += fmt::format(", ... ({} in all)", names.size());
    return out;
}

Series read_series(const SeriesRequest& request) {
    Series series;
    Collector collector(name_of_file(request.path), series);
    static_cast<SeriesInfo&>(series) = stream_pieces(request, [&](const SeriesPiece& piece) { collector.take(piece); });
    return series;
}

Series read_series(const std::string& path, const std::optional<std::string>& column) {
    return read_series(SeriesRequest{path, column, std::nullopt, 0.0});
}

SeriesInfo stream_series(const SeriesRequest& request, const std::function<void(std::span<const double>)>& piece) {
    return stream_pieces(request, [&](const SeriesPiece& found) { piece(found.values); });
}

}  // namespace ringlock::record
