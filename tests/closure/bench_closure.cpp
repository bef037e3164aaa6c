// Hundreds of records with known truth, which the closed loop reads blind.
//
//   bench_closure FOLDER [--share S] [--only KIND] [--seed N]
//
// FOLDER gets records.csv (a row a record), deviations.csv (estimates less truth, in standard errors), confusion.csv
// and the tables of the page: figures.md, confusion.md, calibration.md. A share S of 0.1 makes a tenth of the records;
// with a seed only that record is made, and kept as record.h5. tools/closure puts the tables into the page.
#include <fmt/format.h>
#include <fmt/ostream.h>
#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "analysis/record/record.hpp"
#include "engine/core/error.hpp"
#include "engine/effects/effect.hpp"
#include "tests/closure/bench_tables.hpp"
#include "tests/closure/suite.hpp"

namespace {

using namespace ringlock::test::closure;

/// Whether a gyro in that condition shows the effect at all.
bool shows(const std::string& effect, const Condition& condition) {
    return effect != "scale_factor_error" || condition.moving;
}

}  // namespace

int main(int argc, char** argv) {
    double share = 1.0;
    std::string only;
    std::string folder;
    std::string seed;
    for (int k = 1; k < argc; ++k) {
        const std::string_view argument = argv[k];
        if (argument == "--share" && k + 1 < argc) {
            share = std::strtod(argv[++k], nullptr);
        } else if (argument == "--only" && k + 1 < argc) {
            only = argv[++k];
        } else if (argument == "--seed" && k + 1 < argc) {
            seed = argv[++k];
        } else {
            folder = argument;
        }
    }
    if (folder.empty() || !(share > 0.0 && share <= 1.0)) {
        fmt::print(stderr, "usage: bench_closure FOLDER [--share S] [--only null|single|pair|foreign] [--seed N]\n");
        return 2;
    }
    std::filesystem::create_directories(folder);
    const auto scaled = [&](double count) { return static_cast<std::size_t>(std::ceil(share * count)); };
    const auto wanted = [&](const char* kind) { return only.empty() || only == kind; };
    const std::vector<std::string> effects = effects_on_turns();

    std::vector<Case> cases;
    const auto add = [&](Case of) {
        of.seed = 1000 + cases.size();
        of.direct = of.direct || cases.size() % 8 == 0;
        cases.push_back(std::move(of));
    };
    if (wanted("null")) {
        for (std::size_t k = 0; k < scaled(520); ++k) {
            add({.kind = Kind::null, .truth = {}, .condition = &conditions[k % conditions.size()]});
        }
    }
    if (wanted("single") || wanted("pair")) {
        std::size_t turn = 0;
        const auto pick = [&](const std::string& effect, double multiple, Case& of) {
            of.truth.push_back(draw(effect, multiple * start_size(effect), 7 * cases.size() + turn,
                                    static_cast<double>(of.turns) / (2.0 * 124.68)));
        };
        for (const double multiple : {1.0, 2.0}) {
            for (std::size_t k = 0; wanted("single") && k < scaled(6); ++k) {
                for (const std::string& effect : effects) {
                    const Condition* condition = &conditions[(k + turn++) % conditions.size()];
                    while (!shows(effect, *condition)) condition = &conditions[turn++ % conditions.size()];
                    Case of{.kind = Kind::single, .truth = {}, .multiple = multiple, .condition = condition};
                    pick(effect, multiple, of);
                    add(std::move(of));
                }
            }
        }
        for (std::size_t a = 0, k = 0; wanted("pair") && a < effects.size(); ++a) {
            for (std::size_t b = a + 1; b < effects.size(); ++b, ++k) {
                if (k % static_cast<std::size_t>(std::round(2.0 / share)) != 0) continue;
                const Condition& condition = conditions[k % conditions.size()];
                if (!shows(effects[a], condition) || !shows(effects[b], condition)) continue;
                Case of{.kind = Kind::pair, .truth = {}, .multiple = 2.0, .condition = &condition};
                pick(effects[a], 2.0, of);
                pick(effects[b], 2.0, of);
                add(std::move(of));
            }
        }
    }
    if (wanted("foreign")) {
        for (Case& of : foreign_cases(scaled(12))) cases.push_back(std::move(of));
    }

    std::erase_if(cases, [&](const Case& of) { return !seed.empty() && std::to_string(of.seed) != seed; });
    // Neighbours by the same way of making: the generator takes several records at a time.
    std::stable_sort(cases.begin(), cases.end(), [](const Case& a, const Case& b) { return a.direct > b.direct; });
    std::vector<std::optional<Outcome>> outcomes(cases.size());
    std::atomic<std::size_t> done{0};
    constexpr std::size_t together = 8;
    oneapi::tbb::parallel_for(std::size_t{0}, (cases.size() + together - 1) / together, [&](std::size_t group) {
        const std::size_t first = group * together;
        const std::size_t count = std::min(together, cases.size() - first);
        std::vector<char> settled(count, 1);
        oneapi::tbb::parallel_for(std::size_t{0}, count, [&](std::size_t k) {
            Case& of = cases[first + k];
            if (of.kind != Kind::single && of.kind != Kind::pair) return;
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
            if (!settled[k - first]) continue;
            if (!seed.empty()) ringlock::record::write_record(folder + "/record.h5", records[k - first]);
            try {
                outcomes[k] = judge(cases[k], records[k - first]);
            } catch (const std::exception& error) {
                fmt::print(stderr, "record {} ({}): {}\n", k, cases[k].truth_text(), error.what());
            }
            const std::size_t now = ++done;
            if (now % 50 == 0) fmt::print(stderr, "{} of {} records\n", now, cases.size());
        }
    });

    std::ofstream rows(folder + "/records.csv");
    std::ofstream deviations(folder + "/deviations.csv");
    rows << "kind,truth,multiple,condition,by,seed,values,judged,false_name,verdict,named,where,expected,before_rad,"
            "after_rad,floor_rad,oracle_rad,seconds\n";
    deviations << "kind,truth,condition,seed,parameter,estimate,standard_error,standard_errors_off\n";
    for (std::size_t k = 0; k < cases.size(); ++k) {
        if (!outcomes[k]) continue;
        const Case& of = cases[k];
        const Outcome& o = *outcomes[k];
        std::string values;
        for (const Added& added : of.truth) {
            for (const auto& [name, value] : added.values) values += fmt::format("{}={:.4g};", name, value);
        }
        fmt::print(rows, "{},{},{},\"{}\",{},{},{},{},{},{},{},{},{},{:.6g},{:.6g},{:.6g},{:.6g},{:.2f}\n",
                   name_of(of.kind), of.truth_text(), of.multiple, of.condition->name, of.direct ? "equation" : "map",
                   of.seed, values, name_of(o.judged), o.false_name ? 1 : 0, o.verdict, o.named, o.where,
                   of.kind == Kind::foreign ? ringlock::closure::name_of(of.where) : "", o.before, o.after, o.floor,
                   o.oracle, o.seconds);
        for (const auto& d : o.deviations) {
            fmt::print(deviations, "{},{},\"{}\",{},{},{:.9g},{:.3g},{:.4f}\n", name_of(of.kind), of.truth_text(),
                       of.condition->name, of.seed, d.parameter, d.value, d.sd, d.standard_errors);
        }
    }
    std::ofstream figures(folder + "/figures.md");
    std::ofstream confusion(folder + "/confusion.md");
    std::ofstream matrix(folder + "/confusion.csv");
    std::ofstream calibration(folder + "/calibration.md");
    std::vector<TableRow> truths;
    for (const Case& of : cases) truths.push_back({of.kind, of.truth_text(), of.multiple});
    write_figures(figures, truths, outcomes, "16 000 turns");
    write_confusion(confusion, matrix, truths, outcomes);
    write_calibration(calibration, outcomes);
    return 0;
}
