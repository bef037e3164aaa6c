#pragma once
#include <string>
#include <vector>

#include "analysis/export/blocks.hpp"

namespace ringlock::exports {

/// The objects as arrays of NumPy in a zip archive without compression, written to an open file: each dataset under its
/// path without the first slash, with its shape and type; each attribute as an array without dimensions under
/// "PATH@NAME" ("@NAME" for the root); and "labels", an array of text with a row of name, unit and description for each
/// dataset. Text is an array of "<U". Equal objects make equal bytes.
///
/// \param shown_as  the file in errors
/// Throws RunError where the disk refuses.
void write_npz(const store::File& file, const std::vector<store::ListedObject>& objects, int descriptor,
               const std::string& shown_as);

}  // namespace ringlock::exports
