// Hundreds of records with known truth, which the closed loop reads blind.
//
//   bench_closure FOLDER [--share S] [--only KIND] [--multiple M] [--effect E,F] [--without E,F] [--device NAME]
//                 [--direct] [--seed N] [--series N] [--length S]
//
// FOLDER gets records.csv (a row a record), deviations.csv (estimates less truth, in standard errors), confusion.csv
// and the tables of the page: figures.md, misses.md, confusion.md, calibration.md. A share S of 0.1 makes a tenth of
// the records; with a seed only that record is made, and kept as record.h5. Another series has records of the same
// kinds that no other has. --effect and --without say which effects of the library are drawn, --multiple at which
// multiple of their detection limits, --device whose constants stand in place of the paper's in nulls, single effects
// and pairs, --direct that all records are by the integration of the equation of motion. A share above 1 makes more
// records of a kind, --length records of S seconds in place of 16 000 turns, but none with effects that the library
// does not have. tools/closure puts the tables into the page.
#include <fmt/format.h>
#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <iterator>
#include <random>
#include <string>
#include <vector>

#include "analysis/record/record.hpp"
#include "engine/core/error.hpp"
#include "engine/effects/effect.hpp"
#include "tests/closure/suite/bench_tables.hpp"
#include "tests/closure/suite/suite.hpp"

namespace {

namespace record = ringlock::record;
using namespace ringlock::test::closure;

// Sizes of single effects, of the detection limit.
constexpr double near_the_limit[] = {1.0, 2.0};
constexpr double evident[] = {6.0, 30.0, 150.0};

constexpr double of_other_gyros = 6.0;
constexpr double of_several[] = {5.0, 10.0, 30.0};
constexpr double of_mixed = 6.0;

/// Whether a gyro in that condition shows the effect at all.
bool shows(const std::string& effect, const Condition& condition) {
    return effect != "scale_factor_error" || condition.moving;
}

void take_length(const Command& command, Case& of) {
    if (!command.length_s) return;
    of.turns =
        static_cast<std::size_t>(std::lround(static_cast<double>(of.turns) * *command.length_s / duration_s(of)));
}

}  // namespace

int main(int argc, char** argv) {
    const Command command = command_of(argc, argv, "bench_closure");
    const std::vector<std::string> effects = command.kept(effects_on_turns());

    std::vector<Case> cases;
    const std::uint64_t first_seed = seeds_of_series * command.series + 1000;
    const std::uint64_t first_draw = seeds_of_series * command.series;
    const auto add = [&](Case of) {
        of.seed = first_seed + cases.size();
        of.direct = of.direct || command.direct || cases.size() % 8 == 0;
        cases.push_back(std::move(of));
    };
    if (command.wants(Kind::null)) {
        for (std::size_t k = 0; k < command.scaled(520); ++k) {
            Case of{.kind = Kind::null, .truth = {}, .condition = &conditions[k % conditions.size()]};
            of.gyro = command.gyro;
            take_length(command, of);
            add(std::move(of));
        }
    }
    if (command.wants(Kind::single) || command.wants(Kind::pair)) {
        std::size_t turn = 0;
        const auto pick = [&](const std::string& effect, double multiple, Case& of) {
            of.truth.push_back(
                draw(effect, multiple * start_size(effect), first_draw + 7 * cases.size() + turn, duration_s(of)));
        };
        const auto singles = [&](double multiple, double each) {
            for (std::size_t k = 0; command.wants(Kind::single) && k < command.scaled(each); ++k) {
                for (const std::string& effect : effects) {
                    const Condition* condition = &conditions[(k + turn++) % conditions.size()];
                    while (!shows(effect, *condition)) condition = &conditions[turn++ % conditions.size()];
                    Case of{.kind = Kind::single, .truth = {}, .multiple = multiple, .condition = condition};
                    of.gyro = command.gyro;
                    take_length(command, of);
                    pick(effect, multiple, of);
                    add(std::move(of));
                }
            }
        };
        for (const double multiple : near_the_limit) singles(multiple, 6);
        for (std::size_t a = 0, k = 0; command.wants(Kind::pair) && a < effects.size(); ++a) {
            for (std::size_t b = a + 1; b < effects.size(); ++b, ++k) {
                if (k % command.every(2.0) != 0) continue;
                const Condition& condition = conditions[k % conditions.size()];
                if (!shows(effects[a], condition) || !shows(effects[b], condition)) continue;
                Case of{.kind = Kind::pair, .truth = {}, .multiple = 2.0, .condition = &condition};
                of.gyro = command.gyro;
                take_length(command, of);
                pick(effects[a], 2.0, of);
                pick(effects[b], 2.0, of);
                add(std::move(of));
            }
        }
        for (const double multiple : evident) singles(multiple, 4);
    }
    const auto another = [&](Kind kind, double multiple, std::initializer_list<std::string> in) {
        Case of{.kind = kind, .truth = {}, .multiple = multiple, .condition = &other_gyro};
        of.seed = first_seed + cases.size();
        take_length(command, of);
        const double length_s = duration_s(of);
        for (const std::string& effect : in) {
            of.truth.push_back(
                draw(effect, multiple * start_size(effect), first_draw + 7 * cases.size() + of.truth.size(), length_s));
        }
        add(std::move(of));
    };
    if (command.wants(Kind::other)) {
        for (std::size_t k = 0; k < command.scaled(60); ++k) another(Kind::other, 0.0, {});
        for (std::size_t k = 0; k < command.scaled(3); ++k) {
            for (const std::string& effect : effects) {
                if (shows(effect, other_gyro)) another(Kind::other, of_other_gyros, {effect});
            }
        }
    }
    if (command.wants(Kind::several)) {
        std::vector<std::string> shown;
        std::copy_if(effects.begin(), effects.end(), std::back_inserter(shown),
                     [](const std::string& effect) { return shows(effect, other_gyro); });
        std::mt19937_64 random(first_seed);
        for (std::size_t k = 0; k < command.scaled(72); ++k) {
            std::shuffle(shown.begin(), shown.end(), random);
            const double multiple = of_several[k % std::size(of_several)];
            if (k % 2 == 0) {
                another(Kind::several, multiple, {shown[0], shown[1]});
            } else {
                another(Kind::several, multiple, {shown[0], shown[1], shown[2]});
            }
        }
    }
    if (command.wants(Kind::foreign) && !command.length_s) {
        for (Case& of : foreign_cases(command.scaled(12), command.series)) cases.push_back(std::move(of));
    }
    if (command.wants(Kind::mixed) && !command.length_s) {
        std::size_t next = 0;
        std::uint64_t seed = seeds_of_series * command.series + 70000;
        for (Case& of : foreign_cases(command.scaled(6), command.series)) {
            while (!shows(effects[next % effects.size()], *of.condition)) ++next;
            const std::string& effect = effects[next++ % effects.size()];
            of.kind = Kind::mixed;
            of.multiple = of_mixed;
            of.seed = seed++;
            of.truth.push_back(draw(effect, of_mixed * start_size(effect), of.seed, duration_s(of)));
            cases.push_back(std::move(of));
        }
    }

    std::erase_if(cases, [&](const Case& of) {
        return (!command.seed.empty() && std::to_string(of.seed) != command.seed) || !command.wants(of.multiple);
    });
    // Neighbours by the same way of making: the generator takes several records at a time.
    std::stable_sort(cases.begin(), cases.end(), [](const Case& a, const Case& b) { return a.direct > b.direct; });
    const std::string length = command.length_s ? fmt::format("{:g} s", *command.length_s) : "16 000 turns";
    Tables tables(command.folder, cases.size(), "rad", length.c_str());
    constexpr std::size_t together = 8;
    oneapi::tbb::parallel_for(std::size_t{0}, (cases.size() + together - 1) / together, [&](std::size_t group) {
        const std::size_t first = group * together;
        const std::size_t count = std::min(together, cases.size() - first);
        std::vector<char> settled(count, 1);
        oneapi::tbb::parallel_for(std::size_t{0}, count, [&](std::size_t k) {
            Case& of = cases[first + k];
            if (of.multiple == 0.0) return;
            try {
                settled[k] = settle(of) ? 1 : 0;
                if (!settled[k]) fmt::print(stderr, "record {} cannot show {}\n", of.seed, of.truth_text());
            } catch (const std::exception& error) {
                settled[k] = 0;
                fmt::print(stderr, "limits of record {} ({}): {}\n", of.seed, of.truth_text(), error.what());
            }
        });
        const auto records = make(std::span(cases).subspan(first, count));
        for (std::size_t k = first; k < first + count; ++k) {
            const Case& of = cases[k];
            const record::Record& record = records[k - first];
            if (settled[k - first]) {
                if (!command.seed.empty()) record::write_record(command.folder + "/record.h5", record);
                try {
                    const std::string where(of.foreign.empty() ? "" : ringlock::closure::name_of(of.where));
                    tables.keep(k,
                                {of.kind, of.truth_text(), of.multiple, of.condition->name,
                                 of.direct ? "equation" : "map", of.seed, values_of(of.added()), where},
                                judge(of, record));
                } catch (const std::exception& error) {
                    fmt::print(stderr, "record {} ({}): {}\n", of.seed, of.truth_text(), error.what());
                }
            }
            tables.count();
        }
    });
    tables.write();
    return 0;
}
