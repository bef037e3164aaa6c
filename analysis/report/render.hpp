#pragma once
#include <string>
#include <string_view>

namespace ringlock::report {

/// Forms of a picture.
enum class PictureForm { svg, png, pdf };

/// Whether PNG and PDF can be drawn: librsvg is known to this build and installed where it runs. The first call loads
/// it.
bool renders_pictures();

/// The form that the ending of a file's name stands for: .svg, .png or .pdf, in small letters or capitals. `option`
/// names the file in errors. Throws InputError where it is another, or one that this build does not make.
PictureForm picture_of(const std::string& file, std::string_view option);

/// An SVG with a size in pixels as that form: itself, a PNG of twice the size, or a PDF of one page in which 96 pixels
/// are an inch. The same SVG always gives the same bytes under the same libraries. `shown_as` names it in errors.
/// Throws RunError where it cannot be drawn.
std::string rendered(const std::string& svg, PictureForm picture, const std::string& shown_as);

}  // namespace ringlock::report
