#include "analysis/record/record.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>

#include "analysis/record/readers.hpp"
#include "engine/core/error.hpp"
#include "engine/core/free_memory.hpp"
#include "engine/core/printable.hpp"

namespace ringlock::record {

double Track::at(double time) const {
    const auto after = std::upper_bound(time_s.begin(), time_s.end(), time);
    if (after == time_s.begin()) return value.front();
    if (after == time_s.end()) return value.back();
    const auto i = static_cast<std::size_t>(after - time_s.begin());
    const double share = (time - time_s[i - 1]) / (time_s[i] - time_s[i - 1]);
    return value[i - 1] + share * (value[i] - value[i - 1]);
}

namespace {

template <class Value, class Names>
void set_word(Value& value, const Names& names, const std::string& word, std::string& wrong) {
    const auto found = std::find(names.begin(), names.end(), word);
    if (found == names.end()) {
        wrong = fmt::format("is \"{}\"; must be one of {}", word, fmt::join(names, ", "));
        return;
    }
    value = static_cast<Value>(found - names.begin());
}

}  // namespace

bool set_reader_word(DeclaredReader& reader, const std::string& name, const std::string& word, std::string& wrong) {
    if (name == "stripping") {
        set_word(reader.settings.stripping, reader::stripping_names, word, wrong);
    } else if (name == "fraction") {
        set_word(reader.settings.fraction, reader::fraction_names, word, wrong);
    } else {
        return false;
    }
    return true;
}

bool set_reader_number(DeclaredReader& reader, const std::string& name, double value, std::string& wrong) {
    constexpr double largest = 1e6;
    const bool gain = name == "reference_gain_error_relative";
    const auto refuse = [&](const char* allowed) { wrong = fmt::format("is {}; must be {}", value, allowed); };
    if (name == "fir_order") {
        if (!(value >= 0.0 && value <= largest) || value != std::nearbyint(value)) {
            refuse("a whole number that is not negative");
        } else {
            reader.settings.fir_order = static_cast<std::int64_t>(value);
        }
        return true;
    }
    for (const ReaderName& known : reader_names) {
        if (name != known.name) continue;
        if (!(std::abs(value) <= largest) || (value < 0.0 && !gain)) {
            refuse(gain ? "a finite number" : "a finite number that is not negative");
        } else {
            known.field(reader) = value;
        }
        return true;
    }
    return false;
}

const char* name_of(SampleKind kind) {
    switch (kind) {
        case SampleKind::angle_increment_arcsec:
            return "angle_increment_arcsec";
        case SampleKind::angle_arcsec:
            return "angle_arcsec";
        case SampleKind::quarter_count:
            break;
    }
    return "quarter_count";
}

double memory_bytes() {
    static const auto bytes = static_cast<double>(free_memory_bytes());
    return bytes;
}

bool is_hdf5(const std::string& path) {
    std::error_code ignored;
    if (std::filesystem::is_directory(path, ignored)) {
        throw InputError(fmt::format("{}: is a directory, must be a data file", printable(path)));
    }
    // A pipe must be opened and read once only, and is always text.
    if (std::filesystem::exists(path, ignored) && !std::filesystem::is_regular_file(path, ignored)) return false;
    constexpr std::array<unsigned char, 8> signature = {0x89, 'H', 'D', 'F', '\r', '\n', 0x1a, '\n'};
    const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(path.c_str(), "rb"), &std::fclose);
    if (!file) throw InputError(fmt::format("{}: cannot be opened: {}", printable(path), std::strerror(errno)));
    // At the start, or behind a block of the user's of 512, 1024, ... bytes, which MATLAB writes.
    for (long at = 0; at >= 0 && at < (1L << 40); at = at == 0 ? 512 : 2 * at) {
        std::array<unsigned char, 8> head{};
        if (std::fseek(file.get(), at, SEEK_SET) != 0) return false;
        if (std::fread(head.data(), 1, head.size(), file.get()) != head.size()) return false;
        if (head == signature) return true;
    }
    return false;
}

void refuse_errors(const std::string& path, const Record& record) {
    constexpr std::size_t most = 20;
    std::string report;
    std::size_t errors = 0;
    for (const Finding& finding : check(record)) {
        if (finding.severity != Severity::error) continue;
        if (++errors > most) continue;
        report += fmt::format("{}{}: {}: {}", report.empty() ? "" : "\n", printable(path), printable(finding.where),
                              finding.what);
    }
    if (errors > most) report += fmt::format("\n{}: and {} more", printable(path), errors - most);
    if (errors > 0) throw InputError(report);
}

Record read_record(const std::string& path, store::Links links) {
    Record record = is_hdf5(path) ? read_hdf5_record(path, links) : read_csv_record(path);
    refuse_errors(path, record);
    return record;
}

}  // namespace ringlock::record
