#include "app/terminal/versions.hpp"

#include <archive.h>
#include <ceres/version.h>
#include <fmt/format.h>
#include <hdf5.h>
#include <lzma.h>
#include <matio.h>
#include <oneapi/tbb/version.h>
#include <toml++/toml.h>
#include <zlib.h>
#include <zstd.h>

#include <CLI/Version.hpp>
#include <Eigen/Core>
#include <array>
#include <boost/version.hpp>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <string_view>
#include <utility>
#include <vector>

#if __has_include("analysis/report/page/page.hpp")
#include "analysis/report/page/page.hpp"
#endif
#include "analysis/report/render.hpp"
#include "engine/core/printable.hpp"
#include "engine/core/version.hpp"
#include "engine/simd/target.hpp"

namespace ringlock::app {
namespace {

template <class... Number>
std::string dotted(Number... numbers) {
    std::string out;
    for (const auto number : {static_cast<unsigned>(numbers)...}) {
        out += fmt::format("{}{}", out.empty() ? "" : ".", number);
    }
    return out;
}

std::vector<std::pair<std::string_view, std::string>> libraries() {
    unsigned hdf5[3] = {};
    H5get_libversion(&hdf5[0], &hdf5[1], &hdf5[2]);
    int matio[3] = {};
    Mat_GetLibraryVersion(&matio[0], &matio[1], &matio[2]);
    std::string archive = archive_version_string();
    archive.erase(0, archive.find_last_of(' ') + 1);
    return {{"HDF5", dotted(hdf5[0], hdf5[1], hdf5[2])},
            {"oneTBB", TBB_runtime_version()},
            {"Eigen", dotted(EIGEN_WORLD_VERSION, EIGEN_MAJOR_VERSION, EIGEN_MINOR_VERSION)},
            {"Boost", dotted(BOOST_VERSION / 100000, BOOST_VERSION / 100 % 1000, BOOST_VERSION % 100)},
            {"Highway", RINGLOCK_HIGHWAY_VERSION},
            {"Ceres", CERES_VERSION_STRING},
            {"fmt", dotted(FMT_VERSION / 10000, FMT_VERSION / 100 % 100, FMT_VERSION % 100)},
            {"toml++", dotted(TOML_LIB_MAJOR, TOML_LIB_MINOR, TOML_LIB_PATCH)},
            {"nlohmann/json",
             dotted(NLOHMANN_JSON_VERSION_MAJOR, NLOHMANN_JSON_VERSION_MINOR, NLOHMANN_JSON_VERSION_PATCH)},
            {"CLI11", CLI11_VERSION},
            {"libarchive", archive},
            {"matio", dotted(matio[0], matio[1], matio[2])},
            {"zlib", zlibVersion()},
            {"liblzma", lzma_version_string()},
            {"Zstandard", ZSTD_versionString()}};
}

/// The first line that a command prints; empty where it does not run.
std::string first_line_of(const char* command) {
    std::FILE* pipe = popen(command, "r");
    if (pipe == nullptr) return "";
    std::array<char, 256> buffer{};
    std::string line = std::fgets(buffer.data(), buffer.size(), pipe) != nullptr ? buffer.data() : "";
    while (std::fgets(buffer.data(), buffer.size(), pipe) != nullptr) continue;
    const bool is_done = pclose(pipe) == 0;
    if (line.ends_with('\n')) line.pop_back();
    return is_done ? line : "";
}

/// Entries of a list in lines of at most 100 columns, under a heading.
std::string wrapped_list(std::string_view heading, const std::vector<std::string>& entries) {
    constexpr std::size_t left = 18;
    constexpr std::size_t columns = 100;
    std::string out;
    std::string line = fmt::format("{:<{}}", heading, left);
    for (std::size_t i = 0; i < entries.size(); ++i) {
        const std::string entry = entries[i] + (i + 1 < entries.size() ? "," : "");
        if (line.size() + 1 + entry.size() > columns) {
            out += line + "\n";
            line = std::string(left, ' ');
        }
        line += line.size() > left ? " " + entry : entry;
    }
    return out + line + "\n";
}

}  // namespace

std::string version_text() {
    std::vector<std::string> names;
    for (const auto& [name, version] : libraries()) names.push_back(fmt::format("{} {}", name, version));
    std::vector<std::string> sets = simd::available_targets();
    for (std::string& set : sets) {
        if (set == simd::active_target()) set += " (in use)";
    }
    const std::string gnuplot = first_line_of("gnuplot --version 2>/dev/null");
    const bool pictures = report::renders_pictures();
    std::string out = fmt::format("ringlock {} ({})\n", version(), git_hash());
    out += wrapped_list("build", {RINGLOCK_BUILD_TYPE, "GCC " __VERSION__,
                                  RINGLOCK_HAS_MPI ? "with MPI (mpirun)" : "without MPI (threads and shards alone)"});
    out += wrapped_list("libraries", names);
    out += wrapped_list("instruction sets", sets);
    out += wrapped_list(
        "figures", {gnuplot.empty() ? "no gnuplot found (Debian package gnuplot-nox)" : printable(gnuplot) + " found",
                    pictures ? "SVG, PNG and PDF" : "SVG alone (librsvg is missing)"});
#if __has_include("analysis/report/page/page.hpp")
    const std::string script = report::page_script();
    out +=
        wrapped_list("pages", {script == "none" ? "with drawn figures (built without the Debian package libjs-dygraphs)"
                                                : "with figures made interactive by " + script});
#endif
    return out;
}

}  // namespace ringlock::app
