#pragma once
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace ringlock::record {

/// A number of NumPy: 'f', 'i', 'u' or 'b' (a boolean), its size and its byte order.
struct NpyType {
    char kind = 'f';
    std::size_t bytes = 8;
    bool big_endian = false;
};

/// A field of a structured array, or the whole element of a plain one, which has no name.
struct NpyField {
    std::string name;
    NpyType type;
    std::size_t offset = 0;   ///< from the start of an element
    std::uint64_t count = 0;  ///< numbers in it where it is an array, else 0
    std::string why_not;      ///< why it is no number, as a sentence without subject; empty where it is one
};

/// The head of a .npy file (NumPy Enhancement Proposal 1 and its versions 2 and 3).
struct NpyHeader {
    std::vector<NpyField> fields;
    std::size_t element_bytes = 0;
    bool column_by_column = false;  ///< "Fortran order": the first index runs fastest
    std::vector<std::uint64_t> shape;
    std::size_t bytes = 0;  ///< of the head; the data follow
};

inline constexpr std::string_view npy_magic = "\x93NUMPY";
/// Bytes from which the length of the whole head follows.
inline constexpr std::size_t npy_preamble_bytes = 12;

/// Length of the head by its first npy_preamble_bytes. Throws InputError where they begin no .npy file, or one of
/// another version; `where` names the file and the array.
std::size_t npy_header_bytes(std::string_view preamble, const std::string& where);

/// Throws InputError where the head is damaged. A type that is no number is not one of its errors, see NpyField.
NpyHeader parse_npy_header(std::string_view head, const std::string& where);

}  // namespace ringlock::record
