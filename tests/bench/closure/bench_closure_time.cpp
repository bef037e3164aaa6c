// How long the closed loop takes, and whether its time goes with the length of the record.
//
//   bench_closure_time FOLDER [--rounds N] [--longest TURNS]
//
// Lengths, records and rounds take turns, so that what else the machine does falls on all of them; medians over the
// rounds. FOLDER gets the tables of the page: time-turns.md, time-stages.md, time-samples.md. tools/closure-time puts
// them there.
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "analysis/closure/closure.hpp"
#include "analysis/closure/report/predictive.hpp"
#include "analysis/closure/turns/fit/fit.hpp"
#include "analysis/closure/turns/loop/loop.hpp"
#include "analysis/closure/turns/model/series.hpp"
#include "analysis/closure/turns/residual/residual_tests.hpp"
#include "analysis/closure/turns/screen/score_tests.hpp"
#include "analysis/closure/turns/screen/side_channels.hpp"
#include "analysis/record/record.hpp"
#include "engine/effects/effect.hpp"
#include "tests/closure/generator/generator.hpp"
#include "tests/closure/generator/samples.hpp"
#include "tests/closure/suite/suite.hpp"

namespace {

using namespace ringlock::test::closure;
using ringlock::closure::Closure;
namespace record = ringlock::record;

double seconds_of(const std::function<void()>& work) {
    const auto start = std::chrono::steady_clock::now();
    work();
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

double median(std::vector<double> values) {
    std::sort(values.begin(), values.end());
    const std::size_t half = values.size() / 2;
    return values.size() % 2 == 1 ? values[half] : 0.5 * (values[half - 1] + values[half]);
}

/// Times of one line of a table, by length and round.
class Times {
   public:
    void add(std::size_t length, double seconds) { seconds_[length].push_back(seconds); }

    std::string seconds(std::size_t length) const {
        const double s = median(seconds_.at(length));
        return fmt::format("{:.{}f}", s, s < 0.1 ? 3 : s < 10.0 ? 2 : 1);
    }
    /// Time per row over that of another length; ratios within a round, then their median.
    double growth(std::size_t length, std::size_t from) const {
        const double rows = static_cast<double>(length) / static_cast<double>(from);
        std::vector<double> ratios;
        for (std::size_t k = 0; k < seconds_.at(from).size(); ++k) {
            ratios.push_back(seconds_.at(length)[k] / seconds_.at(from)[k] / rows);
        }
        return median(ratios);
    }
    double worst(std::size_t length) const {
        return *std::max_element(seconds_.at(length).begin(), seconds_.at(length).end());
    }

   private:
    std::map<std::size_t, std::vector<double>> seconds_;
};

/// A record to be timed and what the loop says of it.
struct Contender {
    std::string name;
    std::function<record::Record(std::size_t length)> made;
    Times times = {};
    std::map<std::size_t, std::string> answers = {};
};

std::string answer_of(const Closure& closure) {
    std::string text;
    for (const auto& step : closure.steps) text += (text.empty() ? "" : " + ") + step.name();
    if (text.empty()) return std::string(name_of(closure.verdict));
    return closure.verdict == ringlock::closure::Verdict::closed ? text : text + ", unexplained";
}

void time_loops(std::vector<Contender>& finalists, const std::vector<std::size_t>& lengths, int rounds) {
    for (int round = 0; round < rounds; ++round) {
        for (const std::size_t length : lengths) {
            for (Contender& finalist : finalists) {
                const record::Record made = finalist.made(length);
                Closure closure;
                finalist.times.add(length, seconds_of([&] { closure = ringlock::closure::close_loop(made); }));
                finalist.answers[length] = answer_of(closure);
            }
        }
    }
}

/// Rows: record and length.
std::string loops_table(const std::vector<Contender>& finalists, const std::vector<std::size_t>& lengths,
                        const std::string& unit) {
    std::string text = fmt::format(
        "| in the record | {0}s | answer | seconds | longest of the rounds | per {0}, over {1} {0}s | per {0}, over "
        "the "
        "row above |\n|---|---|---|---|---|---|---|\n",
        unit, lengths.front());
    for (const Contender& finalist : finalists) {
        for (std::size_t k = 0; k < lengths.size(); ++k) {
            const std::size_t length = lengths[k];
            const Times& times = finalist.times;
            text += fmt::format("| {} | {} | {} | {} | {:.2f} | {:.2f} | {} |\n", finalist.name, length,
                                finalist.answers.at(length), times.seconds(length), times.worst(length),
                                times.growth(length, lengths.front()),
                                k > 0 ? fmt::format("{:.2f}", times.growth(length, lengths[k - 1])) : "");
        }
    }
    return text;
}

constexpr double turns_hz = 2.0 * 124.68;

std::vector<Contender> turn_records() {
    // Sizes that show in the shortest of the records.
    const auto with = [](const char* name, std::size_t condition, std::vector<Added> truth) {
        return Contender{fmt::format("{} ({})", name, conditions[condition].name),
                         [condition, truth](std::size_t turns) {
                             Case of{.kind = Kind::single, .truth = truth, .condition = &conditions[condition]};
                             of.seed = 4;
                             of.turns = turns;
                             for (Added& added : of.truth) {
                                 if (added.effect == "bias_step") {
                                     added.values["time_s"] = 0.4 * static_cast<double>(turns) / turns_hz;
                                 }
                             }
                             return std::move(make({&of, 1}).front());
                         }};
    };
    const Added step{"bias_step", {{"step_deg_h", 0.05}, {"time_s", 0.0}}};
    return {
        with("nothing", 0, {}),
        with("nothing", 3, {}),
        with("bias step", 1, {step}),
        with("bias instability", 1, {{"bias_instability", {{"deg_h", 0.05}}}}),
        with("a line and a second harmonic", 1,
             {{"base_vibration", {{"frequency_hz", 7.3}, {"rate_deg_h", 20.0}, {"phase_rad", 1.0}}},
              {"lockin_second_harmonic", {{"ratio", 0.3}, {"phase_rad", 0.5}}}}),
    };
}

std::vector<Contender> sample_records() {
    const auto plain = [](std::size_t size) {
        SampleTruth truth;
        truth.size = size;
        truth.mean_rate_deg_h = 10.0;
        truth.white_angle_arcsec = 0.2;
        truth.rates.quantum_noise_deg_rt_h = 0.01;
        truth.accelerometers = true;
        return truth;
    };
    return {{"nothing", [=](std::size_t size) { return generate_samples(plain(size)); }},
            {"a coarse step, case motion and a line", [=](std::size_t size) {
                 SampleTruth truth = plain(size);
                 truth.count_quantization_arcsec = 0.5;
                 truth.case_motion.rms_arcsec = 1.5;
                 truth.dither_residue.frequency_hz = 38.0;
                 truth.dither_residue.amplitude_arcsec = 0.2;
                 return generate_samples(truth);
             }}};
}

/// Parts of the loop on a record with nothing to find, each by itself, and the predictive check.
std::string time_stages(const std::vector<std::size_t>& lengths, int rounds) {
    namespace closure = ringlock::closure;
    const std::vector<std::string> names{"phases joined, base model fitted",
                                         "score tests of the library",
                                         "tests of other columns",
                                         "tests of the residual",
                                         "the whole loop",
                                         "predictive check"};
    std::vector<Times> times(names.size());
    std::map<std::size_t, int> simulations;
    const auto records = turn_records();
    for (int round = 0; round < rounds; ++round) {
        for (const std::size_t length : lengths) {
            const record::Record made = records.front().made(length);
            const closure::JoinedPhase joined = closure::join(*made.turns, {}, false);
            const closure::TurnSeries series = closure::prepare(made, joined);
            const closure::TurnModel model(series, joined.phase_rad);
            closure::TurnParameters start;
            start.readout_sd_rad = joined.readout_sd_rad;
            start.threshold_deg_h = series.setup.lockin_threshold_deg_h;
            std::unique_ptr<closure::TurnFit> fit;
            Closure closed;
            const auto stage = [&](std::size_t k, const std::function<void()>& work) {
                times[k].add(length, seconds_of(work));
            };
            stage(0, [&] { fit = std::make_unique<closure::TurnFit>(model, start, closure::Rows(series.size(), 1)); });
            stage(1, [&] { closure::screen(*fit); });
            stage(2, [&] { closure::screen_side_channels(*made.turns, *fit, joined); });
            stage(3, [&] { closure::test_residual(*fit); });
            stage(4, [&] { closed = closure::close_turns(made); });
            stage(5, [&] { simulations[length] = closure::check_predictive(made, closed).simulations; });
        }
    }
    std::string text = "| seconds, by turns |";
    std::string line = "\n|---|";
    for (const std::size_t length : lengths) {
        text += fmt::format(" {} |", length);
        line += "---|";
    }
    text += fmt::format(" per turn, longest over half of it |{}---|\n", line);
    for (std::size_t k = 0; k < names.size(); ++k) {
        text += fmt::format("| {} |", names[k]);
        for (const std::size_t length : lengths) text += fmt::format(" {} |", times[k].seconds(length));
        const std::size_t before = lengths.size() > 1 ? lengths[lengths.size() - 2] : lengths.back();
        text += fmt::format(" {:.2f} |\n", times[k].growth(lengths.back(), before));
    }
    text += "| simulations of that check |";
    for (const std::size_t length : lengths) text += fmt::format(" {} |", simulations[length]);
    return text + " |\n";
}

}  // namespace

int main(int argc, char** argv) {
    std::string folder;
    int rounds = 3;
    std::size_t longest = 120000;
    for (int k = 1; k < argc; ++k) {
        const std::string_view argument = argv[k];
        if (argument == "--rounds" && k + 1 < argc) {
            rounds = std::atoi(argv[++k]);
        } else if (argument == "--longest" && k + 1 < argc) {
            longest = std::strtoul(argv[++k], nullptr, 10);
        } else {
            folder = argument;
        }
    }
    std::vector<std::size_t> lengths;
    for (std::size_t length = 7500; length <= longest; length *= 2) lengths.push_back(length);
    if (folder.empty() || rounds < 1 || lengths.empty()) {
        fmt::print(stderr, "usage: bench_closure_time FOLDER [--rounds N] [--longest TURNS, 7500 or more]\n");
        return 2;
    }
    std::filesystem::create_directories(folder);
    const auto put = [&](const char* block, const std::string& text) {
        std::ofstream(fmt::format("{}/{}.md", folder, block)) << text;
        fmt::print("{}\n", text);
        std::fflush(stdout);
    };
    const std::string machine =
        fmt::format("\n{} hardware threads; {} rounds.\n", std::thread::hardware_concurrency(), rounds);

    put("time-stages", time_stages(lengths, rounds) + machine);
    auto turns = turn_records();
    time_loops(turns, lengths, rounds);
    put("time-turns", loops_table(turns, lengths, "turn") + machine);
    auto samples = sample_records();
    const std::vector<std::size_t> sample_lengths{60000, 180000};
    time_loops(samples, sample_lengths, rounds);
    put("time-samples", loops_table(samples, sample_lengths, "sample") + machine);
    return 0;
}
