#include "analysis/study/study.hpp"

#include <fmt/format.h>
#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <memory>
#include <mutex>
#include <utility>

#include "analysis/allan/bounded_record.hpp"
#include "analysis/allan/factor_stream.hpp"
#include "analysis/allan/octave_deviation.hpp"
#include "analysis/allan/octave_stream.hpp"
#include "analysis/study/angle_counts.hpp"
#include "engine/core/error.hpp"
#include "engine/ensemble/arena.hpp"
#include "engine/ensemble/closed_form.hpp"
#include "engine/ensemble/draw.hpp"
#include "engine/ensemble/output_counts.hpp"
#include "engine/scenario/injected_noise.hpp"

namespace ringlock::study {

namespace {

bool is_octave(std::int64_t m) { return (m & (m - 1)) == 0; }

/// Octaves of an output, and the requested averaging times in whole outputs.
std::vector<std::int64_t> factors_of(const scenario::Scenario& scenario, const ensemble::Schedule& schedule) {
    auto factors = allan::octave_factors(allan::largest_factor(allan::Estimator::oadev, schedule.outputs()));
    for (const double tau_s : scenario.output.tau_s) factors.push_back(ensemble::outputs_in(schedule, tau_s));
    const scenario::Specification& wanted = scenario.specification;
    if (wanted.bias_stability_deg_h > 0.0) factors.push_back(ensemble::outputs_in(schedule, wanted.at_s));
    std::sort(factors.begin(), factors.end());
    factors.erase(std::unique(factors.begin(), factors.end()), factors.end());
    return factors;
}

}  // namespace

Study::Study(const scenario::Scenario& what)
    : scenario(what),
      schedule(what),
      factors(factors_of(what, schedule)),
      angle_times_s(std::begin(dither::spread_times_s), std::end(dither::spread_times_s)) {
    const std::vector<double>& asked = scenario.output.angle_after_s;
    angle_times_s.insert(angle_times_s.end(), asked.begin(), asked.end());
    if (scenario.specification.angle_error_arcsec > 0.0) angle_times_s.push_back(scenario.specification.after_s);
    const auto total = static_cast<std::size_t>(ensemble::total_gyros(scenario));
    gyros.resize(total);
    for (const scenario::Arm& arm : scenario.arms) arms.push_back({arm, std::vector<GyroStatistics>(total)});
}

std::optional<std::int64_t> Study::angle_output(std::size_t time) const {
    const std::int64_t output = ensemble::outputs_in(schedule, angle_times_s[time]);
    const std::int64_t last = schedule.outputs() - 1;
    if (output > last + schedule.outputs_per_sample) return std::nullopt;
    return std::min(output, last);
}

std::uint64_t expected_memory_bytes(const scenario::Scenario& scenario) {
    const Study one = [&] {
        scenario::Scenario single = scenario;
        single.design = {};
        single.ensemble.gyros = single.ensemble.turn_ons = 1;
        return Study(single);
    }();
    const std::int64_t gyros =
        scenario::asks(scenario.stop) ? scenario.stop.most_gyros : ensemble::total_gyros(scenario);
    // Heads of vectors, texts, and the gaps that the blocks leave between them when they go; measured.
    constexpr std::uint64_t of_heap = 800;
    const std::uint64_t of_gyro = sizeof(GyroStatistics) + one.factors.size() * sizeof(allan::Point) +
                                  one.angle_times_s.size() * sizeof(double) + of_heap;
    // A scenario with its effects, in some hundred nodes of its maps.
    constexpr std::uint64_t of_point = 24'000;
    return of_point + static_cast<std::uint64_t>(gyros) *
                          (sizeof(gyro::Setup) + static_cast<std::uint64_t>(scenario.arms.size()) * of_gyro);
}

bool has_closed_form(const scenario::Scenario& scenario, const scenario::Arm& arm) {
    const bool plain = !arm.ideal && !arm.noise_injected && arm.compensator == scenario::Compensator::none;
    return plain && ensemble::drive_repeats(scenario);
}

bool shows_noise(const scenario::Arm& arm) {
    return arm.noise_injected && arm.compensator == scenario::Compensator::none;
}

bool has_steady_input(const scenario::Scenario& scenario) {
    return scenario.input.sweep_points == 1 && !scenario::has_profile(scenario.input);
}

namespace {

bool awaits_prediction(const Study& study) {
    const std::vector<scenario::Arm>& arms = study.scenario.arms;
    return !study.predicted_noise && std::any_of(arms.begin(), arms.end(), shows_noise);
}

}  // namespace

void predict_noise(Study& study) {
    if (!awaits_prediction(study)) return;
    const scenario::Scenario& scenario = study.scenario;
    dither::InjectedTurns noise;
    if (scenario.noise_injection.model == scenario::NoiseModel::drive) noise.drive = scenario::drive_noise(scenario);
    noise.rms_rad = scenario::injected_noise(scenario).turn_rms_rad;
    const bool steady = has_steady_input(scenario);
    gyro::Setup setup = ensemble::nominal_setup(scenario);
    if (!steady) setup.lockin_threshold_deg_h = 0.0;  // the change per cycle does not depend on it
    study.predicted_noise = dither::predict_noise_effectiveness(setup, noise);
    if (steady) return;
    study.predicted_noise->bias_deg_h.reset();
    study.predicted_noise->reason = "the input rate is not steady";
}

namespace {

/// Samples gathered before they are handed on: enough for an efficient write.
constexpr std::size_t gathered_samples = 256;

/// The statistics of one arm of one block while it is simulated.
class ArmStream {
   public:
    ArmStream(const Study& study, std::size_t number, std::size_t arm, std::int64_t first_gyro, std::size_t gyros,
              BlockKeeper& keeper)
        : study_(study),
          gyros_(gyros),
          keeper_(keeper),
          wants_samples_(keeper.wants_samples()),
          angle_errors_counts_(study.angle_times_s.size()),
          record_((study.schedule.samples - 1) / study.schedule.samples_per_fit + 1, fit_samples),
          waiting_{number, arm, first_gyro, gyros, 0, {}} {
        for (auto& errors : angle_errors_counts_) errors.fill(std::numeric_limits<double>::quiet_NaN());
        for (const std::int64_t m : study.factors) {
            if (!is_octave(m)) asked_.emplace_back(m);
        }
    }

    void add(std::span<const simd::LaneCounts> counts) {
        if (output_ == 0 && !counts.empty()) angle_.start(counts.front());
        note_angles(counts);
        octaves_.add(counts, gyros_);
        for (allan::FactorStream& stream : asked_) stream.add(counts, gyros_);
        const std::int64_t every = study_.schedule.outputs_per_sample;
        for (const simd::LaneCounts& row : counts) {
            const std::int64_t output = output_++;
            if (output % every != 0) continue;
            if (output / every % study_.schedule.samples_per_fit == 0) record_.add({&row, 1});
            take_sample(row);
        }
        // Counts wrap round within hours at high rates, which may be between two samples: never within a piece.
        if (!counts.empty()) angle_.turn_to(counts.back());
    }

    GyroStatistics finish(std::size_t lane, const gyro::Setup& setup) const {
        const double arcsec_per_count = setup.scale_factor_arcsec / ensemble::counts_per_fringe;
        GyroStatistics result;
        const auto octaves = allan::deviation(octaves_, lane, arcsec_per_count, study_.schedule.output_s);
        result.allan.reserve(octaves.size() + asked_.size());
        result.allan.insert(result.allan.end(), octaves.begin(), octaves.end());
        for (const allan::FactorStream& stream : asked_) {
            result.allan.push_back(allan::deviation(stream, lane, octaves, arcsec_per_count, study_.schedule.output_s));
        }
        std::sort(result.allan.begin(), result.allan.end(),
                  [](const allan::Point& a, const allan::Point& b) { return a.m < b.m; });
        const std::int64_t samples_per_fit = study_.schedule.samples_per_fit * record_.interval();
        result.noise = noise::fit_noise(record_.phase(lane, arcsec_per_count),
                                        study_.schedule.sample_interval_s * static_cast<double>(samples_per_fit));
        result.rate_error_deg_h = rate_error_deg_h(angle_.turned(lane), study_.schedule, setup);
        result.angle_error_arcsec.reserve(angle_errors_counts_.size());
        for (std::size_t i = 0; i < angle_errors_counts_.size(); ++i) {
            result.angle_error_arcsec.push_back(angle_errors_counts_[i][lane] * arcsec_per_count -
                                                setup.input_rate_deg_h * study_.schedule.output_s *
                                                    static_cast<double>(output_at(i)));
        }
        return result;
    }

    /// Hands the waiting samples on.
    void flush() {
        if (waiting_rows_.empty()) return;
        const std::size_t samples = waiting_rows_.size();
        waiting_.angle_arcsec.resize(gyros_ * samples);
        const double scale_factor_arcsec = study_.scenario.gyro.scale_factor_arcsec;
        for (std::size_t lane = 0; lane < gyros_; ++lane) {
            for (std::size_t i = 0; i < samples; ++i) {
                waiting_.angle_arcsec[lane * samples + i] = angle_arcsec(waiting_rows_[i][lane], scale_factor_arcsec);
            }
        }
        keeper_.samples(waiting_);
        waiting_.first_sample += static_cast<std::int64_t>(samples);
        waiting_rows_.clear();
    }

   private:
    /// Output at which an angle error is taken; one beyond the record where the record does not reach that time.
    std::int64_t output_at(std::size_t i) const { return study_.angle_output(i).value_or(study_.schedule.outputs()); }

    /// Keeps angles at those times.
    void note_angles(std::span<const simd::LaneCounts> counts) {
        for (std::size_t i = 0; i < angle_errors_counts_.size(); ++i) {
            const std::int64_t row = output_at(i) - output_;
            if (row < 0 || row >= static_cast<std::int64_t>(counts.size())) continue;
            angle_.turn_to(counts[static_cast<std::size_t>(row)]);
            for (std::size_t lane = 0; lane < gyros_; ++lane) {
                angle_errors_counts_[i][lane] = static_cast<double>(angle_.turned(lane));
            }
        }
    }

    void take_sample(const simd::LaneCounts& row) {
        angle_.turn_to(row);
        if (!wants_samples_) return;
        std::array<WideCounts, simd::lanes> angle{};
        for (std::size_t lane = 0; lane < gyros_; ++lane) angle[lane] = angle_.angle(lane);
        waiting_rows_.push_back(angle);
        if (waiting_rows_.size() == gathered_samples) flush();
    }

    const Study& study_;
    std::size_t gyros_;
    BlockKeeper& keeper_;
    bool wants_samples_;
    std::vector<std::array<double, simd::lanes>> angle_errors_counts_;  ///< at Study::angle_times_s
    allan::OctaveStream octaves_;
    std::vector<allan::FactorStream> asked_;  ///< averaging times that are no octaves
    allan::BoundedRecord record_;
    std::int64_t output_ = 0;
    AngleCounts angle_;
    SampledAngles waiting_;
    std::vector<std::array<WideCounts, simd::lanes>> waiting_rows_;
};

/// One block of gyros of a study.
class BlockStatistics final : public ensemble::BlockSink {
   public:
    BlockStatistics(Study& study, std::size_t number, std::mutex& mutex, std::int64_t first_gyro, std::size_t gyros,
                    std::unique_ptr<BlockKeeper> keeper)
        : study_(study), mutex_(mutex), number_(number), gyros_(gyros), keeper_(std::move(keeper)) {
        for (std::size_t arm = 0; arm < study.arms.size(); ++arm) {
            arms_.push_back(std::make_unique<ArmStream>(study, number, arm, first_gyro, gyros, *keeper_));
        }
    }

    void angles(std::size_t arm, std::span<const simd::LaneCounts> counts) override { arms_[arm]->add(counts); }

    void finish(const ensemble::BlockResult& result) override {
        FinishedBlock block{number_,
                            result.first_gyro,
                            result.setups,
                            {},
                            result.turns,
                            result.tables_remade,
                            result.contradictory_readings,
                            result.turn_map_error_rad};
        for (std::size_t arm = 0; arm < arms_.size(); ++arm) {
            arms_[arm]->flush();
            block.arms.push_back(statistics(arm, result));
        }
        keeper_->finish(block);
        const std::lock_guard lock(mutex_);
        take_up(study_, block);
    }

   private:
    std::vector<GyroStatistics> statistics(std::size_t arm, const ensemble::BlockResult& result) const {
        const scenario::Arm& which = study_.arms[arm].arm;
        const bool closed_form = has_closed_form(study_.scenario, which);
        std::vector<GyroStatistics> found;
        for (std::size_t lane = 0; lane < gyros_; ++lane) {
            GyroStatistics& gyro = found.emplace_back(arms_[arm]->finish(lane, result.setups[lane]));
            if (shows_noise(which)) gyro.change_per_cycle_rad = result.change_per_cycle_rad[lane];
            if (closed_form) {
                gyro.rate_error_closed_form_deg_h = ensemble::closed_form_rate_error_deg_h(result.setups[lane]);
            }
        }
        return found;
    }

    Study& study_;
    std::mutex& mutex_;
    std::size_t number_;
    std::size_t gyros_;
    std::unique_ptr<BlockKeeper> keeper_;
    std::vector<std::unique_ptr<ArmStream>> arms_;
};

class Forwarding final : public BlockKeeper {
   public:
    explicit Forwarding(const OnSamples& on_samples) : on_samples_(on_samples) {}
    bool wants_samples() const override { return static_cast<bool>(on_samples_); }
    void samples(const SampledAngles& samples) override { on_samples_(samples); }
    void finish(const FinishedBlock&) override {}

   private:
    const OnSamples& on_samples_;
};

}  // namespace

MakeKeeper hand_on(OnSamples on_samples) {
    return [on_samples = std::move(on_samples)](std::size_t, std::int64_t, std::size_t) {
        return std::make_unique<Forwarding>(on_samples);
    };
}

void take_up(Study& study, const FinishedBlock& block) {
    const auto first = static_cast<std::size_t>(block.first_gyro);
    std::copy(block.gyros.begin(), block.gyros.end(), study.gyros.begin() + block.first_gyro);
    for (std::size_t arm = 0; arm < block.arms.size(); ++arm) {
        for (std::size_t i = 0; i < block.arms[arm].size(); ++i) study.arms[arm].gyros[first + i] = block.arms[arm][i];
    }
    // Sums of whole numbers and a maximum: the order of the blocks does not matter.
    study.turns += block.turns;
    study.tables_remade += block.tables_remade;
    study.contradictory_readings += block.contradictory_readings;
    study.turn_map_error_rad = std::max(study.turn_map_error_rad, block.turn_map_error_rad);
}

void extend(Study& study, std::int64_t gyros) {
    study.scenario.ensemble.gyros = gyros;
    study.gyros.resize(static_cast<std::size_t>(gyros));
    for (ArmStatistics& arm : study.arms) arm.gyros.resize(static_cast<std::size_t>(gyros));
}

void predict_noise(std::span<Study> studies, int threads, const ensemble::Monitor& monitor) {
    const auto predictions = std::count_if(studies.begin(), studies.end(), awaits_prediction);
    if (predictions == 0) return;
    std::atomic<std::int64_t> done = 0;
    const auto tell = [&](std::int64_t predicted) {
        if (monitor.observer)
            monitor.observer->stage(fmt::format("predicting the effect of the noise, {}/{}", predicted, predictions));
    };
    tell(0);
    ensemble::on_threads(threads, [&] {
        oneapi::tbb::parallel_for(std::size_t{0}, studies.size(), [&](std::size_t i) {
            if (!awaits_prediction(studies[i])) return;
            if (monitor.cancelled && monitor.cancelled()) throw Interrupted();
            predict_noise(studies[i]);
            tell(++done);
        });
    });
}

void run(std::span<Study> studies, std::span<const Stretch> stretches, int threads, const MakeKeeper& make_keeper,
         const ensemble::Monitor& monitor) {
    std::mutex mutex;
    std::vector<ensemble::Job> jobs;
    for (const Stretch& stretch : stretches) {
        Study& study = studies[stretch.study];
        const auto make_sink = [&, number = stretch.study](std::int64_t first_gyro, std::size_t gyros) {
            return std::make_unique<BlockStatistics>(study, number, mutex, first_gyro, gyros,
                                                     make_keeper(number, first_gyro, gyros));
        };
        jobs.push_back({&study.scenario, study.scenario.arms, stretch.first, stretch.last, make_sink,
                        studies.size() > 1 ? fmt::format("point {}", stretch.study + 1) : ""});
    }
    ensemble::run(jobs, threads, monitor);
}

Study run(Study study, int threads, const OnSamples& on_samples, const ensemble::Monitor& monitor) {
    predict_noise({&study, 1}, threads, monitor);
    const Stretch all{0, 0, ensemble::total_gyros(study.scenario)};
    run({&study, 1}, {&all, 1}, threads, hand_on(on_samples), monitor);
    return study;
}

}  // namespace ringlock::study
