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
#include <dlfcn.h>
#include <librsvg/rsvg.h>

#include <cmath>
#include <memory>
#include <type_traits>
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

/// The functions of librsvg, cairo and GLib that draw. The libraries are loaded when the first picture is drawn, since
/// they and the thirty libraries that they need take a quarter of the time in which the program starts.
struct Drawing {
    decltype(&::rsvg_handle_new_from_data) rsvg_handle_new_from_data = nullptr;
    decltype(&::rsvg_handle_get_intrinsic_size_in_pixels) rsvg_handle_get_intrinsic_size_in_pixels = nullptr;
    decltype(&::rsvg_handle_render_document) rsvg_handle_render_document = nullptr;
    decltype(&::g_object_unref) g_object_unref = nullptr;
    decltype(&::g_error_free) g_error_free = nullptr;
    decltype(&::cairo_image_surface_create) cairo_image_surface_create = nullptr;
    decltype(&::cairo_pdf_surface_create_for_stream) cairo_pdf_surface_create_for_stream = nullptr;
    decltype(&::cairo_pdf_surface_set_metadata) cairo_pdf_surface_set_metadata = nullptr;
    decltype(&::cairo_create) cairo_create = nullptr;
    decltype(&::cairo_destroy) cairo_destroy = nullptr;
    decltype(&::cairo_set_source_rgb) cairo_set_source_rgb = nullptr;
    decltype(&::cairo_paint) cairo_paint = nullptr;
    decltype(&::cairo_surface_write_to_png_stream) cairo_surface_write_to_png_stream = nullptr;
    decltype(&::cairo_surface_finish) cairo_surface_finish = nullptr;
    decltype(&::cairo_surface_status) cairo_surface_status = nullptr;
    decltype(&::cairo_surface_destroy) cairo_surface_destroy = nullptr;
    decltype(&::cairo_status_to_string) cairo_status_to_string = nullptr;
    std::string problem;  ///< empty where all of them were found

    Drawing() {
        // A symbol is searched in the libraries that librsvg needs, too.
        void* library = dlopen("librsvg-2.so.2", RTLD_NOW | RTLD_LOCAL);
        if (library == nullptr) {
            problem = dlerror();
            return;
        }
        const auto find = [&](auto& function, const char* name) {
            function = reinterpret_cast<std::decay_t<decltype(function)>>(dlsym(library, name));
            if (function == nullptr) problem = fmt::format("librsvg-2.so.2 does not lead to {}", name);
        };
        find(rsvg_handle_new_from_data, "rsvg_handle_new_from_data");
        find(rsvg_handle_get_intrinsic_size_in_pixels, "rsvg_handle_get_intrinsic_size_in_pixels");
        find(rsvg_handle_render_document, "rsvg_handle_render_document");
        find(g_object_unref, "g_object_unref");
        find(g_error_free, "g_error_free");
        find(cairo_image_surface_create, "cairo_image_surface_create");
        find(cairo_pdf_surface_create_for_stream, "cairo_pdf_surface_create_for_stream");
        find(cairo_pdf_surface_set_metadata, "cairo_pdf_surface_set_metadata");
        find(cairo_create, "cairo_create");
        find(cairo_destroy, "cairo_destroy");
        find(cairo_set_source_rgb, "cairo_set_source_rgb");
        find(cairo_paint, "cairo_paint");
        find(cairo_surface_write_to_png_stream, "cairo_surface_write_to_png_stream");
        find(cairo_surface_finish, "cairo_surface_finish");
        find(cairo_surface_status, "cairo_surface_status");
        find(cairo_surface_destroy, "cairo_surface_destroy");
        find(cairo_status_to_string, "cairo_status_to_string");
    }
};

const Drawing& drawing() {
    static const Drawing loaded;
    return loaded;
}

struct Free {
    void operator()(RsvgHandle* handle) const { drawing().g_object_unref(handle); }
    void operator()(cairo_surface_t* surface) const { drawing().cairo_surface_destroy(surface); }
    void operator()(cairo_t* context) const { drawing().cairo_destroy(context); }
};
template <class T>
using Owned = std::unique_ptr<T, Free>;

/// The message of an error, which is freed.
std::string taken(GError* error) {
    if (error == nullptr) return "no reason was given";
    std::string text = error->message;
    drawing().g_error_free(error);
    return text;
}

Owned<cairo_surface_t> surface_of(PictureForm picture, double width, double height, std::string& out) {
    const Drawing& draw = drawing();
    constexpr double pt_per_px = 0.75;
    if (picture == PictureForm::png) {
        return Owned<cairo_surface_t>(draw.cairo_image_surface_create(
            CAIRO_FORMAT_RGB24, static_cast<int>(std::ceil(width)), static_cast<int>(std::ceil(height))));
    }
    Owned<cairo_surface_t> pdf(
        draw.cairo_pdf_surface_create_for_stream(append, &out, pt_per_px * width, pt_per_px * height));
    // Without it the file would hold the time at which it was made.
    draw.cairo_pdf_surface_set_metadata(pdf.get(), CAIRO_PDF_METADATA_CREATE_DATE, "1970-01-01T00:00:00Z");
    return pdf;
}

}  // namespace

bool renders_pictures() { return drawing().problem.empty(); }

std::string rendered(const std::string& svg, PictureForm picture, const std::string& shown_as) {
    if (picture == PictureForm::svg) return svg;
    const Drawing& draw = drawing();
    if (!draw.problem.empty()) fail_to_draw(shown_as, draw.problem);
    GError* error = nullptr;
    const Owned<RsvgHandle> handle(
        draw.rsvg_handle_new_from_data(reinterpret_cast<const guint8*>(svg.data()), svg.size(), &error));
    if (!handle) fail_to_draw(shown_as, taken(error));
    double width = 0.0;
    double height = 0.0;
    if (!draw.rsvg_handle_get_intrinsic_size_in_pixels(handle.get(), &width, &height)) {
        fail_to_draw(shown_as, "the drawing has no size in pixels");
    }
    const double scale = picture == PictureForm::png ? 2.0 : 1.0;
    std::string out;
    const Owned<cairo_surface_t> surface = surface_of(picture, scale * width, scale * height, out);
    const Owned<cairo_t> context(draw.cairo_create(surface.get()));
    draw.cairo_set_source_rgb(context.get(), 1.0, 1.0, 1.0);
    draw.cairo_paint(context.get());
    const double unit = picture == PictureForm::png ? scale : 0.75;
    const RsvgRectangle page = {0.0, 0.0, unit * width, unit * height};
    if (!draw.rsvg_handle_render_document(handle.get(), context.get(), &page, &error)) {
        fail_to_draw(shown_as, taken(error));
    }
    if (picture == PictureForm::png) {
        draw.cairo_surface_write_to_png_stream(surface.get(), append, &out);
    } else {
        draw.cairo_surface_finish(surface.get());
    }
    const cairo_status_t status = draw.cairo_surface_status(surface.get());
    if (status != CAIRO_STATUS_SUCCESS && status != CAIRO_STATUS_SURFACE_FINISHED) {
        fail_to_draw(shown_as, draw.cairo_status_to_string(status));
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
            fmt::format("{} {}: only SVG can be drawn here. PNG and PDF need librsvg: install librsvg2-2 where the "
                        "program runs and librsvg2-dev where it is built, or convert an SVG with rsvg-convert",
                        option, printable(file)));
    }
    return ending == ".png" ? PictureForm::png : PictureForm::pdf;
}

}  // namespace ringlock::report
