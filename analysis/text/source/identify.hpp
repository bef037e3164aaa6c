#pragma once
#include <string_view>

/// Files that are no text, by their first bytes.
namespace ringlock::text {

/// Format of a file that cannot be read as text, and advice for its owner.
struct Identity {
    std::string_view kind;    ///< as in "is ...", with its article; empty where the bytes may be text
    std::string_view advice;  ///< an instruction, as an imperative
};

/// Looks at the first bytes of a file, 512 of them or all that there are. Files that are packed with gzip, xz or
/// Zstandard and HDF5 files are identified, too: it is for the caller to unpack or to read those.
Identity identify(std::string_view first);

}  // namespace ringlock::text
