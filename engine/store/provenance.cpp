#include "engine/store/provenance.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <hdf5.h>
#include <unistd.h>

#include <array>
#include <ctime>
#include <string_view>
#include <utility>

#include "engine/core/version.hpp"

namespace ringlock::store {
namespace {

/// As a POSIX shell would have to be given the word.
std::string quoted(std::string_view word) {
    constexpr std::string_view plain = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-+=./:,@%^";
    if (!word.empty() && word.find_first_not_of(plain) == std::string_view::npos) return std::string(word);
    std::string result = "'";
    for (const char c : word) {
        if (c == '\'')
            result += "'\\''";
        else
            result += c;
    }
    return result + "'";
}

std::string host_name() {
    std::array<char, 256> name{};
    if (gethostname(name.data(), name.size() - 1) != 0) return "unknown";
    return name.data();
}

/// The members in the order of the file, as (name, reference), for writing and reading alike.
template <class P, class Visit>
void each_member(P& p, Visit visit) {
    visit("program_version", p.program_version);
    visit("git_hash", p.git_hash);
    visit("compiler", p.compiler);
    visit("hdf5_version", p.hdf5_version);
    visit("command_line", p.command_line);
    visit("scenario_file", p.scenario_file);
    visit("host", p.host);
    visit("date_utc", p.date_utc);
    visit("threads", p.threads);
    visit("wall_s", p.wall_s);
    visit("turns_per_s", p.turns_per_s);
    visit("instruction_set", p.instruction_set);
}

}  // namespace

Provenance collect_provenance(std::span<const char* const> arguments, std::int64_t threads, std::string scenario_file) {
    Provenance p;
    p.program_version = version();
    p.git_hash = git_hash();
    p.compiler = "GCC " __VERSION__;
    p.hdf5_version = fmt::format("{}.{}.{}", H5_VERS_MAJOR, H5_VERS_MINOR, H5_VERS_RELEASE);
    for (const char* argument : arguments) {
        if (!p.command_line.empty()) p.command_line += ' ';
        p.command_line += quoted(argument);
    }
    p.scenario_file = std::move(scenario_file);
    p.host = host_name();
    p.date_utc = fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::time(nullptr)));
    p.threads = threads;
    return p;
}

void write_provenance(Group& root, const Provenance& provenance) {
    Group group = root.create_group("provenance");
    each_member(provenance, [&](const char* name, const auto& value) { group.set_attribute(name, value); });
}

Provenance read_provenance(const Group& root) {
    const Group group = root.group("provenance");
    Provenance provenance;
    each_member(provenance, [&]<class T>(const char* name, T& value) {
        // Absent from results of earlier programs.
        const bool younger = name == std::string_view("turns_per_s") || name == std::string_view("instruction_set");
        if (younger && !group.has_attribute(name)) return;
        if constexpr (std::same_as<T, std::string>)
            value = group.string_attribute(name);
        else if constexpr (std::same_as<T, double>)
            value = group.double_attribute(name);
        else
            value = group.int_attribute(name);
    });
    return provenance;
}

}  // namespace ringlock::store
