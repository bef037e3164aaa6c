#include "analysis/record/series/series.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>

#include "analysis/record/container.hpp"
#include "analysis/record/readers.hpp"
#include "analysis/text/words.hpp"
#include "engine/core/error.hpp"
#include "engine/core/printable.hpp"

namespace ringlock::record {

std::optional<std::size_t> SeriesInfo::line_of(std::size_t datum) const {
    const auto next = std::upper_bound(lines.begin(), lines.end(), datum,
                                       [](std::size_t wanted, const DatumLine& run) { return wanted < run.datum; });
    if (next == lines.begin()) return std::nullopt;
    const DatumLine& run = *std::prev(next);
    return run.line + (datum - run.datum);
}

namespace {

/// The first value that is so large that deviations, which sum squares of sums of values, would overflow.
class LargestValue {
   public:
    static constexpr double limit = 1e120;

    void note(std::span<const double> values) {
        if (!is_too_large()) {
            const auto found = std::find_if(values.begin(), values.end(), [](double v) { return std::abs(v) > limit; });
            if (found != values.end()) {
                value_ = *found;
                number_ = seen_ + static_cast<std::size_t>(found - values.begin()) + 1;
            }
        }
        seen_ += values.size();
    }
    bool is_too_large() const { return number_ > 0; }
    double value() const { return value_; }
    std::size_t number() const { return number_; }

   private:
    std::size_t seen_ = 0;
    std::size_t number_ = 0;
    double value_ = 0.0;
};

SeriesInfo stream_container(Container container, const SeriesRequest& request, const TakePiece& take) {
    switch (container) {
        case Container::hdf5:
            return stream_hdf5_series(request, take);
        case Container::npy:
            return stream_npy_series(request, take);
        case Container::npz:
            return stream_npz_series(request, take);
        case Container::mat:
            return stream_mat_series(request, take);
        case Container::text:
            break;
    }
    return stream_text_series(request, take);
}

SeriesInfo stream_pieces(const SeriesRequest& request, const TakePiece& take) {
    const std::string file = text::name_of_file(request.path);
    if (request.time && (!(request.rate_hz > 0.0) || !std::isfinite(request.rate_hz))) {
        throw InputError(
            fmt::format("{}: time stamps need the sampling rate that they should keep, "
                        "a positive number [Hz]; found {}",
                        printable(file), request.rate_hz));
    }
    const Container container = container_of(request.path);
    LargestValue largest;
    SeriesInfo info = stream_container(container, request, [&](const SeriesPiece& piece) {
        largest.note(piece.values);
        take(piece);
    });
    const char* what = container == Container::text ? "column" : "dataset";
    if (info.missing == info.n) {
        throw InputError(
            fmt::format("{}: {} {}: all {} values are missing", printable(file), what, printable(info.column), info.n));
    }
    if (largest.is_too_large()) {
        throw InputError(fmt::format(
            "{}: {} {}: value {} (counted from 1, those that are missing included) is {:g}; "
            "values beyond {:g} have no sums of squares. Leave it out or write nan there",
            printable(file), what, printable(info.column), largest.number(), largest.value(), LargestValue::limit));
    }
    return info;
}

/// Keeps the pieces. Whole numbers are kept in addition to the doubles only from where these lose digits.
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
        // A vector that grows holds the old values and the new ones.
        constexpr double bytes_a_value = 3.0 * sizeof(double);
        if (bytes_a_value * static_cast<double>(values) <= memory_bytes()) return;
        throw InputError(
            fmt::format("{}: has more values than memory is free for ({} and more, those that are missing included); "
                        "cut the record into pieces",
                        printable(file_), values));
    }

    std::string file_;
    Series& into_;
};

}  // namespace

Series read_series(const SeriesRequest& request) {
    Series series;
    Collector collector(text::name_of_file(request.path), series);
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
