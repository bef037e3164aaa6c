#include "analysis/closure/closure.hpp"

#include <fmt/format.h>
#include <malloc.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <exception>
#include <filesystem>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "analysis/closure/report/closed_scenario.hpp"
#include "analysis/closure/report/folder.hpp"
#include "analysis/closure/report/report.hpp"
#include "analysis/record/record.hpp"
#include "analysis/report/closure_page.hpp"
#include "app/command.hpp"
#include "app/files.hpp"
#include "app/output.hpp"
#include "app/record_output.hpp"
#include "engine/core/error.hpp"
#include "engine/scenario/parse.hpp"

namespace ringlock::app {

namespace {

/// What the record does not declare, the scenario says.
void declare(record::Declared& declared, const scenario::Scenario& model) {
    const auto fill = [](std::optional<double>& to, double value) {
        if (!to) to = value;
    };
    fill(declared.scale_factor_arcsec, model.gyro.scale_factor_arcsec);
    fill(declared.lockin_threshold_deg_h, model.gyro.lockin_threshold_deg_h);
    fill(declared.dither_frequency_hz, model.dither.frequency_hz);
    fill(declared.dither_peak_rate_deg_s, model.dither.peak_rate_deg_s);
}

/// Refuses, before the work, an output folder in which somebody's file would be lost.
void refuse_to_lose(const std::string& record, const std::string& model, const std::string& folder) {
    std::vector<NamedFile> files{{"RECORD", record, NamedFile::Use::input}, {"--model", model, NamedFile::Use::input}};
    for (const std::filesystem::path& file : closure::files_of(folder)) {
        files.push_back({"-o", file, NamedFile::Use::output});
    }
    refuse_same_files(files);
    closure::check_folder(folder);
}

/// Shows the stage of the loop, the time since it began, and the time left where that can be told: one line that is
/// replaced on a terminal, a line for each stage elsewhere and one every ten seconds where shares are told.
///
/// How many effects a record needs, and how many models are tried for each, shows as the loop goes on: a time left is
/// told of the last stage alone, whose parts are counted and as long as each other.
class StageProgress {
   public:
    explicit StageProgress(bool quiet) : quiet_(quiet), terminal_(isatty(STDERR_FILENO) != 0) {
        if (!quiet_ && terminal_) ticking_ = std::jthread([this](const std::stop_token& stop) { tick(stop); });
    }
    ~StageProgress() {
        if (ticking_.joinable()) {
            ticking_.request_stop();
            ticking_.join();
        }
        if (shown_ && terminal_) tell("\r\033[K");
    }
    StageProgress(const StageProgress&) = delete;
    StageProgress& operator=(const StageProgress&) = delete;

    void show(const std::string& stage) {
        const std::lock_guard lock(mutex_);
        stage_ = stage;
        first_.reset();
        draw();
    }
    void show_share(double share) {
        const std::lock_guard lock(mutex_);
        share_ = share;
        if (!first_) first_ = {Clock::now(), share};
        if (terminal_ || Clock::now() - drawn_ > std::chrono::seconds(10)) draw();
    }

   private:
    using Clock = std::chrono::steady_clock;
    static double seconds(Clock::duration since) { return std::chrono::duration<double>(since).count(); }

    /// Nothing before a tenth of the parts and two seconds have shown how long they take.
    std::optional<double> left_s() const {
        if (!first_ || share_ - first_->share < 0.1) return std::nullopt;
        const double since_s = seconds(Clock::now() - first_->at);
        if (since_s < 2.0) return std::nullopt;
        return since_s * (1.0 - share_) / (share_ - first_->share);
    }
    void draw() {
        if (quiet_ || stage_.empty()) return;
        std::string line = fmt::format("{:4.0f} s  {}", seconds(Clock::now() - start_), stage_);
        if (const auto left = left_s()) line += fmt::format(", {:.0f} %, about {:.0f} s left", 100.0 * share_, *left);
        tell(terminal_ ? "\r\033[K" + line + " ..." : line + "\n");
        drawn_ = Clock::now();
        shown_ = true;
    }
    /// The time goes on where the loop says nothing for long.
    void tick(const std::stop_token& stop) {
        std::unique_lock lock(mutex_);
        while (!stop.stop_requested()) {
            ticked_.wait_for(lock, stop, std::chrono::seconds(1), [] { return false; });
            if (!stop.stop_requested()) draw();
        }
    }

    struct Share {
        Clock::time_point at;
        double share;
    };
    bool quiet_;
    bool terminal_;
    std::mutex mutex_;
    std::condition_variable_any ticked_;
    bool shown_ = false;
    std::string stage_;
    double share_ = 0.0;
    std::optional<Share> first_;  ///< of the stage
    Clock::time_point start_ = Clock::now();
    Clock::time_point drawn_ = start_;
    std::jthread ticking_;  ///< last, so that it finds all of the above
};

/// Before there are threads: the C library gives each of them a heap of its own, unless told otherwise, and leaves a
/// quarter of the memory to gaps in these. Threads that share one wait for each other now and then: where records are
/// short and threads many, they keep theirs.
void share_heap_where_long(const record::Record& record) {
#ifdef M_ARENA_MAX
    constexpr std::size_t long_record = 50000;
    if (record.turns && record.turns->size() > long_record) mallopt(M_ARENA_MAX, 1);
#else
    static_cast<void>(record);
#endif
}

}  // namespace

void add_closure(CLI::App& root) {
    struct Arguments {
        std::string record;
        std::string model;
        std::string out;
        bool json = false;
        bool quiet = false;
    };
    CLI::App* command = root.add_subcommand("closure", "Identify the error sources in a measured record");
    auto arguments = std::make_shared<Arguments>();
    command->add_option("RECORD", arguments->record, "rlg-record (.h5), or samples as text")->required();
    command->add_option("--model", arguments->model,
                        "scenario (.toml) that supplies scale factor, threshold and dither where the record does not "
                        "declare them");
    command->add_option("-o,--output", arguments->out,
                        "folder for report.md with its figures, closed.toml, closure.h5 and closure.json");
    command->add_flag("--json", arguments->json, "one JSON object on standard output");
    command->add_flag("-q,--quiet", arguments->quiet, "no progress on standard error");
    command->callback([arguments] {
        if (!arguments->out.empty()) refuse_to_lose(arguments->record, arguments->model, arguments->out);
        record::Record record = record::read_record(arguments->record);
        tell_warnings(arguments->record, record);
        if (!arguments->model.empty()) declare(record.declared, scenario::parse_file(arguments->model));
        share_heap_where_long(record);
        StageProgress progress(arguments->quiet);
        const closure::Monitor monitor{[&](const std::string& stage) { progress.show(stage); },
                                       [&](double share) { progress.show_share(share); }};
        closure::Closure closure;
        try {
            closure = closure::close_loop(record, monitor);
        } catch (const InputError& error) {
            throw InputError(fmt::format("{}: {}", arguments->record, error.what()));
        }
        nlohmann::json json = closure::to_json(closure);
        json["closed"] = closure::to_json(closure::closed_scenario(record, closure));
        std::string text = closure::to_text(closure);
        std::exception_ptr not_written;
        if (!arguments->out.empty()) {
            const std::string name = std::filesystem::path(arguments->record).filename().string();
            monitor.tell("simulating the closed model");
            const closure::Predictive predictive =
                closure::check_predictive(record, closure, closure::options.report.most_simulations, monitor);
            json["predictive"] = closure::to_json(predictive);
            text += "\n" + closure::to_text(predictive);
            try {
                closure::write_closure(arguments->out, name, record, closure, predictive);
                report::write_closure_page(arguments->out, name, record, closure, predictive);
            } catch (const Interrupted&) {
                throw;
            } catch (...) {
                not_written = std::current_exception();  // what was found is printed all the same
            }
        }
        put(arguments->json ? json.dump() + "\n" : text);
        if (not_written) std::rethrow_exception(not_written);
    });
}

}  // namespace ringlock::app
