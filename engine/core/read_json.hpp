#pragma once
#include <filesystem>
#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>

namespace ringlock {

/// Parses a text of JSON: the parser's templates take seconds of compilation in a source that uses them directly. Where
/// the text is no JSON: nlohmann::json::parse_error, or without `throws` a value of which is_discarded() is true.
nlohmann::json parse_json(std::string_view text, bool throws = true);

/// A number, or NaN for the null that stands for a number that is not finite. Throws nlohmann::json::type_error.
double number_or_nan(const nlohmann::json& value);

/// Parses a file of JSON and hands it on. Throws InputError where the file cannot be read or is no JSON; the InputError
/// of `use` and exceptions of the JSON library in it (a key is missing, a value has another type) become an InputError
/// that names the file.
///
/// \param expected  what the file should be, for that message
void read_json(const std::filesystem::path& file, std::string_view expected,
               const std::function<void(const nlohmann::json&)>& use);

}  // namespace ringlock
