#pragma once
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "analysis/record/arrays/array_choice.hpp"
#include "analysis/record/arrays/array_column.hpp"
#include "analysis/record/arrays/npy_header.hpp"

namespace ringlock::record {

/// The bytes of an array, from the head on.
class ByteSource {
   public:
    virtual ~ByteSource() = default;
    /// Reads bytes from `at` on; positions increase from call to call. False where there are fewer bytes.
    virtual bool read(std::uint64_t at, std::span<char> into) = 0;
};

/// Adds the fields of an array to the contents of a file; `bytes` is the size of the array and its head, if known.
///
/// Throws InputError where the head claims more values than these bytes can hold.
void add_array(const NpyHeader& head, const std::string& file, const std::string& name,
               std::optional<std::uint64_t> bytes, Contents& contents);

/// The series of an array.
std::unique_ptr<ArrayColumn> npy_column(const std::string& file, const Slice& slice, const NpyHeader& head,
                                        std::unique_ptr<ByteSource> source);

}  // namespace ringlock::record
