#pragma once
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "engine/store/contents.hpp"

/// Values of an HDF5 file as text and as files of other programs. A file is read in blocks of about a megabyte for each
/// dataset, or of one row where a row is longer.
namespace ringlock::exports {

/// Receives parts of a text, in order.
using Sink = std::function<void(std::string_view text)>;

/// Values of rows [first_row, first_row + n_rows).
using OnBlock = std::function<void(const store::Values& values, std::uint64_t first_row, std::uint64_t n_rows)>;

/// Rows of a block of datasets with so many columns altogether.
std::uint64_t rows_of_block(std::uint64_t columns);

/// Reads a dataset block by block. Throws Interrupted between blocks.
void each_block(const store::File& file, const store::ListedObject& dataset, const OnBlock& on_block);

/// The objects at and below a path, with the groups on the way to them, which then have no attributes. Paths may begin
/// with a slash or not. Throws InputError where there is none.
std::vector<store::ListedObject> part_of(const std::vector<store::ListedObject>& objects,
                                         const std::vector<std::string>& paths);

/// Reads all values and drops them: finds damage before anything is written.
void read_through(const store::File& file, const std::vector<store::ListedObject>& objects);

/// Collects small pieces of text, so that the sink gets larger ones. The last of them comes with flush().
class Collected {
   public:
    explicit Collected(const Sink& sink) : sink_(sink) {}
    Collected& operator+=(std::string_view text) {
        text_ += text;
        if (text_.size() >= most) flush();
        return *this;
    }
    void flush() {
        if (!text_.empty()) sink_(text_);
        text_.clear();
    }

   private:
    static constexpr std::size_t most = std::size_t{1} << 16;
    const Sink& sink_;
    std::string text_;
};

}  // namespace ringlock::exports
