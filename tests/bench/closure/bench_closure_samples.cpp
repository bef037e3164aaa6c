// Hundreds of records of uniform samples with known truth, which the closed loop reads blind.
//
//   bench_closure_samples FOLDER [--share S] [--only KIND] [--seed N] [--series N] [--length S] [--rate HZ]
//
// FOLDER gets records.csv (a row a record), deviations.csv (estimates less truth, in standard errors), confusion.csv
// and the tables of the page: figures.md, misses.md, confusion.md, calibration.md. A share S of 0.1 makes a tenth of
// the records; with a seed only that record is made, and kept as record.h5. `tools/closure --samples` puts the tables
// into the page.
#include <fmt/format.h>
#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <random>
#include <string>
#include <vector>

#include "tests/closure/suite/bench_tables.hpp"
#include "tests/closure/suite/sample_suite.hpp"

namespace {

using namespace ringlock::test::closure;

constexpr double of_several[] = {5.0, 10.0, 30.0};
constexpr double of_mixed = 6.0;

/// Length, rate and dither as the command line wants them.
void take_length(const Command& command, SampleCase& of) {
    if (!command.length_s && !command.rate_hz) return;
    const double length_s = command.length_s.value_or(of.duration_s());
    of.rate_hz = command.rate_hz.value_or(of.rate_hz);
    of.size = static_cast<std::size_t>(std::lround(length_s * of.rate_hz));
    std::mt19937_64 random(of.seed ^ 0xd17e);
    of.other_dither_hz = std::uniform_real_distribution<double>(110.0, 600.0)(random);
}

std::vector<SampleCase> all_cases(const Command& command) {
    const std::vector<std::string> effects = command.kept(effects_on_samples());
    std::vector<SampleCase> cases;
    std::size_t turn = 0;
    std::uint64_t seed = seeds_of_series * command.series + 20000;
    const auto add = [&](Kind kind, double multiple, const std::vector<std::string>& in) {
        SampleCase of{.kind = kind, .truth = {}, .multiple = multiple, .condition = nullptr, .seed = seed++};
        for (std::size_t tried = 0; tried < sample_conditions.size() && of.condition == nullptr; ++tried) {
            const SampleCondition* condition = &sample_conditions[turn++ % sample_conditions.size()];
            bool shown = true;
            for (const std::string& effect : in) shown = shown && shows(effect, *condition);
            if (shown) of.condition = condition;
        }
        if (of.condition == nullptr) return;
        take_length(command, of);
        for (const std::string& effect : in) of.truth.push_back(draw_on_samples(effect, of));
        cases.push_back(std::move(of));
    };
    for (std::size_t k = 0; k < command.scaled(240); ++k) add(Kind::null, 0.0, {});
    for (const double multiple : {1.0, 2.0}) {
        for (std::size_t k = 0; k < command.scaled(8); ++k) {
            for (const std::string& effect : effects) {
                if (multiple > 1.0 || has_size(effect)) add(Kind::single, multiple, {effect});
            }
        }
    }
    std::size_t pair = 0;
    for (std::size_t a = 0; a < effects.size(); ++a) {
        for (std::size_t b = a + 1; b < effects.size(); ++b, ++pair) {
            if (pair % command.every(1.0) == 0) add(Kind::pair, 2.0, {effects[a], effects[b]});
        }
    }
    // What is evident must be named as surely: a loop made for what hardly shows may break there.
    for (const double multiple : {6.0, 30.0, 150.0}) {
        for (std::size_t k = 0; k < command.scaled(4); ++k) {
            for (const std::string& effect : effects) {
                if (has_size(effect)) add(Kind::single, multiple, {effect});
            }
        }
    }
    std::vector<std::string> sized;
    std::copy_if(effects.begin(), effects.end(), std::back_inserter(sized), has_size);
    std::mt19937_64 random(seed);
    for (std::size_t k = 0; k < command.scaled(72); ++k) {
        std::shuffle(sized.begin(), sized.end(), random);
        const double multiple = of_several[k % std::size(of_several)];
        add(Kind::several, multiple, {sized.begin(), sized.begin() + (k % 2 == 0 ? 2 : 3)});
    }
    for (SampleCase& of : foreign_sample_cases(command.scaled(10), command.series)) {
        // Their effects were drawn for the length that they have.
        if (!command.length_s && !command.rate_hz) cases.push_back(std::move(of));
    }
    std::uint64_t mixed_seed = seeds_of_series * command.series + 70000;
    std::size_t next = 0;
    for (SampleCase& of : foreign_sample_cases(command.scaled(5), command.series)) {
        if (command.length_s || command.rate_hz) break;
        while (!shows(effects[next % effects.size()], *of.condition)) ++next;
        of.kind = of.foreign.empty() ? Kind::several : Kind::mixed;
        of.multiple = of_mixed;
        of.seed = mixed_seed++;
        of.truth.push_back(draw_on_samples(effects[next++ % effects.size()], of));
        cases.push_back(std::move(of));
    }
    std::erase_if(cases, [&](const SampleCase& of) { return !command.wants(of.kind); });
    return cases;
}

}  // namespace

int main(int argc, char** argv) {
    const Command command = command_of(argc, argv, "bench_closure_samples");
    if (command.gyro) {
        fmt::print(stderr, "bench_closure_samples has no --device: samples do not show the gyro's constants\n");
        return 2;
    }
    std::vector<SampleCase> cases = all_cases(command);
    std::erase_if(cases, [&](const SampleCase& of) {
        return (!command.seed.empty() && std::to_string(of.seed) != command.seed) || !command.wants(of.multiple);
    });
    const std::string length = cases.empty() ? "" : fmt::format("{} samples", cases.front().size);
    Tables tables(command.folder, cases.size(), "arcsec", length.c_str());
    oneapi::tbb::parallel_for(std::size_t{0}, cases.size(), [&](std::size_t k) {
        try {
            if (cases[k].multiple > 0.0) settle(cases[k]);
            const auto record = make(cases[k]);
            if (!command.seed.empty()) ringlock::record::write_record(command.folder + "/record.h5", record);
            const SampleCase& of = cases[k];
            const std::string where(of.foreign.empty() ? "" : ringlock::closure::name_of(of.where));
            tables.keep(k,
                        {of.kind, of.truth_text(), of.multiple, of.condition->name, "samples", of.seed,
                         values_of(of.added()), where},
                        judge(of, record));
        } catch (const std::exception& error) {
            fmt::print(stderr, "record {} ({}): {}\n", cases[k].seed, cases[k].truth_text(), error.what());
        }
        tables.count();
    });
    tables.write();
    return 0;
}
