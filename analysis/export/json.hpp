#pragma once
#include <vector>

#include "analysis/export/blocks.hpp"

namespace ringlock::exports {

/// The objects as one JSON object: a group is an object with its attributes under "attributes" and its members by name;
/// a dataset is an object of "unit", "description" and "values", rows of two dimensions as arrays in an array. Numbers
/// that are not finite are null. Lines end in LF; the text ends with one.
void write_json(const store::File& file, const std::vector<store::ListedObject>& objects, const Sink& sink);

}  // namespace ringlock::exports
