#pragma once
#include <string_view>

/// Constant parts of a page, embedded when the program is built (cmake/EmbedPage.cmake).
namespace ringlock::report::assets {

extern const std::string_view style;         ///< page.css
extern const std::string_view style_sha256;  ///< 64 digits
/// dygraphs with its licence as a comment, then page.js; empty where dygraphs was missing.
extern const std::string_view script;
extern const std::string_view script_sha256;
extern const std::string_view script_name;  ///< "dygraphs 2.2.1"; empty likewise

}  // namespace ringlock::report::assets
