// Hundreds of records of uniform samples with known truth, which the closed loop reads blind.
//
//   bench_closure_samples FOLDER [--share S] [--only KIND] [--seed N]
//
// FOLDER gets records.csv (a row a record), deviations.csv (estimates less truth, in standard errors), confusion.csv
// and the tables of the page: figures.md, confusion.md, calibration.md. A share S of 0.1 makes a tenth of the records;
// with a seed only that record is made, and kept as record.h5. `tools/closure --samples` puts the tables into the page.
#include <fmt/format.h>
#include <fmt/ostream.h>
#include <oneapi/tbb/parallel_for.h>

#include <atomic>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>
#include <vector>

#include "tests/closure/bench_tables.hpp"
#include "tests/closure/sample_suite.hpp"

namespace {

using namespace ringlock::test::closure;

std::vector<SampleCase> all_cases(double share, const std::string& only) {
    const auto scaled = [&](double count) { return static_cast<std::size_t>(std::ceil(share * count)); };
    const std::vector<std::string> effects = effects_on_samples();
    std::vector<SampleCase> cases;
    std::size_t turn = 0;
    std::uint64_t seed = 20000;
    const auto add = [&](Kind kind, double multiple, const std::vector<std::string>& in) {
        SampleCase of{.kind = kind, .truth = {}, .multiple = multiple, .condition = nullptr, .seed = seed++};
        for (std::size_t tried = 0; tried < sample_conditions.size() && of.condition == nullptr; ++tried) {
            const SampleCondition* condition = &sample_conditions[turn++ % sample_conditions.size()];
            bool shown = true;
            for (const std::string& effect : in) shown = shown && shows(effect, *condition);
            if (shown) of.condition = condition;
        }
        if (of.condition == nullptr) return;
        for (const std::string& effect : in) of.truth.push_back(draw_on_samples(effect, of));
        cases.push_back(std::move(of));
    };
    for (std::size_t k = 0; k < scaled(240); ++k) add(Kind::null, 0.0, {});
    for (const double multiple : {1.0, 2.0}) {
        for (std::size_t k = 0; k < scaled(8); ++k) {
            for (const std::string& effect : effects) {
                if (multiple > 1.0 || has_size(effect)) add(Kind::single, multiple, {effect});
            }
        }
    }
    std::size_t pair = 0;
    for (std::size_t a = 0; a < effects.size(); ++a) {
        for (std::size_t b = a + 1; b < effects.size(); ++b, ++pair) {
            if (pair % static_cast<std::size_t>(std::round(1.0 / share)) == 0)
                add(Kind::pair, 2.0, {effects[a], effects[b]});
        }
    }
    for (SampleCase& of : foreign_sample_cases(scaled(10))) cases.push_back(std::move(of));
    std::erase_if(cases, [&](const SampleCase& of) { return !only.empty() && only != name_of(of.kind); });
    return cases;
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
    if (folder.empty() || folder.starts_with("-") || !(share > 0.0 && share <= 1.0)) {
        fmt::print(stderr,
                   "usage: bench_closure_samples FOLDER [--share S] [--only null|single|pair|foreign] [--seed N]\n");
        return 2;
    }
    std::filesystem::create_directories(folder);
    std::vector<SampleCase> cases = all_cases(share, only);
    std::erase_if(cases, [&](const SampleCase& of) { return !seed.empty() && std::to_string(of.seed) != seed; });
    Outcomes outcomes(cases.size());
    std::atomic<std::size_t> done{0};
    oneapi::tbb::parallel_for(std::size_t{0}, cases.size(), [&](std::size_t k) {
        try {
            if (cases[k].multiple > 0.0) settle(cases[k]);
            const auto record = make(cases[k]);
            if (!seed.empty()) ringlock::record::write_record(folder + "/record.h5", record);
            outcomes[k] = judge(cases[k], record);
        } catch (const std::exception& error) {
            fmt::print(stderr, "record {} ({}): {}\n", cases[k].seed, cases[k].truth_text(), error.what());
        }
        const std::size_t now = ++done;
        if (now % 50 == 0) fmt::print(stderr, "{} of {} records\n", now, cases.size());
    });

    std::ofstream rows(folder + "/records.csv");
    std::ofstream deviations(folder + "/deviations.csv");
    rows << "kind,truth,multiple,condition,seed,values,judged,false_name,verdict,named,where,expected,before_arcsec,"
            "after_arcsec,floor_arcsec,oracle_arcsec,seconds\n";
    deviations << "kind,truth,condition,seed,parameter,estimate,standard_error,standard_errors_off\n";
    std::vector<TableRow> truths;
    for (std::size_t k = 0; k < cases.size(); ++k) {
        const SampleCase& of = cases[k];
        truths.push_back({of.kind, of.truth_text(), of.multiple});
        if (!outcomes[k]) continue;
        const Outcome& o = *outcomes[k];
        std::string values;
        for (const Added& added : of.truth) {
            for (const auto& [name, value] : added.values) values += fmt::format("{}={:.5g};", name, value);
        }
        fmt::print(rows, "{},{},{},\"{}\",{},{},{},{},{},{},{},{},{:.6g},{:.6g},{:.6g},{:.6g},{:.2f}\n",
                   name_of(of.kind), of.truth_text(), of.multiple, of.condition->name, of.seed, values,
                   name_of(o.judged), o.false_name ? 1 : 0, o.verdict, o.named, o.where,
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
    write_figures(figures, truths, outcomes, "30 000 samples");
    write_confusion(confusion, matrix, truths, outcomes);
    write_calibration(calibration, outcomes);
    return 0;
}
