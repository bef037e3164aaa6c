#include "analysis/study/result/replay_file.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <bit>
#include <exception>
#include <span>
#include <string_view>
#include <system_error>
#include <utility>

#include "analysis/study/result/columns.hpp"
#include "analysis/study/result/result_file.hpp"
#include "analysis/study/result/result_layout.hpp"
#include "engine/core/error.hpp"
#include "engine/core/printable.hpp"
#include "engine/core/version.hpp"
#include "engine/scenario/text/render.hpp"
#include "engine/store/hdf5.hpp"

namespace ringlock::study {
namespace {

constexpr const char* format_name = "ringlock-replay";

/// Turns that are written together: a chunk of each dataset.
constexpr std::size_t chunk_turns = 16384;

/// A dataset with one value a turn.
template <class T>
struct TurnColumn {
    const char* name;
    const char* unit;
    const char* description;
    T (*get)(const ReplayedTurn& turn);
};

using Turn = const ReplayedTurn&;

constexpr std::array real_columns = {
    TurnColumn<double>{"turns/time_s", "s", "nominal time of the dither's turn since the start of the record",
                       [](Turn t) { return t.time_s; }},
    TurnColumn<double>{"turns/angle_arcsec", "arcsec", "angle output of the arm with the dither stripped",
                       [](Turn t) { return t.angle_arcsec; }},
    TurnColumn<double>{"turns/correction_rad", "rad", "lock-in error that the compensator takes away, optical phase",
                       [](Turn t) { return t.correction_rad; }},
    TurnColumn<double>{"truth/zero_rate_s", "s", "when the phase turns, from time_s",
                       [](Turn t) { return t.zero_rate_s; }},
    TurnColumn<double>{"truth/phase_rest_rad", "rad", "optical phase when it turns, less phase_whole_fringes",
                       [](Turn t) { return t.phase.rest_rad; }},
    TurnColumn<double>{"truth/lockin_error_rad", "rad",
                       "optical phase that the lock-in has added since the first turn of the run",
                       [](Turn t) { return t.lockin_error_rad; }},
    TurnColumn<double>{"truth/lockin_step_rad", "rad", "the same since the turn before",
                       [](Turn t) { return t.lockin_step_rad; }},
    TurnColumn<double>{"truth/left_step_rad", "rad", "lockin_step_rad after compensation",
                       [](Turn t) { return t.left_step_rad; }},
    TurnColumn<double>{"truth/rotation_arcsec", "arcsec",
                       "rotation of the case and by the rates of effects, since the first turn of the run",
                       [](Turn t) { return t.rotation_arcsec; }},
    TurnColumn<double>{"truth/dither_amplitude_rad", "rad",
                       "amplitude of the half cycle that ends at the turn: half its swing, optical phase",
                       [](Turn t) { return t.dither_amplitude_rad; }},
    TurnColumn<double>{"truth/dither_amplitude_change_rad", "rad",
                       "amplitude at the end of that half cycle less the one at its beginning",
                       [](Turn t) { return t.dither_amplitude_change_rad; }},
    TurnColumn<double>{"truth/rate_deg_h", "deg/h", "mean rate over that half cycle: input and effects",
                       [](Turn t) { return t.rate_deg_h; }},
    TurnColumn<double>{"truth/lockin_threshold_deg_h", "deg/h", "lock-in threshold of that half cycle",
                       [](Turn t) { return t.lockin_threshold_deg_h; }},
    TurnColumn<double>{"truth/coupling_phase_rad", "rad", "phase of the coupling in that half cycle",
                       [](Turn t) { return t.coupling_phase_rad; }},
    TurnColumn<double>{"readings/sine", "1", "sine of the phase as the compensator sees it",
                       [](Turn t) { return t.seen.sine; }},
    TurnColumn<double>{"readings/cosine", "1", "cosine of the phase as the compensator sees it",
                       [](Turn t) { return t.seen.cosine; }},
    TurnColumn<double>{"readings/phase_rest_rad", "rad", "phase read, less phase_whole_fringes",
                       [](Turn t) { return t.seen.phase.rest_rad; }},
    TurnColumn<double>{"readings/accel_before_rad_s2", "rad/s^2", "size of the phase's acceleration before the turn",
                       [](Turn t) { return t.accel_before_rad_s2; }},
    TurnColumn<double>{"readings/accel_after_rad_s2", "rad/s^2", "size of the phase's acceleration after the turn",
                       [](Turn t) { return t.accel_after_rad_s2; }},
    TurnColumn<double>{"hardware/sine", "1", "sine detector as sampled", [](Turn t) { return t.hardware.sine; }},
    TurnColumn<double>{"hardware/cosine", "1", "cosine detector as sampled", [](Turn t) { return t.hardware.cosine; }},
    TurnColumn<double>{"hardware/phase_rest_rad", "rad", "phase as sampled, less phase_whole_fringes",
                       [](Turn t) { return t.hardware.phase.rest_rad; }},
    TurnColumn<double>{"hardware/zero_rate_s", "s", "when the phase turned, as the electronics find it, from time_s",
                       [](Turn t) { return t.found_zero_rate_s; }},
};

constexpr std::array count_columns = {
    TurnColumn<std::int64_t>{"truth/phase_whole_fringes", "1", "whole fringes of the optical phase when it turns",
                             [](Turn t) { return t.phase.whole_fringes; }},
    TurnColumn<std::int64_t>{"readings/phase_whole_fringes", "1", "whole fringes of the phase read",
                             [](Turn t) { return t.seen.phase.whole_fringes; }},
    TurnColumn<std::int64_t>{"hardware/phase_whole_fringes", "1", "whole fringes of the phase as sampled",
                             [](Turn t) { return t.hardware.phase.whole_fringes; }},
    TurnColumn<std::int64_t>{"hardware/quarter_count", "1", "counter, in quarter fringes",
                             [](Turn t) { return t.quarter_count; }},
};

constexpr std::array sign_columns = {
    TurnColumn<std::int8_t>{"turns/direction", "1", "1 at a minimum of the phase, -1 at a maximum",
                            [](Turn t) { return t.direction; }},
};

/// Several values a turn.
struct PulseColumn {
    const char* name;
    const char* unit;
    const char* description;
    const double* (*get)(const ReplayedTurn& turn);
};

constexpr std::array pulse_columns = {
    PulseColumn{"readings/pulses_before_s", "s",
                "pulses before the detectors were sampled, nearest first, from that instant; 0: not resolved",
                [](Turn t) -> const double* { return t.pulses_before_s; }},
    PulseColumn{"readings/pulses_after_s", "s",
                "pulses after the detectors were sampled, nearest first, from that instant; 0: not resolved",
                [](Turn t) -> const double* { return t.pulses_after_s; }},
};

bool same_bits(double a, double b) { return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b); }

std::string program_text(std::string_view version, std::string_view hash) {
    return fmt::format("ringlock {} ({})", printable(version), printable(hash));
}

std::string scenario_text(const Experiment& experiment) { return scenario::to_toml(experiment.scenario); }

/// Keeps files that are there: only a replay of the same gyro may be replaced.
std::filesystem::path keep_other_files(const std::filesystem::path& path, const GyroOfResult& of) {
    std::error_code unreachable;  // claiming the output reports the error if this is no file
    if (!std::filesystem::is_regular_file(path, unreachable)) return path;
    bool same = false;
    try {
        same = store::guarded(path, [&](const store::GuardedPath& guarded) {
            const store::File file = store::File::open(guarded);
            return file.has_attribute("format") && file.string_attribute("format") == format_name &&
                   file.string_attribute("arm") == of.arm_name() && file.int_attribute("gyro") == of.gyro &&
                   file.int_attribute("point") == static_cast<std::int64_t>(of.point) + 1 &&
                   file.dataset("scenario").read<std::string>().at(0) == scenario_text(of.experiment);
        });
    } catch (const Interrupted&) {
        throw;
    } catch (const std::exception&) {
        // Not HDF5 or not readable: still a file that must not be lost.
    }
    if (!same) {
        throw InputError(
            fmt::format("{}: the file exists and is not a replay of this gyro, arm and result; it is kept. "
                        "Give another name with -o, or remove it",
                        printable(path)));
    }
    return path;
}

}  // namespace

std::string GyroOfResult::text() const {
    const std::string at = experiment.has_design() ? fmt::format("point {}, ", point + 1) : "";
    return fmt::format("{}: {}arm {}, gyro {}", printable(result), at, arm_name(), gyro);
}

StoredGyro::StoredGyro(const GyroOfResult& of)
    : of_(of), opened_(store::guarded(of.result, [&](const store::GuardedPath& guarded) {
          Opened opened = open(of, guarded);
          if (!opened.record || !store::is_trial()) return opened;
          // All samples that check_sample() will read.
          for (std::int64_t sample = 0; sample < of.study().schedule.samples; sample += at_once) {
              static_cast<void>(read_samples(of, opened, sample));
          }
          return opened;
      })) {}

StoredGyro::Opened StoredGyro::open(const GyroOfResult& of, const store::GuardedPath& guarded) {
    Opened opened{store::File::open(guarded), {}, {}, 0};
    opened.provenance = store::read_provenance(opened.file);
    for (std::size_t point = 0; point < of.point; ++point) opened.row += of.experiment.points[point].gyros.size();
    opened.row += static_cast<std::uint64_t>(of.gyro);
    if (!of.experiment.scenario.output.angle_record) return opened;
    opened.record = opened.file.group("arms").group(of.arm_name()).dataset("angle_arcsec");
    const store::Shape wanted{static_cast<std::uint64_t>(of.experiment.gyros()),
                              static_cast<std::uint64_t>(of.study().schedule.samples)};
    if (opened.record->shape() != wanted) {
        throw InputError(fmt::format("{}: dataset {} has the shape [{}], [{}] is wanted: the result is damaged",
                                     printable(of.result), printable(opened.record->path()),
                                     fmt::join(opened.record->shape(), ", "), fmt::join(wanted, ", ")));
    }
    return opened;
}

std::vector<double> StoredGyro::read_samples(const GyroOfResult& of, const Opened& opened, std::int64_t first) {
    const auto samples = static_cast<std::uint64_t>(std::min(at_once, of.study().schedule.samples - first));
    return opened.record->read_block<double>(opened.row, 1, static_cast<std::uint64_t>(first), samples);
}

void StoredGyro::check(const gyro::Setup& setup) const {
    const gyro::Setup& stored = of_.study().gyros[static_cast<std::size_t>(of_.gyro)];
    for (const auto& parameter : drawn_parameters) {
        if (same_bits(stored.*parameter.field, setup.*parameter.field)) continue;
        fail(fmt::format("{} [{}]", parameter.name, parameter.unit), stored.*parameter.field, setup.*parameter.field);
    }
}

void StoredGyro::check_sample(std::int64_t sample, double angle_arcsec) {
    if (!opened_.record) return;
    if (const auto next = first_read_ + static_cast<std::int64_t>(read_.size()); sample >= next) {
        first_read_ = sample;
        read_ = read_samples(of_, opened_, sample);
    }
    const double stored = read_[static_cast<std::size_t>(sample - first_read_)];
    if (same_bits(stored, angle_arcsec)) return;
    fail(fmt::format("sample {} of the angle record ({:.6g} s) [arcsec]", sample,
                     static_cast<double>(sample) * of_.study().schedule.sample_interval_s),
         stored, angle_arcsec);
}

void StoredGyro::check(const ReplayFigures& figures) const {
    if (!figures.rate_error_deg_h) return;
    const ArmStatistics& arm = of_.study().arms[of_.arm];
    const double stored = arm.gyros[static_cast<std::size_t>(of_.gyro)].rate_error_deg_h;
    if (!same_bits(stored, *figures.rate_error_deg_h)) fail("rate_error_deg_h", stored, *figures.rate_error_deg_h);
}

void StoredGyro::fail(const std::string& what, double stored, double replayed) const {
    const std::string by = program_text(opened_.provenance.program_version, opened_.provenance.git_hash);
    const std::string here = program_text(version(), git_hash());
    const std::string why =
        by != here
            ? fmt::format("it was written by {}, and this is {}; replay it with the program that wrote it", by, here)
            : "it was changed after it was written, or written on another machine, "
              "whose C library rounds elementary functions in another way; run its scenario anew";
    throw RunError(
        fmt::format("{}: the replay differs from the stored result: {} is {:.17g} there and {:.17g} in the replay. "
                    "About the result: {}",
                    of_.text(), what, stored, replayed, why));
}

std::uint64_t expected_replay_bytes(std::int64_t turns, bool pulses) {
    const std::size_t turn = sizeof(double) * (real_columns.size() + count_columns.size()) + sign_columns.size() +
                             (pulses ? sizeof(double) * readout::kept_pulses * pulse_columns.size() : 0);
    return static_cast<std::uint64_t>(turns) * turn;
}

template <class Columns>
void ReplayWriter::create(const Columns& columns, std::uint64_t rows) {
    for (const auto& column : columns) {
        using T = decltype(column.get(ReplayedTurn{}));
        datasets_.push_back(
            file_.file().create_chunked<T>(column.name, {rows}, chunk_turns, {column.unit, column.description}));
    }
}

ReplayWriter::ReplayWriter(const std::filesystem::path& path, const GyroOfResult& of, const GyroReplay& replay,
                           const GyroReplay::Range& range)
    : file_(keep_other_files(path, of)), of_(of), pulses_(replay.has_pulses()) {
    store::File& root = file_.file();
    const ensemble::Schedule& schedule = replay.schedule();
    root.set_attribute("format", format_name);
    root.set_attribute("format_version", replay_format_version);
    root.set_attribute("seed", of.experiment.scenario.ensemble.seed);
    root.set_attribute("arm", of.arm_name());
    root.set_attribute("point", static_cast<std::int64_t>(of.point) + 1);
    root.set_attribute("gyro", of.gyro);
    root.set_attribute("first_turn", range.first - schedule.settle_turns());
    root.set_attribute("turns_per_sample", 2 * schedule.outputs_per_sample);
    root.set_attribute("scale_factor_arcsec", replay.setup().scale_factor_arcsec);
    root.write("scenario", std::vector<std::string>{scenario_text(of.experiment)},
               {"", "the full resolved scenario of the result, TOML"});
    store::Group gyro = root.create_group("gyro");
    for (const auto& parameter : drawn_parameters) {
        gyro.set_attribute(parameter.name, replay.setup().*parameter.field);
    }
    for (const char* name : {"turns", "truth", "readings", "hardware"}) root.create_group(name);
    const auto rows = static_cast<std::uint64_t>(range.last - range.first);
    create(real_columns, rows);
    create(count_columns, rows);
    create(sign_columns, rows);
    for (std::size_t i = 0; pulses_ && i < pulse_columns.size(); ++i) {
        const PulseColumn& column = pulse_columns[i];
        datasets_.push_back(root.create_chunked<double>(column.name, {rows, readout::kept_pulses}, chunk_turns,
                                                        {column.unit, column.description}));
    }
    waiting_.reserve(chunk_turns);
}

void ReplayWriter::take(std::span<const ReplayedTurn> turns) {
    for (const ReplayedTurn& turn : turns) {
        waiting_.push_back(turn);
        if (waiting_.size() == chunk_turns) flush();
    }
}

template <class Columns>
void ReplayWriter::write(const Columns& columns, std::size_t& dataset) {
    for (const auto& column : columns) {
        std::vector<decltype(column.get(ReplayedTurn{}))> values;
        values.reserve(waiting_.size());
        for (const ReplayedTurn& turn : waiting_) values.push_back(column.get(turn));
        datasets_[dataset++].write_rows(written_, values.size(), std::span(std::as_const(values)));
    }
}

void ReplayWriter::flush() {
    if (waiting_.empty()) return;
    std::size_t dataset = 0;
    write(real_columns, dataset);
    write(count_columns, dataset);
    write(sign_columns, dataset);
    for (std::size_t i = 0; pulses_ && i < pulse_columns.size(); ++i) {
        std::vector<double> values;
        for (const ReplayedTurn& turn : waiting_) {
            const double* const first = pulse_columns[i].get(turn);
            values.insert(values.end(), first, first + readout::kept_pulses);
        }
        datasets_[dataset++].write_rows(written_, waiting_.size(), std::span(std::as_const(values)));
    }
    written_ += waiting_.size();
    waiting_.clear();
}

void ReplayWriter::finish(const ReplayFigures& figures, bool compared, const store::Provenance& of_replay) {
    flush();
    store::File& root = file_.file();
    root.set_attribute("samples_compared", compared ? figures.samples : std::int64_t{0});
    root.set_attribute("angle_error_arcsec", figures.angle_error_arcsec.value_or(layout::nan));
    root.set_attribute("rate_error_deg_h", figures.rate_error_deg_h.value_or(layout::nan));
    root.set_attribute("lockin_step_rms_rad", figures.lockin_step_rms_rad);
    root.set_attribute("left_step_rms_rad", figures.left_step_rms_rad);
    store::write_provenance(root, of_replay);
    store::Group result = root.create_group("result");
    store::write_provenance(result, read_provenance(of_.result));
    datasets_.clear();
    file_.commit();
}

}  // namespace ringlock::study
