#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <limits>

#include "analysis/record/readers.hpp"
#include "analysis/text/words.hpp"
#include "engine/core/error.hpp"
#include "engine/core/printable.hpp"

namespace ringlock::record {
namespace {

[[noreturn]] void fail(const store::Node& node, const std::string& what) {
    throw InputError(fmt::format("{}: {}: {}", printable(node.file()), printable(node.path()), what));
}

std::string shape_text(const store::Shape& shape) {
    std::string text;
    for (const std::uint64_t extent : shape) text += fmt::format("{}{}", text.empty() ? "" : " x ", extent);
    return text;
}

/// The dataset of that name, which must be a column: of one dimension, or of two where one is 1, as MATLAB has them.
store::Dataset open_column(const store::Group& group, const std::string& name) {
    store::Dataset dataset = group.dataset(name);
    const store::Shape& shape = dataset.shape();
    if (shape.empty()) fail(dataset, "is a single value; must be a column, one value a row");
    const auto long_sides = std::count_if(shape.begin(), shape.end(), [](std::uint64_t n) { return n != 1; });
    if (long_sides > 1) fail(dataset, fmt::format("is {}; must be one column", shape_text(shape)));
    constexpr double columns = 8.0;  // of 8 bytes, that a record may have
    double rows = 1.0;
    for (const std::uint64_t extent : shape) rows *= static_cast<double>(extent);
    if (8.0 * columns * rows > memory_bytes()) {
        fail(dataset, fmt::format("has {} rows, more than memory is free for (is the file damaged?); "
                                  "cut the record into pieces",
                                  rows));
    }
    return dataset;
}

std::vector<double> numbers(const store::Group& group, const std::string& name) {
    const store::Dataset dataset = open_column(group, name);
    if (!dataset.holds<double>()) fail(dataset, "must hold numbers");
    return dataset.read<double>();
}

std::vector<std::int64_t> whole_numbers(const store::Group& group, const std::string& name) {
    const store::Dataset dataset = open_column(group, name);
    if (dataset.holds<std::int64_t>()) return dataset.read<std::int64_t>();
    std::vector<std::int64_t> out;
    if (dataset.holds<std::uint64_t>()) {
        const auto values = dataset.read<std::uint64_t>();
        out.reserve(values.size());
        for (const std::uint64_t value : values) {
            if (value > static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max())) {
                fail(dataset, fmt::format("row {} is {}: too large for a count", out.size(), value));
            }
            out.push_back(static_cast<std::int64_t>(value));
        }
        return out;
    }
    if (!dataset.holds<double>()) fail(dataset, "must hold whole numbers");
    const auto values = dataset.read<double>();
    out.reserve(values.size());
    constexpr double largest = 9007199254740992.0;  // 2^53: all whole numbers up to it are doubles
    for (const double value : values) {
        if (!(std::abs(value) <= largest) || value != std::nearbyint(value)) {
            fail(dataset, fmt::format("row {} is {}: must be a whole number", out.size(), value));
        }
        out.push_back(static_cast<std::int64_t>(value));
    }
    return out;
}

std::optional<double> number(const store::Node& node, const char* name) {
    if (!node.has_attribute(name)) return std::nullopt;
    return node.double_attribute(name);
}

/// Without the blanks that fixed lengths are filled up with.
std::string text(const store::Node& node, const char* name) {
    std::string value = node.string_attribute(name);
    value.resize(value.find_last_not_of(' ') + 1);
    return value;
}

void check_format(const store::File& file) {
    if (!file.has_attribute("format")) {
        fail(file, fmt::format("attribute format is missing; "
                               "a record has format = \"{}\" and format_version = {} (docs/record.md)",
                               format_name, format_version));
    }
    const std::string format = text(file, "format");
    if (format != format_name) {
        fail(file,
             fmt::format("format is \"{}\", must be \"{}\"{}", text::shown(format), format_name,
                         format == "ringlock-result" ? "; this is a result, which `ringlock analyze` reads" : ""));
    }
    const std::optional<double> version = number(file, "format_version");
    if (!version) fail(file, fmt::format("attribute format_version is missing; must be {}", format_version));
    if (*version != static_cast<double>(format_version)) {
        fail(file, fmt::format("format_version is {}; this program reads {}", *version, format_version));
    }
}

template <class Known>
void note_ignored(const store::Group& group, const Known& is_known, std::vector<std::string>& ignored) {
    for (const std::string& name : group.children()) {
        if (!is_known(name))
            ignored.push_back(fmt::format("{}{}{}", group.path(), group.path() == "/" ? "" : "/", name));
    }
}

template <class Known>
void note_ignored_attributes(const store::Group& group, const Known& is_known, std::vector<std::string>& ignored) {
    for (const std::string& name : group.attribute_names()) {
        if (!is_known(name)) ignored.push_back(fmt::format("attribute {} of {}", name, group.path()));
    }
}

constexpr std::array turns_names = {"time_s", "direction",           "quarter_count",     "sin",
                                    "cos",    "accel_before_rad_s2", "accel_after_rad_s2"};

bool is_one_of(const auto& names, const std::string& name) {
    return std::any_of(names.begin(), names.end(), [&](const char* known) { return name == known; });
}

Turns read_turns(const store::Group& group, std::vector<std::string>& ignored) {
    Turns turns;
    turns.time_s = numbers(group, "time_s");
    const std::vector<std::int64_t> direction = whole_numbers(group, "direction");
    turns.direction.reserve(direction.size());
    for (const std::int64_t value : direction) {
        if (value != 1 && value != -1) {
            fail(group, fmt::format("direction: row {} is {}; must be +1 at a phase minimum, -1 at a maximum",
                                    turns.direction.size(), value));
        }
        turns.direction.push_back(static_cast<std::int8_t>(value));
    }
    turns.quarter_count = whole_numbers(group, "quarter_count");
    turns.sine = numbers(group, "sin");
    turns.cosine = numbers(group, "cos");
    for (const auto& [name, column] : {std::pair{"accel_before_rad_s2", &turns.accel_before_rad_s2},
                                       std::pair{"accel_after_rad_s2", &turns.accel_after_rad_s2}}) {
        if (group.has(name)) {
            *column = numbers(group, name);
        } else {
            column->assign(turns.size(), 0.0);
        }
    }
    note_ignored(
        group, [](const std::string& name) { return is_one_of(turns_names, name); }, ignored);
    return turns;
}

Samples read_samples(const store::Group& group, std::vector<std::string>& ignored) {
    Samples samples;
    const std::optional<double> rate = number(group, "rate_hz");
    if (!rate) fail(group, "attribute rate_hz is missing; it says how many samples there are a second");
    samples.rate_hz = *rate;
    samples.t0_s = number(group, "t0_s").value_or(0.0);
    std::vector<std::string> kinds;
    for (const SampleKind kind : sample_kinds) {
        if (!group.has(name_of(kind))) continue;
        kinds.emplace_back(name_of(kind));
        samples.kind = kind;
    }
    if (kinds.empty()) {
        fail(group,
             "has no samples; one of the datasets angle_increment_arcsec, angle_arcsec and quarter_count is needed");
    }
    if (kinds.size() > 1) fail(group, fmt::format("has the datasets {}; must have one of them", listed(kinds)));
    if (samples.kind == SampleKind::quarter_count) {
        samples.counts = whole_numbers(group, kinds.front());
    } else {
        samples.values = numbers(group, kinds.front());
    }
    for (const char* name : witness_names) {
        if (group.has(name)) samples.witnesses[name] = numbers(group, name);
    }
    note_ignored(
        group, [&](const std::string& name) { return name == kinds.front() || is_one_of(witness_names, name); },
        ignored);
    note_ignored_attributes(
        group, [](const std::string& name) { return name == "rate_hz" || name == "t0_s"; }, ignored);
    return samples;
}

struct TrackName {
    const char* group;
    const char* dataset;
    Track Record::*field;
};
constexpr std::array<TrackName, 2> track_names = {{{"environment", "temperature_c", &Record::temperature_c},
                                                   {"reference", "input_rate_deg_h", &Record::input_rate_deg_h}}};

Track read_track(const store::Group& group, const TrackName& names, std::vector<std::string>& ignored) {
    Track track;
    const bool there = group.has(names.dataset);
    if (there || group.has("time_s")) {
        track.time_s = numbers(group, "time_s");
        track.value = numbers(group, names.dataset);
    }
    note_ignored(
        group, [&](const std::string& name) { return name == "time_s" || name == names.dataset; }, ignored);
    return track;
}

DeclaredReader read_reader(const store::Group& group, std::vector<std::string>& ignored) {
    DeclaredReader reader;
    for (const std::string& name : group.attribute_names()) {
        std::string wrong;
        const bool known = is_one_of(reader_words, name)
                               ? set_reader_word(reader, name, text(group, name.c_str()), wrong)
                               : set_reader_number(reader, name, group.double_attribute(name.c_str()), wrong);
        if (!known) ignored.push_back(fmt::format("attribute {} of {}", name, group.path()));
        if (!wrong.empty()) fail(group, fmt::format("attribute {} {}", name, wrong));
    }
    return reader;
}

Record read_groups(const store::File& file) {
    check_format(file);
    Record record;
    for (const TextName& name : text_names) {
        if (file.has_attribute(name.name)) record.*name.field = text(file, name.name);
    }
    if (file.has("declared")) {
        const store::Group group = file.group("declared");
        for (const DeclaredName& name : declared_names) record.declared.*name.field = number(group, name.name);
        const auto is_known = [](const std::string& name) {
            return std::any_of(declared_names.begin(), declared_names.end(),
                               [&](const DeclaredName& known) { return name == known.name; });
        };
        note_ignored_attributes(group, is_known, record.ignored);
        note_ignored(
            group, [](const std::string&) { return false; }, record.ignored);
    }
    if (file.has("turns")) record.turns = read_turns(file.group("turns"), record.ignored);
    if (file.has("samples")) record.samples = read_samples(file.group("samples"), record.ignored);
    for (const TrackName& names : track_names) {
        if (file.has(names.group)) record.*names.field = read_track(file.group(names.group), names, record.ignored);
    }
    if (file.has("reader")) record.reader = read_reader(file.group("reader"), record.ignored);
    constexpr std::array groups = {"declared", "reader", "turns", "samples", "environment", "reference"};
    note_ignored(
        file, [&](const std::string& name) { return is_one_of(groups, name); }, record.ignored);
    constexpr std::size_t most_ignored = 20;
    if (const std::size_t all = record.ignored.size(); all > most_ignored + 1) {
        record.ignored.resize(most_ignored);
        record.ignored.push_back(fmt::format("each of {} more names", all - most_ignored));
    }
    return record;
}

void write_turns(store::Group group, const Turns& turns) {
    group.write("time_s", turns.time_s, {"s", "when the phase rate crosses zero"});
    group.write("direction", turns.direction, {"1", "+1 at a minimum of the phase, -1 at a maximum"});
    group.write("quarter_count", turns.quarter_count, {"1", "up/down count of quarter fringes: floor(phase/(pi/2))"});
    group.write("sin", turns.sine, {"1", "sine detector at the zero-rate point, any scale"});
    group.write("cos", turns.cosine, {"1", "cosine detector, the same scale"});
    if (!turns.accel_before_rad_s2.empty() || turns.time_s.empty()) {
        group.write(
            "accel_before_rad_s2", turns.accel_before_rad_s2,
            {"rad/s^2", "size of the phase acceleration by the two nearest pulses before the turn; 0: not seen"});
    }
    if (!turns.accel_after_rad_s2.empty() || turns.time_s.empty()) {
        group.write(
            "accel_after_rad_s2", turns.accel_after_rad_s2,
            {"rad/s^2", "size of the phase acceleration by the two nearest pulses after the turn; 0: not seen"});
    }
}

void write_samples(store::Group group, const Samples& samples) {
    group.set_attribute("rate_hz", samples.rate_hz);
    group.set_attribute("t0_s", samples.t0_s);
    const char* name = name_of(samples.kind);
    switch (samples.kind) {
        case SampleKind::angle_increment_arcsec:
            group.write(name, samples.values, {"arcsec", "angle gained in each sampling interval"});
            break;
        case SampleKind::angle_arcsec:
            group.write(name, samples.values, {"arcsec", "angle since the start"});
            break;
        case SampleKind::quarter_count:
            group.write(name, samples.counts, {"1", "up/down count of quarter fringes since the start"});
            break;
    }
    for (const auto& [witness, values] : samples.witnesses) {
        if (witness == "temperature_c") {
            group.write(witness, values, {"degC", "temperature at the samples"});
        } else {
            group.write(witness, values, {"1", "acceleration of the case along that axis, any scale"});
        }
    }
}

}  // namespace

Record read_hdf5_record(const std::string& path, store::Links links) {
    return store::guarded(path, links,
                          [](const store::GuardedPath& guarded) { return read_groups(store::File::open(guarded)); });
}

std::string hdf5_format(const std::string& path, store::Links links) {
    return store::guarded(path, links, [](const store::GuardedPath& guarded) {
        const store::File file = store::File::open(guarded);
        return file.has_attribute("format") ? text(file, "format") : std::string();
    });
}

namespace {

/// The path, where no other file than a record would be lost.
const std::string& refuse_to_lose(const std::string& path) {
    std::error_code ignored;
    if (!std::filesystem::is_regular_file(path, ignored)) return path;
    bool record = false;
    if (is_hdf5(path)) {
        try {
            record = hdf5_format(path) == format_name;
        } catch (const InputError&) {
            record = false;
        }
    }
    if (record) return path;
    throw InputError(fmt::format(
        "cannot write {}: it exists and is not an rlg-record in HDF5; name another file or move it away", path));
}

}  // namespace

RecordWriter::RecordWriter(const std::string& path) : file_(refuse_to_lose(path)) {}

void write_record(const std::string& path, const Record& record) { RecordWriter(path).write(record); }

void RecordWriter::write(const Record& record) {
    store::File& file = file_.file();
    file.set_attribute("format", format_name);
    file.set_attribute("format_version", format_version);
    for (const TextName& name : text_names) {
        if (!(record.*name.field).empty()) file.set_attribute(name.name, record.*name.field);
    }
    const auto is_given = [&](const DeclaredName& name) { return (record.declared.*name.field).has_value(); };
    if (std::any_of(declared_names.begin(), declared_names.end(), is_given)) {
        store::Group declared = file.create_group("declared");
        for (const DeclaredName& name : declared_names) {
            if (is_given(name)) declared.set_attribute(name.name, *(record.declared.*name.field));
        }
    }
    if (record.turns) write_turns(file.create_group("turns"), *record.turns);
    if (record.samples) write_samples(file.create_group("samples"), *record.samples);
    if (record.reader) {
        store::Group group = file.create_group("reader");
        DeclaredReader reader = *record.reader;
        group.set_attribute("stripping",
                            reader::stripping_names.at(static_cast<std::size_t>(reader.settings.stripping)));
        group.set_attribute("fraction", reader::fraction_names.at(static_cast<std::size_t>(reader.settings.fraction)));
        group.set_attribute("fir_order", reader.settings.fir_order);
        for (const ReaderName& name : reader_names) group.set_attribute(name.name, name.field(reader));
    }
    for (const TrackName& names : track_names) {
        const Track& track = record.*names.field;
        if (track.time_s.empty() && track.value.empty()) continue;
        store::Group group = file.create_group(names.group);
        group.write("time_s", track.time_s, {"s", "times of the rows"});
        const bool temperature = names.field == &Record::temperature_c;
        group.write(names.dataset, track.value,
                    temperature ? store::Label{"degC", "temperature of the gyro, linear between the rows"}
                                : store::Label{"deg/h", "rate about the input axis, linear between the rows"});
    }
    file_.commit();
}

}  // namespace ringlock::record
