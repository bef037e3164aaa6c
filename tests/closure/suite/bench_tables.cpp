#include "tests/closure/suite/bench_tables.hpp"

#include <fmt/format.h>
#include <fmt/ostream.h>

#include <algorithm>
#include <boost/math/distributions/binomial.hpp>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <string_view>
#include <utility>

#include "engine/effects/effect.hpp"
#include "engine/scenario/active_effects.hpp"
#include "engine/scenario/devices.hpp"

namespace ringlock::test::closure {

namespace {

using Binomial = boost::math::binomial_distribution<>;

double quantile(std::vector<double> values, double at) {
    if (values.empty()) return std::nan("");
    std::sort(values.begin(), values.end());
    return values[static_cast<std::size_t>(at * static_cast<double>(values.size() - 1))];
}

bool of_library(Kind kind) {
    return kind == Kind::single || kind == Kind::pair || kind == Kind::other || kind == Kind::several ||
           kind == Kind::mixed;
}

bool settled(const Outcome& o) { return o.judged == Judged::right || o.judged == Judged::tie; }

/// Whether the record prefers the truth to what was answered by as much as the level asks for.
bool shown(const Outcome& o) { return o.truth_gain - o.answer_gain >= o.asked_gain; }

std::string answer_of(const Outcome& o) {
    std::string answer = o.verdict == "unexplained" ? "unexplained, " + o.where : o.named;
    if (o.verdict == "unexplained" && !o.named.empty()) answer += ", after " + o.named;
    return answer.empty() ? "nothing_missing" : answer;
}

/// What benches of turns and of samples have in common, to be added up.
struct Totals {
    struct Share {
        std::size_t count = 0, of = 0;
        void add(bool counts) {
            ++of;
            if (counts) ++count;
        }
    };
    Share nulls_right, foreign_right, wrong, false_names, within_two;
};

Totals totals_of(const std::vector<TableRow>& truths, const Outcomes& outcomes) {
    Totals totals;
    for (std::size_t k = 0; k < truths.size(); ++k) {
        if (!outcomes[k]) continue;
        const Outcome& o = *outcomes[k];
        const bool right = o.judged == Judged::right;
        if (truths[k].truth == "nothing") totals.nulls_right.add(right);
        if (truths[k].kind == Kind::foreign) totals.foreign_right.add(right);
        totals.wrong.add(o.judged == Judged::wrong);
        totals.false_names.add(o.false_name);
        for (const auto& d : o.deviations) {
            if (std::isfinite(d.standard_errors)) totals.within_two.add(std::abs(d.standard_errors) <= 2.0);
        }
    }
    return totals;
}

void write_totals(std::ostream& out, const std::vector<TableRow>& truths, const Outcomes& outcomes) {
    const Totals totals = totals_of(truths, outcomes);
    fmt::print(out, "figure,count,of\n");
    const auto row = [&](const char* figure, const Totals::Share& share) {
        fmt::print(out, "{},{},{}\n", figure, share.count, share.of);
    };
    row("nulls called `nothing_missing`", totals.nulls_right);
    row("effects outside the library called `unexplained` with the right place", totals.foreign_right);
    row("a wrong name with confidence", totals.wrong);
    row("... or in the steps of an `unexplained` record", totals.false_names);
    row("estimates within two standard errors", totals.within_two);
}

/// How often what came out.
void write_figures(std::ostream& out, const std::vector<TableRow>& truths, const Outcomes& outcomes,
                   const char* record_length) {
    const auto count = [&](auto&& which, auto&& what) {
        std::pair<std::size_t, std::size_t> found{0, 0};
        for (std::size_t k = 0; k < truths.size(); ++k) {
            if (!outcomes[k] || !which(truths[k])) continue;
            ++found.second;
            if (what(*outcomes[k])) ++found.first;
        }
        return share_of(found.first, found.second);
    };
    const auto kind = [](Kind wanted, double multiple) {
        return [=](const TableRow& of) { return of.kind == wanted && (multiple == 0.0 || of.multiple == multiple); };
    };
    const auto is = [](Judged judged) { return [=](const Outcome& o) { return o.judged == judged; }; };
    fmt::print(out, "| figure | reached (95 % interval) |\n|---|---|\n");
    const auto row = [&](const char* name, const std::string& text) { fmt::print(out, "| {} | {} |\n", name, text); };
    row("nulls called `nothing_missing`", count(kind(Kind::null, 0.0), is(Judged::right)));
    row("single effects at their detection limit, named right", count(kind(Kind::single, 1.0), is(Judged::right)));
    row("... ties that hold the truth", count(kind(Kind::single, 1.0), is(Judged::tie)));
    row("... not seen", count(kind(Kind::single, 1.0), is(Judged::missed)));
    const auto missed_though_shown = [&](Kind of, double multiple) {
        std::size_t missed = 0;
        std::size_t though = 0;
        for (std::size_t k = 0; k < truths.size(); ++k) {
            if (!outcomes[k] || !kind(of, multiple)(truths[k]) || outcomes[k]->missing.empty()) continue;
            ++missed;
            if (shown(*outcomes[k])) ++though;
        }
        row("... of those that miss something, records that show the effect", share_of(though, missed));
    };
    missed_though_shown(Kind::single, 1.0);
    row("single effects at twice their limit, named right", count(kind(Kind::single, 2.0), is(Judged::right)));
    row("... ties that hold the truth", count(kind(Kind::single, 2.0), is(Judged::tie)));
    missed_though_shown(Kind::single, 2.0);
    for (const double multiple : {6.0, 30.0, 150.0}) {
        const auto of = kind(Kind::single, multiple);
        if (std::none_of(truths.begin(), truths.end(), of)) continue;
        row(fmt::format("single effects at {:g} times their limit, named right", multiple).c_str(),
            count(of, is(Judged::right)));
        row("... ties that hold the truth", count(of, is(Judged::tie)));
    }
    row("pairs, each at twice its limit, both named", count(kind(Kind::pair, 2.0), is(Judged::right)));
    row("... ties that hold the truth", count(kind(Kind::pair, 2.0), is(Judged::tie)));
    row("... not both of them", count(kind(Kind::pair, 2.0), is(Judged::missed)));
    missed_though_shown(Kind::pair, 2.0);
    row("effects outside the library, `unexplained` with the right place",
        count(kind(Kind::foreign, 0.0), is(Judged::right)));
    row("closed scenarios that obey all rules and run",
        count([](const TableRow&) { return true; }, [](const Outcome& o) { return o.closed_fault.empty(); }));
    for (std::size_t k = 0; k < truths.size(); ++k) {
        if (!outcomes[k] || outcomes[k]->closed_fault.empty()) continue;
        fmt::print(stderr, "closed scenario of {} (seed {}): {}\n", truths[k].truth, truths[k].seed,
                   outcomes[k]->closed_fault);
    }
    const auto other = [&](bool null) {
        return [=](const TableRow& of) { return of.kind == Kind::other && (of.multiple == 0.0) == null; };
    };
    if (std::any_of(truths.begin(), truths.end(), other(false))) {
        row("other gyros: nulls called `nothing_missing`", count(other(true), is(Judged::right)));
        row("... effects at 6 times their limit, named right", count(other(false), is(Judged::right)));
        row("... ties that hold the truth", count(other(false), is(Judged::tie)));
    }
    if (std::any_of(truths.begin(), truths.end(), kind(Kind::several, 0.0))) {
        const auto several = kind(Kind::several, 0.0);
        row("two or three effects of 5 to 30 times their limits, all named", count(several, is(Judged::right)));
        row("... ties that hold the truth", count(several, is(Judged::tie)));
        row("... not all of them", count(several, is(Judged::missed)));
        row("... `unexplained`", count(several, is(Judged::unexplained)));
    }
    if (std::any_of(truths.begin(), truths.end(), kind(Kind::mixed, 0.0))) {
        const auto mixed = kind(Kind::mixed, 0.0);
        row("one effect of 6 times its limit and one outside the library: `unexplained` with the right place, the "
            "effect named",
            count(mixed, is(Judged::right)));
        row("... in a tie that holds it", count(mixed, is(Judged::tie)));
        row("... `unexplained`, the effect not named", count(mixed, [](const Outcome& o) {
                return o.verdict == "unexplained" && !o.false_name && !o.missing.empty();
            }));
        row("... an effect named that the record does not contain",
            count(mixed, [](const Outcome& o) { return o.false_name; }));
    }
    const Totals totals = totals_of(truths, outcomes);
    row("a wrong name with confidence, over all records", share_of(totals.wrong.count, totals.wrong.of));
    row("... upper 95 % limit, one-sided", limit_of(totals.wrong.count, totals.wrong.of));
    row("... or in the steps of an `unexplained` one", share_of(totals.false_names.count, totals.false_names.of));
    std::vector<double> ratios;
    std::vector<double> seconds;
    for (const auto& o : outcomes) {
        if (!o) continue;
        seconds.push_back(o->seconds);
        if (std::isfinite(o->oracle)) ratios.push_back(o->after / o->oracle);
    }
    row("held-out error after closing over the oracle's: median, 99 % of records, worst",
        fmt::format("{:.4f}, {:.4f}, {:.4f}", quantile(ratios, 0.5), quantile(ratios, 0.99), quantile(ratios, 1.0)));
    row("estimates within two standard errors", share_of(totals.within_two.count, totals.within_two.of));
    row(fmt::format("time of a record of {}, one of two cores busy with another: median, worst", record_length).c_str(),
        fmt::format("{:.1f} s, {:.1f} s", quantile(seconds, 0.5), quantile(seconds, 1.0)));
}

/// What each truth has been taken for.
void write_confusion(std::ostream& out, std::ostream& matrix, const std::vector<TableRow>& truths,
                     const Outcomes& outcomes) {
    std::map<std::pair<std::string, double>, std::map<std::string, int>> taken;
    for (std::size_t k = 0; k < truths.size(); ++k) {
        if (!outcomes[k] || truths[k].kind == Kind::pair || truths[k].kind == Kind::several) continue;
        const Outcome& o = *outcomes[k];
        ++taken[{truths[k].truth, truths[k].multiple}][answer_of(o)];
    }
    fmt::print(out, "| in the record | size over its limit | taken for |\n|---|---|---|\n");
    matrix << "truth,multiple,answer,records\n";
    for (const auto& [truth, answers] : taken) {
        std::vector<std::pair<int, std::string>> sorted;
        for (const auto& [answer, records] : answers) {
            sorted.emplace_back(records, answer);
            fmt::print(matrix, "{},{},\"{}\",{}\n", truth.first, truth.second, answer, records);
        }
        std::sort(sorted.rbegin(), sorted.rend());
        std::string text;
        for (const auto& [records, answer] : sorted) {
            text += fmt::format("{}{} {}", text.empty() ? "" : "; ", records, answer);
        }
        fmt::print(out, "| {} | {} | {} |\n", truth.first, truth.second > 0.0 ? fmt::format("{:g}", truth.second) : "-",
                   text);
    }
}

/// Records from twice the limit on whose answer is neither right nor a tie, with the gains of the log-likelihood.
void write_misses(std::ostream& out, const std::vector<TableRow>& truths, const Outcomes& outcomes) {
    fmt::print(
        out,
        "| record | contents | size over its limit | answer | not named | gain of the truth over the base model | over "
        "the answer | required |\n|---|---|---|---|---|---|---|---|\n");
    const auto nats = [](double gain) { return std::isfinite(gain) ? fmt::format("{:.1f}", gain) : std::string("-"); };
    for (std::size_t k = 0; k < truths.size(); ++k) {
        const TableRow& of = truths[k];
        if (!outcomes[k] || !of_library(of.kind) || of.multiple < 2.0 || settled(*outcomes[k])) continue;
        const Outcome& o = *outcomes[k];
        fmt::print(out, "| {} ({}) | {} | {:g} | {} | {} | {} | {} | {} |\n", of.seed, of.condition, of.truth,
                   of.multiple, answer_of(o), fmt::join(o.missing, ", "), nats(o.truth_gain),
                   nats(o.truth_gain - o.answer_gain), nats(o.asked_gain));
    }
}

/// How far estimates are from the truth, in their standard errors.
void write_calibration(std::ostream& out, const Outcomes& outcomes) {
    std::map<std::string, std::vector<double>> by_parameter;
    for (const auto& o : outcomes) {
        if (!o) continue;
        for (const auto& d : o->deviations) by_parameter[d.parameter].push_back(d.standard_errors);
    }
    fmt::print(out, "| parameter | estimates | mean | rms | within one | within two | without a standard error |\n");
    fmt::print(out, "|---|---|---|---|---|---|---|\n");
    for (const auto& [parameter, all] : by_parameter) {
        std::vector<double> known;
        for (const double z : all) {
            if (std::isfinite(z)) known.push_back(z);
        }
        double sum = 0.0;
        double squares = 0.0;
        int one = 0;
        int two = 0;
        for (const double z : known) {
            sum += z;
            squares += z * z;
            one += std::abs(z) <= 1.0 ? 1 : 0;
            two += std::abs(z) <= 2.0 ? 1 : 0;
        }
        const auto n = static_cast<double>(std::max<std::size_t>(known.size(), 1));
        fmt::print(out, "| {} | {} | {:.2f} | {:.2f} | {:.0f} % | {:.0f} % | {} |\n", parameter, known.size(), sum / n,
                   std::sqrt(squares / n), 100.0 * one / n, 100.0 * two / n, all.size() - known.size());
    }
}

}  // namespace

std::string share_of(std::size_t count, std::size_t of) {
    if (of == 0) return "none";
    const auto n = static_cast<double>(of);
    const auto k = static_cast<double>(count);
    const double lo = Binomial::find_lower_bound_on_p(n, k, 0.025);
    const double hi = Binomial::find_upper_bound_on_p(n, k, 0.025);
    return fmt::format("{} of {}, {:.1f} % ({:.1f} .. {:.1f})", count, of, 100.0 * k / n, 100.0 * lo, 100.0 * hi);
}

std::string limit_of(std::size_t count, std::size_t of) {
    if (of == 0) return "none";
    const double limit = Binomial::find_upper_bound_on_p(static_cast<double>(of), static_cast<double>(count), 0.05);
    return fmt::format("{:.2f} %", 100.0 * limit);
}

std::size_t Command::scaled(double count) const { return static_cast<std::size_t>(std::ceil(share * count)); }

std::size_t Command::every(double of) const {
    return std::max(std::size_t{1}, static_cast<std::size_t>(std::round(of / share)));
}

namespace {

constexpr double most_share = 10.0;

/// Names of effects of the library, separated by commas. Ends the program where one is none.
std::vector<std::string> names_in(const std::string& text) {
    std::vector<std::string> names;
    std::istringstream in(text);
    for (std::string name; std::getline(in, name, ',');) {
        if (effects::find(name) == nullptr) {
            fmt::print(stderr, "{}: no effect of the library\n", name);
            std::exit(2);
        }
        names.push_back(name);
    }
    return names;
}

gyro::Setup gyro_named(std::string_view name) {
    const scenario::DeviceFile* file = scenario::find_device(name);
    if (file == nullptr) {
        fmt::print(stderr, "{}: no device (`ringlock devices` lists them)\n", name);
        std::exit(2);
    }
    return scenario::configured_setup(scenario::read_device(*file).scenario);
}

}  // namespace

std::vector<std::string> Command::kept(std::vector<std::string> names) const {
    const auto in = [](const std::vector<std::string>& all, const std::string& name) {
        return std::find(all.begin(), all.end(), name) != all.end();
    };
    std::erase_if(
        names, [&](const std::string& name) { return (!effects.empty() && !in(effects, name)) || in(without, name); });
    return names;
}

Command command_of(int argc, char** argv, const char* program) {
    Command command;
    bool wrong = false;
    for (int k = 1; k < argc; ++k) {
        const std::string_view argument = argv[k];
        const bool followed = k + 1 < argc;
        if (argument == "--share" && followed) {
            command.share = std::strtod(argv[++k], nullptr);
        } else if (argument == "--only" && followed) {
            command.only = argv[++k];
        } else if (argument == "--effect" && followed) {
            command.effects = names_in(argv[++k]);
        } else if (argument == "--without" && followed) {
            command.without = names_in(argv[++k]);
        } else if (argument == "--device" && followed) {
            command.gyro = gyro_named(argv[++k]);
        } else if (argument == "--multiple" && followed) {
            command.multiple = std::strtod(argv[++k], nullptr);
        } else if (argument == "--length" && followed) {
            command.length_s = std::strtod(argv[++k], nullptr);
            wrong = wrong || !(*command.length_s > 0.0);
        } else if (argument == "--rate" && followed) {
            command.rate_hz = std::strtod(argv[++k], nullptr);
            wrong = wrong || !(*command.rate_hz > 0.0);
        } else if (argument == "--direct") {
            command.direct = true;
        } else if (argument == "--seed" && followed) {
            command.seed = argv[++k];
        } else if (argument == "--series" && followed) {
            const std::string_view text = argv[++k];
            const auto end = std::from_chars(text.data(), text.data() + text.size(), command.series);
            wrong = wrong || end.ec != std::errc() || end.ptr != text.data() + text.size();
        } else {
            wrong = wrong || argument.starts_with("-") || !command.folder.empty();
            command.folder = argument;
        }
    }
    const bool known = command.wants(Kind::null) || command.wants(Kind::single) || command.wants(Kind::pair) ||
                       command.wants(Kind::foreign) || command.wants(Kind::other) || command.wants(Kind::several) ||
                       command.wants(Kind::mixed);
    if (wrong || command.folder.empty() || !known || !(command.share > 0.0 && command.share <= most_share)) {
        fmt::print(stderr,
                   "usage: {} FOLDER [--share S] [--only null|single|pair|foreign|other|several|mixed] "
                   "[--multiple M] [--effect E,F] [--without E,F] [--device NAME] [--direct] [--seed N] [--series N] "
                   "[--length S] [--rate HZ]\n",
                   program);
        std::exit(2);
    }
    std::filesystem::create_directories(command.folder);
    return command;
}

std::string values_of(const std::vector<Added>& truth) {
    std::string values;
    for (const Added& added : truth) {
        for (const auto& [name, value] : added.values) values += fmt::format("{}={:.5g};", name, value);
    }
    return values;
}

Tables::Tables(std::string folder, std::size_t records, const char* unit, const char* record_length)
    : folder_(std::move(folder)), unit_(unit), record_length_(record_length), truths_(records), outcomes_(records) {}

void Tables::keep(std::size_t k, TableRow truth, Outcome outcome) {
    const std::lock_guard lock(filling_);
    truths_[k] = std::move(truth);
    outcomes_[k] = std::move(outcome);
}

void Tables::count() {
    constexpr std::size_t now_and_then = 50;
    const std::lock_guard lock(filling_);
    if (++done_ % now_and_then != 0) return;
    fmt::print(stderr, "{} of {} records\n", done_, outcomes_.size());
    write();
}

void Tables::write() const {
    std::ofstream rows(folder_ + "/records.csv");
    std::ofstream deviations(folder_ + "/deviations.csv");
    fmt::print(rows,
               "kind,truth,multiple,condition,by,seed,values,judged,false_name,verdict,named,where,expected,"
               "before_{0},after_{0},floor_{0},oracle_{0},truth_gain,answer_gain,seconds\n",
               unit_);
    fmt::print(deviations, "kind,truth,condition,seed,parameter,estimate,standard_error,standard_errors_off\n");
    for (std::size_t k = 0; k < truths_.size(); ++k) {
        if (!outcomes_[k]) continue;
        const TableRow& of = truths_[k];
        const Outcome& o = *outcomes_[k];
        fmt::print(rows,
                   "{},{},{},\"{}\",{},{},{},{},{},{},{},{},{},{:.6g},{:.6g},{:.6g},{:.6g},{:.2f},{:.2f},{:.2f}\n",
                   name_of(of.kind), of.truth, of.multiple, of.condition, of.by, of.seed, of.values, name_of(o.judged),
                   o.false_name ? 1 : 0, o.verdict, o.named, o.where, of.expected, o.before, o.after, o.floor, o.oracle,
                   o.truth_gain, o.answer_gain, o.seconds);
        for (const auto& d : o.deviations) {
            fmt::print(deviations, "{},{},\"{}\",{},{},{:.9g},{:.3g},{:.4f}\n", name_of(of.kind), of.truth,
                       of.condition, of.seed, d.parameter, d.value, d.sd, d.standard_errors);
        }
    }
    std::ofstream figures(folder_ + "/figures.md");
    std::ofstream confusion(folder_ + "/confusion.md");
    std::ofstream matrix(folder_ + "/confusion.csv");
    std::ofstream totals(folder_ + "/totals.csv");
    std::ofstream misses(folder_ + "/misses.md");
    std::ofstream calibration(folder_ + "/calibration.md");
    write_figures(figures, truths_, outcomes_, record_length_);
    write_confusion(confusion, matrix, truths_, outcomes_);
    write_totals(totals, truths_, outcomes_);
    write_misses(misses, truths_, outcomes_);
    write_calibration(calibration, outcomes_);
}

}  // namespace ringlock::test::closure
