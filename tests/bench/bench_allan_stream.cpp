// Nanoseconds a sample and gyro of the streaming Allan sums, for every instruction set, beside a plain loop of the same
// exact arithmetic; side by side in one run, on one thread.
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <functional>
#include <string>
#include <vector>

#include "analysis/allan/octave_stream.hpp"
#include "analysis/report/table.hpp"
#include "engine/random/normal_lanes.hpp"
#include "engine/simd/target.hpp"

namespace {

using namespace ringlock;

__extension__ using Whole = __int128;

constexpr std::size_t samples = 1 << 16;
constexpr std::size_t piece = 64;

/// Angle random walks with steps of that rms.
std::vector<simd::LaneCounts> walks(double step_counts) {
    random::LaneIdentities who;
    who.seed = 1;
    for (std::size_t lane = 0; lane < simd::lanes; ++lane) who.gyro[lane] = lane;
    std::vector<simd::Lanes> normals(samples);
    random::normals(who, random::Purpose::noise_injection, 0, samples, simd::lanes, normals.front().data());
    std::vector<simd::LaneCounts> rows(samples);
    for (std::size_t i = 1; i < samples; ++i) {
        for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
            rows[i][lane] = rows[i - 1][lane] + static_cast<std::int64_t>(step_counts * normals[i][lane]);
        }
    }
    return rows;
}

/// Low bits of all sums: what a contender's work comes to.
std::uint64_t checksum(const std::vector<allan::Octave>& octaves) {
    std::uint64_t sum = 0;
    for (const allan::Octave& octave : octaves) sum += octave.sum.words[0];
    return sum;
}

std::uint64_t stream(const std::vector<simd::LaneCounts>& rows) {
    allan::OctaveStream sums;
    for (std::size_t i = 0; i < samples; i += piece) sums.add({&rows[i], piece}, simd::lanes);
    std::uint64_t sum = 0;
    for (std::size_t lane = 0; lane < simd::lanes; ++lane) sum += checksum(sums.octaves(lane));
    return sum;
}

/// One gyro after the other, from records that are all there.
std::uint64_t plain(const std::vector<std::vector<std::int64_t>>& records) {
    std::uint64_t sum = 0;
    for (const std::vector<std::int64_t>& x : records) {
        for (std::size_t m = 1; 2 * m < samples; m *= 2) {
            const std::size_t stride = std::max<std::size_t>(1, m / allan::OctaveStream::starts_per_tau);
            Whole total = 0;
            for (std::size_t i = 0; i + 2 * m < samples; i += stride) {
                const std::int64_t d = x[i + 2 * m] - 2 * x[i + m] + x[i];
                total += static_cast<Whole>(d) * d;
            }
            sum += static_cast<std::uint64_t>(total);
        }
    }
    return sum;
}

struct Entry {
    std::string name;
    std::string target;  ///< instruction set; empty: what the compiler made of it
    std::function<std::uint64_t()> run;
    std::vector<double> ns = {};
    std::uint64_t result = 0;
};

}  // namespace

int main() {
    // Second differences that fit 32 bits at every octave, and such as do at none.
    const std::vector<simd::LaneCounts> narrow = walks(0x1p18);
    const std::vector<simd::LaneCounts> wide = walks(0x1p36);
    std::vector<std::vector<std::int64_t>> narrow_records(simd::lanes);
    std::vector<std::vector<std::int64_t>> wide_records(simd::lanes);
    for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
        for (const simd::LaneCounts& row : narrow) narrow_records[lane].push_back(row[lane]);
        for (const simd::LaneCounts& row : wide) wide_records[lane].push_back(row[lane]);
    }

    std::vector<Entry> entries;
    entries.push_back({"plain loop over stored records, narrow", "", [&] { return plain(narrow_records); }});
    entries.push_back({"plain loop over stored records, wide", "", [&] { return plain(wide_records); }});
    for (const std::string& target : simd::available_targets()) {
        entries.push_back({"stream, " + target + ", narrow", target, [&] { return stream(narrow); }});
        entries.push_back({"stream, " + target + ", wide", target, [&] { return stream(wide); }});
    }
    constexpr std::size_t rounds = 7;
    for (std::size_t round = 0; round < rounds; ++round) {  // in turns, so that a machine that slows down slows all
        for (Entry& entry : entries) {
            if (!entry.target.empty()) simd::use_target(entry.target);
            const auto start = std::chrono::steady_clock::now();
            entry.result = entry.run();
            const std::chrono::duration<double, std::nano> time = std::chrono::steady_clock::now() - start;
            entry.ns.push_back(time.count() / static_cast<double>(samples * simd::lanes));
        }
    }
    for (Entry& entry : entries) std::sort(entry.ns.begin(), entry.ns.end());

    report::Table table({{"all octaves by", report::Align::left},
                         {"ns per sample and gyro", report::Align::right},
                         {"over the plain loop", report::Align::right},
                         {"same sums", report::Align::left}});
    for (std::size_t i = 0; i < entries.size(); ++i) {
        const Entry& entry = entries[i];
        const Entry& loop = entries[i % 2];
        table.add_row({entry.name, fmt::format("{:.3g}", entry.ns[rounds / 2]),
                       fmt::format("{:.3g}", loop.ns[rounds / 2] / entry.ns[rounds / 2]),
                       entry.result == loop.result ? "yes" : "NO"});
    }
    fmt::print("{}", table.text());
    fmt::print("Median of {} rounds of {} samples of {} gyros, in pieces of {}, one thread.\n", rounds, samples,
               simd::lanes, piece);
    return 0;
}
