#pragma once
#include <memory>
#include <string>
#include <string_view>

#include "analysis/text/source.hpp"

/// Packed files, unpacked as they are read.
namespace ringlock::text {

enum class Packing { none, gzip, xz, zstandard };

/// By the first bytes.
Packing packing_of(std::string_view first);

/// What is packed in `from`. Several streams one after the other are one, as gzip, xz and zstd have it. Reading throws
/// InputError, naming the file, where the data are damaged, end too early or want more than 64 MB of memory for what
/// was unpacked last (windows of `zstd --ultra --long` and the like).
std::unique_ptr<Source> unpack(std::unique_ptr<Source> from, Packing packing, const std::string& name);

}  // namespace ringlock::text
