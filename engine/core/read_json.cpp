#include "engine/core/read_json.hpp"

#include <fmt/format.h>

#include <cerrno>
#include <fstream>
#include <iterator>
#include <limits>
#include <nlohmann/json.hpp>
#include <system_error>

#include "engine/core/error.hpp"
#include "engine/core/printable.hpp"

namespace ringlock {

namespace {

/// The library's message without its number: "[json.exception.out_of_range.403] key 'verdict' not found".
std::string words_of(const nlohmann::json::exception& error) {
    const std::string_view what = error.what();
    const std::size_t end = what.find("] ");
    return printable(end == std::string_view::npos ? what : what.substr(end + 2));
}

}  // namespace

nlohmann::json parse_json(std::string_view text, bool throws) { return nlohmann::json::parse(text, nullptr, throws); }

double number_or_nan(const nlohmann::json& value) {
    return value.is_null() ? std::numeric_limits<double>::quiet_NaN() : value.get<double>();
}

void read_json(const std::filesystem::path& file, std::string_view expected,
               const std::function<void(const nlohmann::json&)>& use) {
    nlohmann::json value;
    errno = 0;
    std::ifstream in(file, std::ios::binary);
    if (!in || std::filesystem::is_directory(file)) {
        const int reason = errno == 0 ? EISDIR : errno;
        throw InputError(fmt::format("{}: cannot be read: {}; expected is {}", printable(file),
                                     std::generic_category().message(reason), expected));
    }
    try {
        value = parse_json(std::string(std::istreambuf_iterator<char>(in), {}));
    } catch (const nlohmann::json::exception& error) {
        throw InputError(fmt::format("{}: is no JSON: {}; expected is {}", printable(file), words_of(error), expected));
    }
    try {
        use(value);
    } catch (const nlohmann::json::exception& error) {
        throw InputError(fmt::format("{}: {}; expected is {}", printable(file), words_of(error), expected));
    } catch (const InputError& error) {
        const std::string text = error.what();
        if (text.starts_with(printable(file))) throw;
        throw InputError(fmt::format("{}: {}", printable(file), text));
    }
}

}  // namespace ringlock
