#pragma once
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <vector>

#include "app/allan/output/allan_output.hpp"

namespace ringlock::app {

/// Whether the object looks like one that `ringlock allan --json` prints: of one series, or of several.
bool is_allan_object(const nlohmann::json& object);

/// The series of an object that `ringlock allan --json` has printed. The unit of the data is not among them; of a
/// single series the name of the data is not, either. Throws InputError, which does not know the file, or an exception
/// of the JSON library where something is missing or of another type.
std::vector<AllanOutput> allan_outputs_of(const nlohmann::json& object);

}  // namespace ringlock::app
