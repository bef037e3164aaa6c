#pragma once
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "analysis/record/array_choice.hpp"
#include "analysis/record/array_column.hpp"
#include "analysis/record/npy_header.hpp"

namespace ringlock::record {

/// The bytes of an array, from the head on.
class ByteSource {
   public:
    virtual ~ByteSource() = default;
    /// Bytes from `at` on; places that are asked for increase. False where there are fewer.
    virtual bool read(std::uint64_t at, std::span<char> into) = 0;
};

/// Adds the fields of an array to what a file has; `bytes` are those of the array and its head, if known.
///
/// Throws InputError where the head says more values than these can be.
void add_array(const NpyHeader& head, const std::string& file, const std::string& name,
               std::optional<std::uint64_t> bytes, Contents& contents);

/// The series of an array.
std::unique_ptr<ArrayColumn> npy_column(const std::string& file, const Slice& slice, const NpyHeader& head,
                                        std::unique_ptr<ByteSource> source);

}  // namespace ringlock::record
