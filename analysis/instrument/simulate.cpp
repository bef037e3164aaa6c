#include "analysis/instrument/simulate.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "engine/core/error.hpp"
#include "engine/core/interrupt.hpp"
#include "engine/core/units.hpp"
#include "engine/core/version.hpp"
#include "engine/ensemble/block.hpp"
#include "engine/ensemble/draw.hpp"
#include "engine/ensemble/schedule.hpp"
#include "engine/scenario/active_effects.hpp"
#include "engine/scenario/arm.hpp"
#include "engine/scenario/check.hpp"

namespace ringlock::instrument {
namespace {

using scenario::Scenario;

constexpr std::size_t piece_turns = 4096;  // even
constexpr std::int64_t most_rows = 200'000'000;
constexpr double most_witnesses = 4.0;  // three axes and a temperature

/// The scenario with the one arm that is recorded, its rules and the number of the gyro checked.
Scenario with_trajectory(Scenario scenario, std::int64_t gyro) {
    const std::int64_t gyros = ensemble::total_gyros(scenario);
    if (gyro < 0 || gyro >= gyros) {
        throw InputError(fmt::format("gyro {}: the scenario has the gyros 0 to {}", gyro, gyros - 1));
    }
    scenario.arms = {scenario.record.trajectory};
    scenario.reader.output_hz = 0.0;  // of studies; a record has a rate of its own
    const auto complaints = scenario::check(scenario);
    if (!complaints.empty()) {
        throw InputError(
            fmt::format("the trajectory to be recorded (record.trajectory) breaks a rule of key \"{}\": {}",
                        complaints.front().keys.front(), complaints.front().problem));
    }
    return scenario;
}

record::Declared declared(const Scenario& s, double start_s, double end_s) {
    const bool ideal = s.readout.model == scenario::ReadoutModel::ideal;
    const bool converted = s.readout.model == scenario::ReadoutModel::instrument && s.readout.adc_bits > 0;
    // Steps of a converter of +-1.25 fringe amplitudes are uniform errors.
    const double step = converted ? 2.5 / std::ldexp(1.0, static_cast<int>(s.readout.adc_bits)) : 0.0;
    record::Declared d;
    d.scale_factor_arcsec = s.gyro.scale_factor_arcsec;
    d.lockin_threshold_deg_h = s.gyro.lockin_threshold_deg_h;
    d.dither_frequency_hz = s.dither.frequency_hz;
    d.dither_peak_rate_deg_s = s.dither.peak_rate_deg_s;
    d.bias_deg_h = 0.0;
    d.clock_hz = ideal ? 0.0 : s.readout.clock_hz;
    d.readout_noise_rad = ideal ? 0.0 : std::hypot(s.readout.detector_noise_relative, step / std::sqrt(12.0));
    d.input_rate_deg_h = scenario::has_profile(s.input)
                             ? scenario::profile_angle_arcsec(s.input, start_s, end_s - start_s) / (end_s - start_s)
                             : s.input.rate_deg_h;
    return d;
}

record::Track input_rate(const Scenario& s, std::int64_t gyro, double start_s, double end_s) {
    record::Track track;
    const auto add = [&](double time_s, double rate) {
        track.time_s.push_back(time_s);
        track.value.push_back(rate);
    };
    if (!scenario::has_profile(s.input)) {
        const double rate = ensemble::input_rate_deg_h(s, gyro);
        add(start_s, rate);
        add(end_s, rate);
        return track;
    }
    add(start_s, scenario::profile_rate_deg_h(s.input, start_s));
    for (std::size_t i = 0; i < s.input.profile_time_s.size(); ++i) {
        const double time_s = s.input.profile_time_s[i];
        if (time_s > start_s && time_s < end_s) add(time_s, s.input.profile_rate_deg_h[i]);
    }
    add(end_s, scenario::profile_rate_deg_h(s.input, end_s));
    return track;
}

record::Track temperature(const Scenario& s, double start_s, double end_s) {
    record::Track track;
    if (!scenario::temperature_varies(s.environment)) return track;
    const auto rows = static_cast<std::int64_t>(std::ceil((end_s - start_s) / s.record.temperature_interval_s));
    for (std::int64_t i = 0; i <= rows; ++i) {
        const double time_s = start_s + static_cast<double>(i) * s.record.temperature_interval_s;
        track.time_s.push_back(time_s);
        track.value.push_back(start_temperature_c + scenario::temperature_change_k(s.environment, time_s));
    }
    return track;
}

/// Action of an effect on the samples.
struct Stage {
    const effects::Effect* effect;
    std::unique_ptr<effects::SampleStage> does;
};
using Stages = std::vector<Stage>;

/// Actions of all effects on the samples, in the order of application.
Stages sample_stages(const Scenario& s, std::int64_t gyro) {
    Stages stages;
    const random::Identity who{s.ensemble.seed, static_cast<std::uint64_t>(gyro)};
    for (const auto& [effect, values] : scenario::active_effects(s)) {
        if (auto stage = effect->sample_stage(*values, who)) stages.push_back({effect, std::move(stage)});
    }
    std::stable_sort(stages.begin(), stages.end(),
                     [](const Stage& a, const Stage& b) { return a.does->place() < b.does->place(); });
    return stages;
}

/// Samples as taken made into those of a record.
void apply(const Stages& stages, double record_hz, double start_s, std::size_t wanted, record::Samples& samples) {
    effects::Sampled sampled;
    sampled.rate_hz = samples.rate_hz;
    sampled.record_hz = record_hz;
    sampled.start_s = start_s;
    sampled.increment_arcsec = std::move(samples.values);
    for (const Stage& stage : stages) stage.does->apply(sampled);
    samples.rate_hz = record_hz;
    samples.t0_s = start_s + 1.0 / record_hz;
    samples.values = std::move(sampled.increment_arcsec);
    samples.values.resize(std::min(wanted, samples.values.size()));
    samples.witnesses = std::move(sampled.witnesses);
    for (auto& [name, values] : samples.witnesses) values.resize(samples.values.size());
}

void reserve(std::size_t rows, record::Turns& turns) {
    turns.time_s.reserve(rows);
    turns.direction.reserve(rows);
    turns.quarter_count.reserve(rows);
    for (std::vector<double>* column :
         {&turns.sine, &turns.cosine, &turns.accel_before_rad_s2, &turns.accel_after_rad_s2}) {
        column->reserve(rows);
    }
}

void add_turns(const ensemble::GyroBlock& block, std::int64_t first_turn, double clock_hz, record::Turns& turns) {
    const readout::LaneReadings& readings = block.hardware(0);
    for (std::size_t i = 0; i < readings.turns; ++i) {
        const std::int64_t number = first_turn + static_cast<std::int64_t>(i);
        double time_s = block.turn_time_s(number, 0) + readings.zero_rate_s[i][0];
        // Whole ticks, but for the rounding of sums.
        if (clock_hz > 0.0) time_s = std::nearbyint(time_s * clock_hz) / clock_hz;
        turns.time_s.push_back(time_s);
        turns.direction.push_back(readings.minimum(i) ? 1 : -1);
        turns.quarter_count.push_back(block.quarter_count(0, i, 0));
        turns.sine.push_back(readings.sine[i][0]);
        turns.cosine.push_back(readings.cosine[i][0]);
        turns.accel_before_rad_s2.push_back(readings.accel_before_rad_s2[i][0]);
        turns.accel_after_rad_s2.push_back(readings.accel_after_rad_s2[i][0]);
    }
}

/// The number of rows of a record, and the points and channels from which its samples are computed.
struct Extent {
    bool samples = false;
    double rows = 0.0;  ///< of the record
    Stages stages;      ///< of samples
    double source_hz = 0.0;
    double source_rows = 0.0;  ///< samples taken before the stages
};

/// Throws InputError where the record would have no rows, or more than are allowed.
Extent extent_of(const Scenario& s, std::int64_t gyro) {
    Extent extent;
    const bool samples = extent.samples = s.record.kind == scenario::RecordKind::samples;
    const double cycles = s.ensemble.duration_s * s.dither.frequency_hz;
    const double rows = extent.rows = samples ? s.ensemble.duration_s * s.record.rate_hz : 2.0 * cycles;
    if (!(rows <= static_cast<double>(most_rows)) || !(2.0 * cycles <= 1e12)) {
        throw InputError(
            fmt::format("key \"ensemble.duration_s\" = {:g}: a record of {:.3g} rows; at most {} are allowed",
                        s.ensemble.duration_s, rows, most_rows));
    }
    if (samples && rows < 1.0) {
        throw InputError(fmt::format("key \"record.rate_hz\" = {:g}: a record of {:g} s holds no sample",
                                     s.record.rate_hz, s.ensemble.duration_s));
    }
    if (!samples) return extent;
    extent.stages = sample_stages(s, gyro);
    double source_hz = s.record.rate_hz;
    std::string key = "record.rate_hz";
    for (const Stage& stage : extent.stages) {
        const double needed_hz = stage.does->source_hz(source_hz);
        if (needed_hz != source_hz) {
            const effects::Parameter* rate = effects::first_of(*stage.effect, effects::Role::sampled);
            key = fmt::format("effects.{}.{}", stage.effect->name(), rate->name);
        }
        source_hz = needed_hz;
    }
    const double source_rows =
        std::ceil(s.ensemble.duration_s * source_hz - 1e-9) + (extent.stages.empty() ? 0.0 : 1.0);
    if (!(source_rows <= static_cast<double>(most_rows))) {
        throw InputError(fmt::format("key \"{}\" = {:g}: {:.3g} samples; at most {} are allowed", key, source_hz,
                                     source_rows, most_rows));
    }
    extent.source_hz = source_hz;
    extent.source_rows = source_rows;
    return extent;
}

}  // namespace

record::Record simulate_record(const Scenario& asked, std::int64_t gyro) {
    const Scenario s = with_trajectory(asked, gyro);
    const Extent extent = extent_of(s, gyro);
    const bool samples = extent.samples;
    const double cycles = s.ensemble.duration_s * s.dither.frequency_hz;
    const ensemble::Schedule schedule(s);
    const std::int64_t settle_turns = schedule.settle_turns();
    std::optional<ensemble::ReaderPlan> plan;
    if (samples) plan = {extent.source_hz, settle_turns};
    ensemble::GyroBlock block(s, s.arms, gyro, 1, samples ? ensemble::Detail::output : ensemble::Detail::hardware,
                              plan);

    std::int64_t turn = 0;
    const auto advance = [&](std::int64_t until, const auto& use) {
        while (turn < until) {
            check_interrupt();
            const auto turns = static_cast<std::size_t>(std::min<std::int64_t>(piece_turns, until - turn));
            block.advance(turns);
            use(turn, turns);
            turn += static_cast<std::int64_t>(turns);
        }
    };
    advance(settle_turns, [](std::int64_t, std::size_t) {});

    record::Record out;
    out.title = fmt::format("gyro {} of seed {}, {}", gyro, s.ensemble.seed, s.arms.front().name);
    out.instrument = "simulated ring laser gyro";
    out.source = fmt::format("ringlock {} record", version());
    // A reader is not fit for use at once: the record begins once it is.
    const std::int64_t warm_up = samples ? block.reader(0, 0).warm_up_outputs() : 0;
    const double start_s =
        block.turn_time_s(settle_turns, 0) + (samples ? static_cast<double>(warm_up) / extent.source_hz : 0.0);
    const std::int64_t turns = std::max<std::int64_t>(2, std::llround(2.0 * cycles)) + 1;
    const double end_s = samples ? start_s + s.ensemble.duration_s : block.turn_time_s(settle_turns + turns - 1, 0);
    out.declared = declared(s, start_s, end_s);
    if (samples) {
        const Stages& stages = extent.stages;
        const auto wanted = static_cast<std::size_t>(std::floor(extent.rows + 1e-9));
        const auto taken = stages.empty() ? wanted : static_cast<std::size_t>(extent.source_rows);
        record::Samples taking;
        taking.rate_hz = extent.source_hz;
        taking.t0_s = start_s + 1.0 / extent.source_hz;
        taking.values.reserve(taken);
        std::optional<double> last_arcsec;
        const auto sample = [&](std::int64_t, std::size_t) {
            const reader::Reader& reader = block.reader(0, 0);
            std::int64_t number = reader.first_output();
            for (const double angle_arcsec : reader.angles_arcsec()) {
                if (number++ < warm_up) continue;
                if (last_arcsec && taking.values.size() < taken) taking.values.push_back(angle_arcsec - *last_arcsec);
                last_arcsec = angle_arcsec;
            }
        };
        while (taking.values.size() < taken) advance(turn + static_cast<std::int64_t>(piece_turns), sample);
        out.samples = std::move(taking);
        const reader::Reader& reader = block.reader(0, 0);
        out.reader =
            record::DeclaredReader{s.reader, reader.stripper().delay_s(), reader.stripper().residue_relative()};
        out.reader->settings.latch_hz = reader::latch_hz(s.reader, extent.source_hz);
        if (!stages.empty()) apply(stages, s.record.rate_hz, start_s, wanted, *out.samples);
    } else {
        const bool clocked = s.readout.model != scenario::ReadoutModel::ideal && s.readout.clock_hz > 0.0;
        out.turns.emplace();
        reserve(static_cast<std::size_t>(turns), *out.turns);
        advance(settle_turns + turns, [&](std::int64_t first, std::size_t) {
            add_turns(block, first, clocked ? s.readout.clock_hz : 0.0, *out.turns);
        });
    }
    out.input_rate_deg_h = input_rate(s, gyro, start_s, end_s);
    out.temperature_c = temperature(s, start_s, end_s);
    return out;
}

Room expected_room(const Scenario& asked, std::int64_t gyro) {
    const Scenario s = with_trajectory(asked, gyro);
    const Extent extent = extent_of(s, gyro);
    constexpr double of_program = 40e6;
    constexpr double real = 8.0;
    if (!extent.samples) {
        constexpr double of_turn = 6.0 * real + 1.0;  // five numbers, a count, a direction
        return {static_cast<std::uint64_t>(of_program + of_turn * extent.rows),
                static_cast<std::uint64_t>(of_turn * extent.rows)};
    }
    // Each stage computes new samples while the old ones still exist, and may add a witness channel for each axis.
    const double source_bytes = real * extent.source_rows;
    const double made_bytes = extent.stages.empty() ? 0.0 : source_bytes + real * most_witnesses * extent.rows;
    return {static_cast<std::uint64_t>(of_program + source_bytes + made_bytes),
            static_cast<std::uint64_t>(real * (extent.stages.empty() ? 1.0 : 1.0 + most_witnesses) * extent.rows)};
}

}  // namespace ringlock::instrument
