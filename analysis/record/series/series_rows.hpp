#pragma once
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "analysis/record/series/series.hpp"
#include "analysis/record/series/time_grid.hpp"

namespace ringlock::record {

/// Values in the order of time.
struct SeriesPiece {
    std::span<const double> values;        ///< NaN where missing
    std::span<const std::int64_t> counts;  ///< as long, 0 where missing; empty once a value was no whole number
};
/// Whether a double may have lost digits of it.
inline bool is_beyond_doubles(std::int64_t count) {
    constexpr std::int64_t exact = std::int64_t{1} << 53;
    return count > exact || count < -exact;
}

using TakePiece = std::function<void(const SeriesPiece&)>;

/// Takes the rows that a reader finds and hands them on in pieces of bounded length, with what is missing between.
class SeriesRows {
   public:
    explicit SeriesRows(TakePiece take) : take_(std::move(take)), values_(first_room), counts_(first_room) {}

    static constexpr std::size_t longest = 65536;  ///< values of a piece

    /// The rows have times; to be called before the first.
    void set_grid(TimeGrid grid) { grid_ = std::move(grid); }
    /// The time of the row whose value comes next: exact, as a double or as a whole number of units.
    void time(const text::Stamp& stamp, std::size_t row) {
        stamp_ = {stamp, row};
        stamped_ = true;
    }
    void time(double time, std::size_t row) { this->time(text::Stamp::of(time), row); }
    void time(std::int64_t time, std::size_t row) { this->time(text::Stamp{time, 0.0}, row); }
    /// The line of the file on which the next value stands, where the file has lines.
    void line(std::size_t line) { line_ = line; }
    void value(double value) {
        if (stamped_ && !place({Waiting::Kind::value, value, 0, {}, line_})) return;
        note_line();
        all_whole_ = false;
        push(value, 0);
    }
    void count(std::int64_t count) {
        if (stamped_ && !place({Waiting::Kind::count, 0.0, count, {}, line_})) return;
        note_line();
        beyond_doubles_ = beyond_doubles_ || is_beyond_doubles(count);
        push(static_cast<double>(count), count);
    }
    void missing() {
        if (stamped_ && !place({Waiting::Kind::missing, 0.0, 0, {}, line_})) return;
        note_line();
        leave_out();
    }

    /// Behind the last row. Of what is returned, column and rate_hz are the reader's.
    SeriesInfo finish();

   private:
    /// A row that waits until the grid is known.
    struct Waiting {
        enum class Kind { value, count, missing } kind;
        double value;
        std::int64_t count;
        StampedRow at;
        std::size_t line;
    };
    /// Fills the missing rows before the row whose time was given; false where the row waits.
    bool place(const Waiting& row);
    void begin_grid();
    void fill(const StampedRow& at);
    void leave_out() {
        ++info_.missing;
        push(std::numeric_limits<double>::quiet_NaN(), 0);
    }
    /// Of the datum that is pushed next.
    void note_line() {
        // A stream of any length is read in little memory: lines are kept while they come in few runs.
        constexpr std::size_t most_runs = 100000;
        if (line_ == 0 || lines_given_up_) return;
        if (info_.lines.size() == most_runs) {
            info_.lines = {};
            lines_given_up_ = true;
            return;
        }
        const std::size_t datum = info_.n + filled_;
        if (info_.lines.empty() || datum - last_datum_ != line_ - last_line_) info_.lines.push_back({datum, line_});
        last_datum_ = datum;
        last_line_ = line_;
    }
    void push(double value, std::int64_t count) {
        values_[filled_] = value;
        counts_[filled_] = count;
        if (++filled_ == values_.size()) make_room();
    }
    void make_room();
    void flush();

    static constexpr std::size_t first_room = 256;  ///< values that there is room for at the beginning

    TakePiece take_;
    std::optional<TimeGrid> grid_;
    StampedRow stamp_;
    bool stamped_ = false;  ///< the next row has a time
    std::size_t line_ = 0;  ///< of the next row; 0: the file has none
    std::size_t last_datum_ = 0;
    std::size_t last_line_ = 0;
    bool lines_given_up_ = false;
    bool begun_ = false;  ///< the grid is known
    std::vector<Waiting> waiting_;
    std::vector<double> values_;
    std::vector<std::int64_t> counts_;
    std::size_t filled_ = 0;
    SeriesInfo info_;
    bool all_whole_ = true;
    bool beyond_doubles_ = false;
};

}  // namespace ringlock::record
