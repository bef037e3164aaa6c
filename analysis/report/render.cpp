#include "analysis/report/render.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <filesystem>

#include "engine/core/error.hpp"
#include "engine/core/printable.hpp"

#ifdef RINGLOCK_RSVG
#include <cairo-pdf.h>
#include <cairo.h>
#include <librsvg/rsvg.h>

#include <cmath>
#include <memory>
#endif

namespace ringlock::report {

#ifdef RINGLOCK_RSVG
namespace {

[[noreturn]] void fail_to_draw(const std::string& shown_as, const std::string& why) {
    throw RunError(fmt::format("cannot draw {}: {}", shown_as, why));
}

cairo_status_t append(void* text, const unsigned char* data, unsigned int size) {
    static_cast<std::string*>(text)->append(reinterpret_cast<const char*>(data), size);
    return CAIRO_STATUS_SUCCESS;
}

struct Free {
    void operator()(RsvgHandle* handle) const { g_object_unref(handle); }
    void operator()(cairo_surface_t* surface) const { cairo_surface_destroy(surface); }
    void operator()(cairo_t* context) const { cairo_destroy(context); }
};
template <class T>
using Owned = std::unique_ptr<T, Free>;

/// What went wrong, and the end of its account.
std::string taken(GError* error) {
    std::string text = error != nullptr ? error->message : "no reason was given";
    g_clear_error(&error);
    return text;
}

Owned<cairo_surface_t> surface_of(PictureForm picture, double width, double height, std::string& out) {
    constexpr double pt_per_px = 0.75;
    if (picture == PictureForm::png) {
        return Owned<cairo_surface_t>(cairo_image_surface_create(CAIRO_FORMAT_RGB24, static_cast<int>(std::ceil(width)),
                                                                 static_cast<int>(std::ceil(height))));
    }
    Owned<cairo_surface_t> pdf(
        cairo_pdf_surface_create_for_stream(append, &out, pt_per_px * width, pt_per_px * height));
    // Without it the file would hold the time at which it was made.
    cairo_pdf_surface_set_metadata(pdf.get(), CAIRO_PDF_METADATA_CREATE_DATE, "1970-01-01T00:00:00Z");
    return pdf;
}

}  // namespace

bool renders_pictures() { return true; }

std::string rendered(const std::string& svg, PictureForm picture, const std::string& shown_as) {
    if (picture == PictureForm::svg) return svg;
    GError* error = nullptr;
    const Owned<RsvgHandle> handle(
        rsvg_handle_new_from_data(reinterpret_cast<const guint8*>(svg.data()), svg.size(), &error));
    if (!handle) fail_to_draw(shown_as, taken(error));
    double width = 0.0;
    double height = 0.0;
    if (!rsvg_handle_get_intrinsic_size_in_pixels(handle.get(), &width, &height)) {
        fail_to_draw(shown_as, "the drawing has no size in pixels");
    }
    const double scale = picture == PictureForm::png ? 2.0 : 1.0;
    std::string out;
    const Owned<cairo_surface_t> surface = surface_of(picture, scale * width, scale * height, out);
    const Owned<cairo_t> context(cairo_create(surface.get()));
    cairo_set_source_rgb(context.get(), 1.0, 1.0, 1.0);
    cairo_paint(context.get());
    const double unit = picture == PictureForm::png ? scale : 0.75;
    const RsvgRectangle page = {0.0, 0.0, unit * width, unit * height};
    if (!rsvg_handle_render_document(handle.get(), context.get(), &page, &error)) fail_to_draw(shown_as, taken(error));
    if (picture == PictureForm::png) {
        cairo_surface_write_to_png_stream(surface.get(), append, &out);
    } else {
        cairo_surface_finish(surface.get());
    }
    const cairo_status_t status = cairo_surface_status(surface.get());
    if (status != CAIRO_STATUS_SUCCESS && status != CAIRO_STATUS_SURFACE_FINISHED) {
        fail_to_draw(shown_as, cairo_status_to_string(status));
    }
    if (out.empty()) fail_to_draw(shown_as, "cairo left it empty (is the memory full?)");
    return out;
}
#else
bool renders_pictures() { return false; }

std::string rendered(const std::string& svg, PictureForm picture, const std::string& shown_as) {
    if (picture == PictureForm::svg) return svg;
    throw RunError(fmt::format("cannot draw {}: this build has no librsvg", shown_as));
}
#endif

PictureForm picture_of(const std::string& file, std::string_view option) {
    std::string ending = std::filesystem::path(file).extension().string();
    std::transform(ending.begin(), ending.end(), ending.begin(),
                   [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    if (ending == ".svg") return PictureForm::svg;
    if (ending != ".png" && ending != ".pdf") {
        throw InputError(
            fmt::format("{} {}: the name of a figure must end in .svg, .png or .pdf", option, printable(file)));
    }
    if (!renders_pictures()) {
        throw InputError(
            fmt::format("{} {}: this build draws SVG only. For PNG and PDF install librsvg2-dev and build "
                        "ringlock again, or convert an SVG: rsvg-convert -o {} FIGURE.svg",
                        option, printable(file), printable(file)));
    }
    return ending == ".png" ? PictureForm::png : PictureForm::pdf;
}

}  // namespace ringlock::report
