#pragma once
#include <string>
#include <vector>

#include "analysis/export/blocks.hpp"

namespace ringlock::exports {

/// Writes the objects as variables of MATLAB (MAT-file, version 5) into a file that is there: each group below the root
/// is a struct with its datasets, attributes and groups; those of the root itself are variables. The structs "unit" and
/// "description" have the same fields with the labels of the datasets. A dataset of one dimension is a column; text is
/// a row of characters, several texts a column of cells. Names become those of MATLAB, as "noise_injected_compensated"
/// of "noise_injected+compensated"; an attribute that is called as a member of its group has "_attribute" behind its
/// name. Equal objects make equal bytes.
///
/// Memory: about twice the size of all values of the objects.
///
/// \param shown_as  the file in errors
/// Throws InputError where a variable would be larger than the format allows, RunError where the disk refuses.
void write_matlab(const store::File& file, const std::vector<store::ListedObject>& objects, const std::string& path,
                  const std::string& shown_as);

/// Throws InputError where a variable would be larger than the 2 GB that the format allows.
void check_matlab_size(const std::vector<store::ListedObject>& objects);

}  // namespace ringlock::exports
