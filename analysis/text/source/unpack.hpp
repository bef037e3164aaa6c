#pragma once
#include <memory>
#include <string>
#include <string_view>

#include "analysis/text/source/source.hpp"

/// Packed files, unpacked as they are read.
namespace ringlock::text {

enum class Packing { none, gzip, xz, zstandard };

/// By the first bytes.
Packing packing_of(std::string_view first);

/// Unpacks `from`. Several streams one after the other are one, as in gzip, xz and zstd. Reading throws InputError,
/// naming the file, where the data are damaged, end too early or need more than 64 MB of memory for the last unpacked
/// bytes (windows of `zstd --ultra --long` and the like).
std::unique_ptr<Source> unpack(std::unique_ptr<Source> from, Packing packing, const std::string& name);

}  // namespace ringlock::text
